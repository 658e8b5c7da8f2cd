# Adds the package 'odd' to the environment of the fish that sources it; nothing that it needs.
#
# Written by forge when the package was installed, from package.dsv.

# The folder of this tree, wherever it was moved and from wherever this script is sourced.
set -g _forge_prefix (builtin realpath -s -- (status filename) | string replace -r '(/[^/]*){3}$' '')

# _colcon_prepend_unique_value VARIABLE ENTRY: make the entry the first one, and drop empty ones.
function _colcon_prepend_unique_value
    set -l variable $argv[1]
    set -l entries $argv[2]
    for entry in (string split --no-empty : -- "$$variable")
        test "$entry" = "$argv[2]"; or set -a entries $entry
    end
    set -gx $variable (string join : -- $entries)
end

# _forge_append VARIABLE ENTRY: make the entry the last one, unless it is there.
function _forge_append
    set -l variable $argv[1]
    set -l entries
    if test -n "$$variable"
        set entries (string split : -- "$$variable")
    end
    contains -- $argv[2] $entries; or set -gx $variable (string join : -- $entries $argv[2])
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

_colcon_prepend_unique_value PATH "/opt/odd \$HOME"
_forge_append PATH "$_forge_prefix/last"
set -gx ODD_MODEL "the \"great\" one"
if test -z "$ODD_HOME"
    set -gx ODD_HOME "$_forge_prefix/share/odd"
end
# A hook of 'odd'.
if _forge_present "$_forge_prefix/share/odd/hook.sh"
    _forge_sh "$_forge_prefix/share/odd/hook.sh" \
        COLCON_CURRENT_PREFIX="$_forge_prefix" \
        AMENT_CURRENT_PREFIX="$_forge_prefix"
end
_colcon_prepend_unique_value AMENT_PREFIX_PATH "$_forge_prefix"

functions -e _forge_append
functions -e _forge_present _forge_sh
set -e -g _forge_prefix
