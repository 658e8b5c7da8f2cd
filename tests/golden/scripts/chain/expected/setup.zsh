# Makes this workspace, and those that it was built on, the environment of the shell that sources it.
# 'local_setup.zsh' adds this workspace alone.
#
# Written by forge after every build.

# The folder of this tree, wherever it was moved and from wherever this script is sourced. $0 names
# this script, unless an option forbids it; %x always does, but spells unusual letters its own way.
_forge_setup_root="${${${(M)0:#*/setup.zsh}:-${(%):-%x}}:a:h}"

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
if _forge_setup_present "/home/a b/install/local_setup.zsh"; then
  COLCON_CURRENT_PREFIX="/home/a b/install"
  . "/home/a b/install/local_setup.zsh"
  unset COLCON_CURRENT_PREFIX
fi

# This workspace.
if _forge_setup_present "$_forge_setup_root/local_setup.zsh"; then
  COLCON_CURRENT_PREFIX="$_forge_setup_root"
  . "$_forge_setup_root/local_setup.zsh"
  unset COLCON_CURRENT_PREFIX
fi

unset -f _forge_setup_present
case $_forge_setup_options in *e*) set -e ;; esac
case $_forge_setup_options in *u*) set -u ;; esac
unset _forge_setup_root _forge_setup_options
