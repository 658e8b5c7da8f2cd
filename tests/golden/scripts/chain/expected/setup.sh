# Makes this workspace, and those that it was built on, the environment of the shell that sources it.
# 'local_setup.sh' adds this workspace alone.
#
# Written by forge after every build.

# A plain sh script cannot tell where it is: COLCON_CURRENT_PREFIX says so, else it was not moved.
_forge_setup_root=/ws/install
if [ -n "${COLCON_CURRENT_PREFIX-}" ]; then
  _forge_setup_root=$COLCON_CURRENT_PREFIX
elif [ ! -d "$_forge_setup_root" ]; then
  printf "'%s' is not there any more; set COLCON_CURRENT_PREFIX to where it was moved\n" "$_forge_setup_root" >&2
  unset _forge_setup_root
  return 1
fi

# _forge_setup_present SCRIPT: tell if the script can be sourced; warn if not, for all else works without.
_forge_setup_present() {
  if [ ! -f "$1" ]; then
    printf "warning: '%s' is not there any more and is left out\n" "$1" >&2
    return 1
  fi
  if [ -n "${COLCON_TRACE-}" ]; then
    printf '# . "%s"\n' "$1"
  fi
}

# Not every script bears 'set -eu'.
_forge_setup_options=$-
set +eu

# The workspace /opt/ros/humble.
if _forge_setup_present "/opt/ros/humble/local_setup.sh"; then
  COLCON_CURRENT_PREFIX="/opt/ros/humble"
  . "/opt/ros/humble/local_setup.sh"
  unset COLCON_CURRENT_PREFIX
fi

# The workspace /home/a b/install.
if _forge_setup_present "/home/a b/install/local_setup.sh"; then
  COLCON_CURRENT_PREFIX="/home/a b/install"
  . "/home/a b/install/local_setup.sh"
  unset COLCON_CURRENT_PREFIX
fi

# This workspace.
if _forge_setup_present "$_forge_setup_root/local_setup.sh"; then
  COLCON_CURRENT_PREFIX="$_forge_setup_root"
  . "$_forge_setup_root/local_setup.sh"
  unset COLCON_CURRENT_PREFIX
fi

unset -f _forge_setup_present
case $_forge_setup_options in *e*) set -e ;; esac
case $_forge_setup_options in *u*) set -u ;; esac
unset _forge_setup_root _forge_setup_options
