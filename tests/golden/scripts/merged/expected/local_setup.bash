# Adds the packages of this folder to the environment of the shell that sources it.
# 'setup.bash' does so too, after the workspaces that this one was built on.
#
# Written by forge after every build, from the share/PACKAGE/package.dsv of each package.

# The folder of this tree, wherever it was moved and from wherever this script is sourced.
case ${BASH_SOURCE[0]} in
  */*) _forge_root=${BASH_SOURCE[0]%/*}/ ;;
  *) _forge_root=./ ;;
esac
_forge_root=$(CDPATH='' builtin cd -- "$_forge_root" >/dev/null && builtin pwd)

_forge_gone=

# _forge_select VARIABLE ENTRIES: set _forge_held to what the variable holds, and _forge_new to those
# of the entries, each followed by ':', that are not among it and whose package is still there.
# Entries are paths below this folder, separated by ':', or one path that begins with '/'.
_forge_select() {
  local entry name new= IFS=: options=$-
  local -A known
  set -f
  _forge_held=${!1-}
  _forge_new=
  case $2 in
    /*) _forge_new=$2: ;;
    *) for entry in $2; do _forge_new+=$_forge_root/$entry:; done ;;
  esac
  case $_forge_gone::$_forge_held: in
    # Sourced before: there is nothing to add.
    :*":$_forge_new"*) _forge_new= ;;
    # Some of this tree is there already, or some is gone: look at each entry.
    " "* | *"$_forge_root"[:/]*)
      for entry in $_forge_held; do known["$entry:"]=yes; done
      for entry in $_forge_new; do
        name=${entry#"$_forge_root"/}
        case ${known["$entry:"]-}$_forge_gone in
          yes* | *" ${name%%/*} "*) ;;
          *) new+=$entry: ;;
        esac
      done
      _forge_new=$new
      ;;
  esac
  case $options in *f*) ;; *) set +f ;; esac
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

_forge_prepend CMAKE_PREFIX_PATH "$_forge_root"

_forge_prepend LD_LIBRARY_PATH "lib"

_forge_prepend AMENT_PREFIX_PATH "$_forge_root"

_forge_prepend PATH "bin"

_forge_prepend PYTHONPATH "lib/python3.11/site-packages"

unset -f _forge_select _forge_prepend _forge_first
unset _forge_root _forge_gone _forge_name _forge_held _forge_new
unset COLCON_CURRENT_PREFIX
