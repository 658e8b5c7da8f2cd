# Adds the package 'library' to the environment of the shell that sources it; nothing that it needs.
#
# Written by forge when the package was installed, from package.dsv.

# The folder of this tree, wherever it was moved and from wherever this script is sourced. $0 names
# this script, unless an option forbids it; %x always does, but spells unusual letters its own way.
_forge_prefix="${${${(M)0:#*/package.zsh}:-${(%):-%x}}:a:h:h:h}"

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

_colcon_prepend_unique_value CMAKE_PREFIX_PATH "$_forge_prefix"
_colcon_prepend_unique_value LD_LIBRARY_PATH "$_forge_prefix/lib"
_colcon_prepend_unique_value AMENT_PREFIX_PATH "$_forge_prefix"

unset _forge_prefix COLCON_CURRENT_PREFIX
