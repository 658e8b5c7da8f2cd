# Adds the package 'library' to the environment of the shell that sources it; nothing that it needs.
#
# Written by forge when the package was installed, from package.dsv.

# A plain sh script cannot tell where it is: COLCON_CURRENT_PREFIX says so, else it was not moved.
_forge_prefix=/ws/install/library
if [ -n "${COLCON_CURRENT_PREFIX-}" ]; then
  _forge_prefix=$COLCON_CURRENT_PREFIX
elif [ ! -d "$_forge_prefix" ]; then
  printf "'%s' is not there any more; set COLCON_CURRENT_PREFIX to where it was moved\n" "$_forge_prefix" >&2
  unset _forge_prefix
  return 1
fi

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
