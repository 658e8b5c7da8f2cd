#!/bin/sh
# Build this workspace with the forge on PATH, source it, run its programs. `make demo` calls this.

set -eu
cd "$(dirname "$0")"

show() {
  printf '\n$ %s\n' "$1"
  eval "$1"
}

show 'forge build'
show '. install/setup.sh'
show 'forge interface show example_ros2_interfaces/msg/RobotPose'
show 'forge pkg executables robot_demo_cpp'
show 'forge run robot_demo_cpp move_robot'
show 'forge run robot_demo_py move_robot'
show 'forge run robot_demo_cpp print_pose | tee build/pose.yaml'
show 'forge run robot_demo_cpp print_pose --report'
show 'forge run robot_demo_py read_pose build/pose.yaml'

cpp=$(forge run robot_demo_cpp print_pose --report)
python=$(forge run robot_demo_py read_pose build/pose.yaml)
if [ "$cpp" != "$python" ]; then
  printf '\nthe C++ and the Python program disagree about the same message\n' >&2
  exit 1
fi
printf '\nThe C++ and the Python program agree about the same message; no ROS was needed.\n'
