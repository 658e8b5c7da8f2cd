# Adds the packages of this folder to the environment of the shell that sources it.
# 'setup.sh' does so too, after the workspaces that this one was built on.
#
# Written by forge after every build, from the share/PACKAGE/package.dsv of each package.

# A plain sh script cannot tell where it is: COLCON_CURRENT_PREFIX says so, else it was not moved.
_forge_root=/ws/install
if [ -n "${COLCON_CURRENT_PREFIX-}" ]; then
  _forge_root=$COLCON_CURRENT_PREFIX
elif [ ! -d "$_forge_root" ]; then
  printf "'%s' is not there any more; set COLCON_CURRENT_PREFIX to where it was moved\n" "$_forge_root" >&2
  unset _forge_root
  return 1
fi

_forge_gone=
# Packages that were removed since then are left out.
for _forge_name in \
  library \
  programs
do
  if [ ! -e "$_forge_root/$_forge_name/share/colcon-core/packages/$_forge_name" ]; then
    _forge_gone="${_forge_gone:- }$_forge_name "
  fi
done

# _forge_select VARIABLE ENTRIES: set _forge_held to what the variable holds, and _forge_new to those
# of the entries, each followed by ':', that are not among it and whose package is still there.
_forge_select() {
  eval "_forge_held=\${$1-}"
  _forge_new=$2:
  case $_forge_gone::$_forge_held: in
    # Sourced before: there is nothing to add.
    :*":$2:"*) _forge_new= ;;
    # Some of this tree is there already, or some is gone: look at each entry.
    " "* | *"$_forge_root"[:/]*)
      _forge_new=
      _forge_left=$2:
      while [ -n "$_forge_left" ]; do
        _forge_entry=${_forge_left%%:*}
        _forge_left=${_forge_left#*:}
        _forge_name=${_forge_entry#"$_forge_root"/}
        case :$_forge_held: in *":$_forge_entry:"*) continue ;; esac
        case $_forge_gone in *" ${_forge_name%%/*} "*) continue ;; esac
        _forge_new=$_forge_new$_forge_entry:
      done
      unset _forge_left _forge_entry
      ;;
  esac
}

# _forge_prepend VARIABLE ENTRIES: put the selected entries before those that the variable holds.
_forge_prepend() {
  _forge_select "$1" "$2"
  if [ -n "$_forge_new" ]; then
    if [ -n "$_forge_held" ]; then
      export "$1=$_forge_new$_forge_held"
    else
      export "$1=${_forge_new%:}"
    fi
  fi
}

# _forge_first VARIABLE ENTRY: make the entry the first one, and drop empty ones.
_forge_first() {
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

_forge_first COLCON_PREFIX_PATH "$_forge_root"

_forge_prepend CMAKE_PREFIX_PATH "$_forge_root/library"

_forge_prepend LD_LIBRARY_PATH "$_forge_root/library/lib"

_forge_prepend AMENT_PREFIX_PATH "\
$_forge_root/programs:\
$_forge_root/library"

_forge_prepend PATH "$_forge_root/programs/bin"

_forge_prepend PYTHONPATH "$_forge_root/programs/lib/python3.11/site-packages"

unset -f _forge_select _forge_prepend _forge_first
unset _forge_root _forge_gone _forge_name _forge_held _forge_new
unset COLCON_CURRENT_PREFIX
