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
# Packages that were removed since then are left out.
for _forge_name in \
  library \
  odd \
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

# _forge_append VARIABLE ENTRIES: put the selected entries after those that the variable holds.
_forge_append() {
  _forge_select "$1" "$2"
  if [ -n "$_forge_new" ]; then
    export "$1=$_forge_held${_forge_held:+:}${_forge_new%:}"
  fi
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

_forge_first COLCON_PREFIX_PATH "$_forge_root"

_forge_prepend CMAKE_PREFIX_PATH "library"

_forge_prepend LD_LIBRARY_PATH "library/lib"

_forge_prepend AMENT_PREFIX_PATH "library"

if [ -e "$_forge_root/odd/share/colcon-core/packages/odd" ]; then
  _forge_prepend PATH "/opt/odd \$HOME"
fi

_forge_append PATH "odd/last"

if [ -e "$_forge_root/odd/share/colcon-core/packages/odd" ]; then
  export ODD_MODEL="the \"great\" one"
fi

if [ -e "$_forge_root/odd/share/colcon-core/packages/odd" ] && [ -z "${ODD_HOME-}" ]; then
  export ODD_HOME="$_forge_root/odd/share/odd"
fi

# A hook of 'odd'.
if _forge_present "$_forge_root/odd/share/odd/hook.sh"; then
  COLCON_CURRENT_PREFIX="$_forge_root/odd"
  AMENT_CURRENT_PREFIX="$_forge_root/odd"
  . "$_forge_root/odd/share/odd/hook.sh"
  unset COLCON_CURRENT_PREFIX AMENT_CURRENT_PREFIX
fi

# A hook of 'odd'.
if _forge_present "$_forge_root/odd/share/odd/only.bash"; then
  COLCON_CURRENT_PREFIX="$_forge_root/odd"
  AMENT_CURRENT_PREFIX="$_forge_root/odd"
  . "$_forge_root/odd/share/odd/only.bash"
  unset COLCON_CURRENT_PREFIX AMENT_CURRENT_PREFIX
fi

_forge_prepend AMENT_PREFIX_PATH "\
programs:\
odd"

_forge_prepend PATH "programs/bin"

_forge_prepend PYTHONPATH "programs/lib/python3.11/site-packages"

unset -f _forge_select _forge_prepend _forge_first
unset -f _forge_append
unset -f _forge_present ament_append_value ament_append_unique_value ament_prepend_unique_value
case $_forge_options in *e*) set -e ;; esac
case $_forge_options in *u*) set -u ;; esac
unset _forge_options
unset _forge_root _forge_gone _forge_name _forge_held _forge_new
unset COLCON_CURRENT_PREFIX
