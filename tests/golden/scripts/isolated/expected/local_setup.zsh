# Adds the packages of this folder to the environment of the shell that sources it.
# 'setup.zsh' does so too, after the workspaces that this one was built on.
#
# Written by forge after every build, from the share/PACKAGE/package.dsv of each package.

# The folder of this tree, wherever it was moved and from wherever this script is sourced. $0 names
# this script, unless an option forbids it; %x always does, but spells unusual letters its own way.
_forge_root="${${${(M)0:#*/local_setup.zsh}:-${(%):-%x}}:a:h}"

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
# Entries are paths below this folder, separated by ':', or one path that begins with '/'.
_forge_select() {
  emulate -L zsh
  local name
  local -a held new
  _forge_held=${(P)1-}
  case $2 in
    /*) _forge_new=$2: ;;
    *)
      new=("${(@s.:.)2}")
      new=("$_forge_root/"$^new)
      _forge_new=${(j.:.)new}:
      ;;
  esac
  case $_forge_gone::$_forge_held: in
    # Sourced before: there is nothing to add.
    :*":$_forge_new"*) _forge_new= ;;
    # Some of this tree is there already, or some is gone: look at each entry.
    " "* | *"$_forge_root"[:/]*)
      held=("${(@s.:.)_forge_held}")
      new=("${(@s.:.)${_forge_new%:}}")
      new=("${(@)new:|held}")
      for name in ${=_forge_gone}; do
        new=("${(@)new:#$_forge_root/$name(|/*)}")
      done
      _forge_new=${(j.:.)new}${new:+:}
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

_forge_prepend CMAKE_PREFIX_PATH "library"

_forge_prepend LD_LIBRARY_PATH "library/lib"

_forge_prepend AMENT_PREFIX_PATH "\
programs:\
library"

_forge_prepend PATH "programs/bin"

_forge_prepend PYTHONPATH "programs/lib/python3.11/site-packages"

unset -f _forge_select _forge_prepend _forge_first
unset _forge_root _forge_gone _forge_name _forge_held _forge_new
unset COLCON_CURRENT_PREFIX
