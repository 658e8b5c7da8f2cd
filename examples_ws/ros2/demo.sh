#!/bin/sh
# Build these packages with the forge on PATH on top of the ROS 2 that is sourced, then let the nodes talk.
# Options are those of `forge build`.

set -eu
cd "$(dirname "$0")"

printed=$(mktemp -d)
running=''

finish() {
  end_all
  rm -rf "$printed"
}
trap finish EXIT

section() {
  printf '\n# %s\n' "$1"
}

# Start a program that does not end by itself, under a name: NAME COMMAND...
start() {
  name=$1
  shift
  printf '$ %s &\n' "$*"
  : >"$printed/$name"
  # As Ctrl+C would: `timeout` tells the whole family, and lets nothing stay for longer than two minutes.
  timeout -s INT 120 "$@" >"$printed/$name" 2>&1 &
  running="$running $!"
}

end_all() {
  for one in $running; do
    kill -INT "$one" 2>/dev/null || true
    wait "$one" 2>/dev/null || true
  done
  running=''
}

# Wait until what was started as NAME has printed TEXT.
await() {
  tries=0
  until grep -qF -e "$2" "$printed/$1"; do
    tries=$((tries + 1))
    if [ "$tries" -gt 150 ]; then
      printf "'%s' never said '%s', but:\n" "$1" "$2" >&2
      cat "$printed/$1" >&2
      exit 1
    fi
    sleep 0.2
  done
  grep -m 1 -F -e "$2" "$printed/$1"
}

# Run a command to its end and find TEXT in what it prints: TEXT COMMAND...
expect() {
  text=$1
  shift
  printf '$ %s\n' "$*"
  if ! timeout -s INT 60 "$@" >"$printed/answer" 2>&1 || ! grep -qF -e "$text" "$printed/answer"; then
    printf "that failed, or did not say '%s', but:\n" "$text" >&2
    cat "$printed/answer" >&2
    exit 1
  fi
  grep -F -e "$text" "$printed/answer"
}

if ! command -v ros2 >/dev/null; then
  printf 'source a ROS 2 first: these nodes need rclcpp and rclpy\n' >&2
  exit 2
fi

forge build "$@"
# Setup scripts may read variables that are not set.
set +u
. install/setup.sh
set -u

section 'first nodes'
start node_01 ros2 run example_cpp node_01
start node_02 ros2 run example_py node_02
start node_03 ros2 run example_cpp node_03 --ros-args --remap __node:=renamed
start node_04 ros2 run example_py node_04
await node_01 'node_01 is up'
await node_02 'node_02 is up'
await node_03 'renamed is up'
await node_04 'node_04 is up'
expect /node_02 ros2 node list --no-daemon --spin-time 3
end_all

section 'topic'
start publisher ros2 run example_topic_rclcpp topic_publisher_01
start subscriber ros2 run example_topic_rclcpp topic_subscribe_01
await subscriber "heard 'forward': 0.2 m/s"
expect 'data: forward' ros2 topic echo --no-daemon --spin-time 3 --once /command
expect 'publishing #1' ros2 topic pub --once /command std_msgs/msg/String 'data: backward'
await subscriber "heard 'backward': -0.2 m/s"
end_all

section 'topic, in Python'
start publisher ros2 run example_topic_rclpy topic_publisher_02
start subscriber ros2 run example_topic_rclpy topic_subscribe_02
await subscriber "heard 'backward': -0.2 m/s"
end_all

section 'domain id'
# Nodes see each other only within one domain.
start near ros2 run example_topic_rclpy topic_subscribe_02
start near_publisher ros2 run example_topic_rclpy topic_publisher_02
await near "heard 'backward'"
start far env ROS_DOMAIN_ID=42 ros2 run example_topic_rclcpp topic_subscribe_01
start far_publisher env ROS_DOMAIN_ID=42 ros2 run example_topic_rclcpp topic_publisher_01
await far "heard 'forward'"
if grep -F "heard 'forward'" "$printed/near" || grep -F "heard 'backward'" "$printed/far"; then
  printf 'that came from another domain\n' >&2
  exit 1
fi
end_all

section 'service'
start server ros2 run example_service_rclcpp service_server_01
expect '5 + 6 = 11' ros2 run example_service_rclcpp service_client_01
expect '20 + 22 = 42' ros2 run example_service_rclcpp service_client_01 --ros-args -p a:=20 -p b:=22
expect 'sum=15' ros2 service call /add_two_ints_srv example_interfaces/srv/AddTwoInts '{a: 5, b: 10}'
await server 'answering 42'
end_all

section 'service, in Python'
start server ros2 run example_service_rclpy service_server_02
expect '5 + 6 = 11' ros2 run example_service_rclpy service_client_02
expect '20 + 22 = 42' ros2 run example_service_rclcpp service_client_01 --ros-args -p a:=20 -p b:=22
await server 'answering 42'
end_all

section 'interfaces of our own'
expect 'uint32 STATUS_STOPPED = 2' ros2 interface show example_ros2_interfaces/msg/RobotStatus
start robot ros2 run example_interfaces_rclcpp example_interfaces_robot_01
expect 'the robot arrived at 4.990 m' ros2 run example_interfaces_rclcpp example_interfaces_control_01
expect 'pose: 4.99' ros2 topic echo --no-daemon --spin-time 3 --once /robot_status
end_all

section 'parameters'
share=$(ros2 pkg prefix --share example_parameters_rclcpp)
start verbose ros2 run example_parameters_rclcpp parameters_basic --ros-args -p rcl_log_level:=10
await verbose 'a debug message'
expect 'Integer value is: 10' ros2 param get --no-daemon --spin-time 3 /parameters_basic rcl_log_level
expect 'Max value: 50' ros2 param describe --no-daemon --spin-time 3 /parameters_basic rcl_log_level
expect 'Set parameter successful' ros2 param set --no-daemon --spin-time 3 /parameters_basic rcl_log_level 50
end_all
start quiet ros2 run example_parameters_rclcpp parameters_basic --ros-args \
  --params-file "$share/config/parameters.yaml"
await quiet 'a warning'
if grep -F 'an info message' "$printed/quiet"; then
  printf 'that is below the level of the file\n' >&2
  exit 1
fi
end_all

section 'parameters, in Python'
start loud ros2 run example_parameters_rclpy parameters_basic --ros-args -p rcl_log_level:=10
await loud 'a debug message'
expect 'Max value: 50' ros2 param describe --no-daemon --spin-time 3 /parameters_basic rcl_log_level
expect 'Set parameter successful' ros2 param set --no-daemon --spin-time 3 /parameters_basic rcl_log_level 50
expect 'Setting parameter failed' ros2 param set --no-daemon --spin-time 3 /parameters_basic rcl_log_level 51
end_all

section 'action'
start robot ros2 run example_action_rclcpp action_robot_01
expect 'arrived at 1.992 m' ros2 run example_action_rclcpp action_control_01 --ros-args -p distance:=2.0
expect 'Goal finished with status: SUCCEEDED' ros2 action send_goal --feedback /move_robot \
  robot_control_interfaces/action/MoveRobot '{distance: -1.0}'
await robot 'goal -1.000 m: accepted'
expect 'Goal was rejected' ros2 action send_goal /move_robot \
  robot_control_interfaces/action/MoveRobot '{distance: 101.0}'
start canceled ros2 run example_action_rclcpp action_control_01 --ros-args -p distance:=100.0 -p patience:=1.2
await canceled 'canceling'
await canceled 'stopped early at'
end_all

section 'action, in Python'
start robot ros2 run example_action_rclpy action_robot_02
expect 'the robot is at 0.992 m' ros2 run example_action_rclpy action_control_02 --ros-args -p distance:=1.0
expect 'that takes too long: canceling' ros2 run example_action_rclpy action_control_02 --ros-args \
  -p distance:=100.0 -p patience:=1.2
await robot 'stopped at'
expect 'arrived at' ros2 run example_action_rclcpp action_control_01 --ros-args -p distance:=0.5
end_all

for node in rclcpp:lifecycle_talker_01 rclpy:lifecycle_talker_02; do
  section "life cycle: $node"
  program=${node#*:}
  start talker ros2 run "example_lifecycle_${node%:*}" "$program"
  expect unconfigured ros2 lifecycle get --no-daemon --spin-time 3 "/$program"
  expect 'Transitioning successful' ros2 lifecycle set --no-daemon --spin-time 3 "/$program" configure
  await talker configured
  expect 'Transitioning successful' ros2 lifecycle set --no-daemon --spin-time 3 "/$program" activate
  await talker publishing
  expect 'Transitioning successful' ros2 lifecycle set --no-daemon --spin-time 3 "/$program" deactivate
  await talker inactive
  expect 'Transitioning successful' ros2 lifecycle set --no-daemon --spin-time 3 "/$program" cleanup
  await talker 'cleaned up'
  end_all
done

section 'composition'
start container ros2 run rclcpp_components component_container
expect /ComponentManager ros2 node list --no-daemon --spin-time 3
expect 'Loaded component 1' ros2 component load --no-daemon --spin-time 3 /ComponentManager \
  example_composition_rclcpp example_composition::ComposedPublisher
expect 'Loaded component 2' ros2 component load --no-daemon --spin-time 3 /ComponentManager \
  example_composition_rclcpp example_composition::ComposedSubscriber
await container "heard 'forward'"
end_all
start publisher ros2 run example_composition_rclcpp composed_publisher
start subscriber ros2 run example_composition_rclcpp composed_subscriber
await subscriber "heard 'forward'"
end_all

section 'launch'
expect 'process has finished cleanly' ros2 launch robot_startup example_action.launch.py
start by_launch ros2 launch robot_startup example_param_rclcpp.launch.py log_level:=50
await by_launch '[by_argument.parameters_basic]: a fatal error'
await by_launch '[by_file.parameters_basic]: a warning'
end_all
start by_xml ros2 launch robot_startup example_topic.launch.xml
await by_xml "heard 'forward'"
end_all
start composed ros2 launch robot_startup example_composition.launch.py
await composed "heard 'forward'"
# Without copies the subscriber gets the very message that the publisher made.
address=$(grep -m 1 -F "heard 'forward'" "$printed/composed" | grep -o '0x.*')
await composed "publishing from $address"
end_all

printf '\nAll nodes did what they are for.\n'
