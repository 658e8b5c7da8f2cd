# Makes this workspace, and those that it was built on, the environment of the fish that sources it.
# 'local_setup.fish' adds this workspace alone.
#
# Written by forge after every build.

# The folder of this tree, wherever it was moved and from wherever this script is sourced.
set -g _forge_setup_root (builtin realpath -s -- (status filename) | string replace -r '/[^/]*$' '')

# _forge_setup_present SCRIPT: tell if the script can be sourced; warn if not, for all else works without.
function _forge_setup_present
    if not test -f "$argv[1]"
        printf "warning: '%s' is not there any more and is left out\n" "$argv[1]" >&2
        return 1
    end
    if test -n "$COLCON_TRACE"
        printf '# source "%s"\n' "$argv[1]"
    end
end

# _forge_setup_sh SCRIPT VARIABLE=VALUE...: let sh source a script that is not for fish, given the
# variables, and take over what that changes in the environment. Functions and aliases stay in sh.
function _forge_setup_sh
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

# The workspace /opt/ros/humble.
if _forge_setup_present "/opt/ros/humble/local_setup.sh"
    _forge_setup_sh "/opt/ros/humble/local_setup.sh" \
        COLCON_CURRENT_PREFIX="/opt/ros/humble"
end

# The workspace /home/a b/install.
if _forge_setup_present "/home/a b/install/local_setup.fish"
    set -gx COLCON_CURRENT_PREFIX "/home/a b/install"
    source "/home/a b/install/local_setup.fish"
    set -e -g COLCON_CURRENT_PREFIX
end

# This workspace.
if _forge_setup_present "$_forge_setup_root/local_setup.fish"
    set -gx COLCON_CURRENT_PREFIX "$_forge_setup_root"
    source "$_forge_setup_root/local_setup.fish"
    set -e -g COLCON_CURRENT_PREFIX
end

functions -e _forge_setup_present _forge_setup_sh
set -e -g _forge_setup_root
