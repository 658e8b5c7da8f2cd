# Adds the packages of this folder to the environment of the fish that sources it.
# 'setup.fish' does so too, after the workspaces that this one was built on.
#
# Written by forge after every build, from the share/PACKAGE/package.dsv of each package.

# The folder of this tree, wherever it was moved and from wherever this script is sourced.
set -g _forge_root (builtin realpath -s -- (status filename) | string replace -r '/[^/]*$' '')

set -g _forge_gone
# Packages that were removed since then are left out.
for _forge_name in \
    library \
    odd \
    programs

    if not test -e "$_forge_root/$_forge_name/share/colcon-core/packages/$_forge_name"
        set -a _forge_gone $_forge_name
    end
end

# _forge_select VARIABLE ENTRIES...: set _forge_held to what the variable holds, and _forge_new to those
# of the entries that are not among it and whose package is still there.
# Entries are paths below this folder, or one path that begins with '/'.
function _forge_select
    set -l variable $argv[1]
    set -g _forge_held
    if test -n "$$variable"
        set _forge_held (string split : -- "$$variable")
    end
    set -g _forge_new $argv[2..-1]
    if not string match -q '/*' -- $_forge_new[1]
        for name in $_forge_gone
            set _forge_new (printf '%s\n' $_forge_new | string match -v -r -- "^$name(/|\$)")
        end
        set -q _forge_new[1]; or return
        set _forge_new $_forge_root/$_forge_new
        if not string replace -q -- $_forge_root '' "$$variable"
            # Nothing of this tree is there yet.
            return
        end
    end
    set -l size (count $_forge_new)
    if test (count $_forge_held) -ge $size; and test "$_forge_new" = "$_forge_held[1..$size]"
        # Sourced before: there is nothing to add.
        set _forge_new
        return
    end
    set -l entries $_forge_new
    set _forge_new
    for entry in $entries
        contains -- $entry $_forge_held; or set -a _forge_new $entry
    end
end

# _forge_prepend VARIABLE ENTRIES...: put the selected entries before those that the variable holds.
function _forge_prepend
    _forge_select $argv
    if set -q _forge_new[1]
        set -gx $argv[1] (string join : -- $_forge_new $_forge_held)
    end
end

# _forge_first VARIABLE ENTRY: make the entry the first one, and drop empty ones.
function _forge_first
    set -l variable $argv[1]
    set -l entries $argv[2]
    for entry in (string split --no-empty : -- "$$variable")
        test "$entry" = "$argv[2]"; or set -a entries $entry
    end
    set -gx $variable (string join : -- $entries)
end

# _forge_append VARIABLE ENTRIES...: put the selected entries after those that the variable holds.
function _forge_append
    _forge_select $argv
    if set -q _forge_new[1]
        set -gx $argv[1] (string join : -- $_forge_held $_forge_new)
    end
end

# _forge_present SCRIPT: tell if the script can be sourced; warn if not, for all else works without.
function _forge_present
    if not test -f "$argv[1]"
        printf "warning: '%s' is not there any more and is left out\n" "$argv[1]" >&2
        return 1
    end
    if test -n "$COLCON_TRACE"
        printf '# source "%s"\n' "$argv[1]"
    end
end

# _forge_sh SCRIPT VARIABLE=VALUE...: let sh source a script that is not for fish, given the
# variables, and take over what that changes in the environment. Functions and aliases stay in sh.
function _forge_sh
    set -l program '# Tells the environment before and after sourcing "$1", each variable followed by NUL, and another NUL
# between the two. What the script prints goes to stderr.
exec 3>&1 1>&2

# What ament promises to the hooks of its packages.
ament_append_value() {
  eval "export $1=\"\${$1:+\$$1:}\$2\""
}

ament_append_unique_value() {
  eval "_forge_held=:\${$1-}:"
  case $_forge_held in
    *":$2:"*) ;;
    *) ament_append_value "$1" "$2" ;;
  esac
}

ament_prepend_unique_value() {
  eval "_forge_held=:\${$1-}:"
  case $_forge_held in
    *":$2:"*) ;;
    *) eval "export $1=\"\$2\${$1:+:\$$1}\"" ;;
  esac
}

# _colcon_prepend_unique_value VARIABLE ENTRY: make the entry the first one, and drop empty ones.
_colcon_prepend_unique_value() {
  eval "_forge_held=:\${$1-}:"
  while :; do
    case $_forge_held in
      *":$2:"*) _forge_held=${_forge_held%%":$2:"*}:${_forge_held#*":$2:"} ;;
      *::*) _forge_held=${_forge_held%%::*}:${_forge_held#*::} ;;
      *) break ;;
    esac
  done
  _forge_held=$2$_forge_held
  export "$1=${_forge_held%:}"
  unset _forge_held
}

/usr/bin/env -0 >&3
printf "\000" >&3
. "$1" </dev/null || :
exec /usr/bin/env -0 >&3'
    set -l before
    set -l after
    set -l side before
    for pair in (env $argv[2..-1] sh -c $program sh $argv[1] | string split0)
        if test -z "$pair"
            set side after
        else if string match -q -r '^(?!(_|SHLVL|PWD|OLDPWD|(COLCON|AMENT)_CURRENT_PREFIX)=)[A-Za-z_]\w*=' -- $pair
            set -a $side $pair
        end
    end
    if not set -q after[1]
        printf "warning: '%s' ends the shell and is left out\n" "$argv[1]" >&2
        return
    end
    for pair in $before
        contains -- $pair $after; or set -e -g (string replace -r '(?s)=.*' '' -- $pair)
    end
    for pair in $after
        if not contains -- $pair $before
            set -l name (string replace -r '(?s)=.*' '' -- $pair)
            set -gx $name (string replace -- "$name=" '' $pair | string collect)
        end
    end
end

_forge_first COLCON_PREFIX_PATH "$_forge_root"

_forge_prepend CMAKE_PREFIX_PATH "library"

_forge_prepend LD_LIBRARY_PATH "library/lib"

_forge_prepend AMENT_PREFIX_PATH "library"

if test -e "$_forge_root/odd/share/colcon-core/packages/odd"
    _forge_prepend PATH "/opt/odd \$HOME"
end

_forge_append PATH "odd/last"

if test -e "$_forge_root/odd/share/colcon-core/packages/odd"
    set -gx ODD_MODEL "the \"great\" one"
end

if test -e "$_forge_root/odd/share/colcon-core/packages/odd"; and test -z "$ODD_HOME"
    set -gx ODD_HOME "$_forge_root/odd/share/odd"
end

# A hook of 'odd'.
if _forge_present "$_forge_root/odd/share/odd/hook.sh"
    _forge_sh "$_forge_root/odd/share/odd/hook.sh" \
        COLCON_CURRENT_PREFIX="$_forge_root/odd" \
        AMENT_CURRENT_PREFIX="$_forge_root/odd"
end

_forge_prepend AMENT_PREFIX_PATH \
    "programs" \
    "odd"

_forge_prepend PATH "programs/bin"

_forge_prepend PYTHONPATH "programs/lib/python3.11/site-packages"

functions -e _forge_select _forge_prepend _forge_first _forge_append
functions -e _forge_present _forge_sh
set -e -g _forge_root
set -e -g _forge_gone
set -e -g _forge_held
set -e -g _forge_new
