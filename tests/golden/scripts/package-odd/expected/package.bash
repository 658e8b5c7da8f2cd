# Adds the package 'odd' to the environment of the shell that sources it; nothing that it needs.
#
# Written by forge when the package was installed, from package.dsv.

# The folder of this tree, wherever it was moved and from wherever this script is sourced.
case ${BASH_SOURCE[0]} in
  */*) _forge_prefix=${BASH_SOURCE[0]%/*}/../../ ;;
  *) _forge_prefix=./../../ ;;
esac
_forge_prefix=$(CDPATH='' builtin cd -- "$_forge_prefix" >/dev/null && builtin pwd)

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

# _forge_append VARIABLE ENTRY: make the entry the last one, unless it is there.
_forge_append() {
  eval "_forge_held=\${$1-}"
  case :$_forge_held: in
    *":$2:"*) ;;
    *) export "$1=$_forge_held${_forge_held:+:}$2" ;;
  esac
  unset _forge_held
}

# _forge_present SCRIPT: tell if the script can be sourced; warn if not, for all else works without.
_forge_present() {
  if [ ! -f "$1" ]; then
    printf "warning: '%s' is not there any more and is left out\n" "$1" >&2
    return 1
  fi
  if [ -n "${COLCON_TRACE-}" ]; then
    printf '# . "%s"\n' "$1"
  fi
}

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

# Not every script bears 'set -eu'.
_forge_options=$-
set +eu

_colcon_prepend_unique_value PATH "/opt/odd \$HOME"
_forge_append PATH "$_forge_prefix/last"
export ODD_MODEL="the \"great\" one"
if [ -z "${ODD_HOME-}" ]; then
  export ODD_HOME="$_forge_prefix/share/odd"
fi
# A hook of 'odd'.
if _forge_present "$_forge_prefix/share/odd/hook.sh"; then
  COLCON_CURRENT_PREFIX="$_forge_prefix"
  AMENT_CURRENT_PREFIX="$_forge_prefix"
  . "$_forge_prefix/share/odd/hook.sh"
  unset COLCON_CURRENT_PREFIX AMENT_CURRENT_PREFIX
fi
# A hook of 'odd'.
if _forge_present "$_forge_prefix/share/odd/only.bash"; then
  COLCON_CURRENT_PREFIX="$_forge_prefix"
  AMENT_CURRENT_PREFIX="$_forge_prefix"
  . "$_forge_prefix/share/odd/only.bash"
  unset COLCON_CURRENT_PREFIX AMENT_CURRENT_PREFIX
fi
_colcon_prepend_unique_value AMENT_PREFIX_PATH "$_forge_prefix"

unset -f _forge_append
unset -f _forge_present ament_append_value ament_append_unique_value ament_prepend_unique_value
case $_forge_options in *e*) set -e ;; esac
case $_forge_options in *u*) set -u ;; esac
unset _forge_options
unset _forge_prefix COLCON_CURRENT_PREFIX
