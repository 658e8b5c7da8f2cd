# ament_cmake_ros: defaults for ROS packages. Libraries are shared by default, and compiled with ROS_PACKAGE_NAME.

find_package(ament_cmake QUIET REQUIRED)
find_package(ament_cmake_gtest QUIET REQUIRED)
find_package(ament_cmake_gmock QUIET REQUIRED)
find_package(ament_cmake_pytest QUIET REQUIRED)

option(BUILD_SHARED_LIBS "Build shared libraries where a package does not say" ON)
add_definitions(-DROS_PACKAGE_NAME="${PROJECT_NAME}")

include_guard(GLOBAL)
cmake_policy(PUSH)
cmake_policy(VERSION 3.18)

# ament_add_ros_isolated_gtest(...), ..._gmock(...), ..._pytest_test(...): tests with an exclusive ROS domain.
macro(ament_add_ros_isolated_gtest target)
  ament_add_gtest(${target} ${ARGN} RUNNER "${ament_cmake_ros_DIR}/run_test_isolated.py")
endmacro()

macro(ament_add_ros_isolated_gtest_test target)
  ament_add_gtest_test(${target} ${ARGN} RUNNER "${ament_cmake_ros_DIR}/run_test_isolated.py")
endmacro()

macro(ament_add_ros_isolated_gmock target)
  ament_add_gmock(${target} ${ARGN} RUNNER "${ament_cmake_ros_DIR}/run_test_isolated.py")
endmacro()

macro(ament_add_ros_isolated_pytest_test name path)
  ament_add_pytest_test(${name} ${path} ${ARGN} RUNNER "${ament_cmake_ros_DIR}/run_test_isolated.py")
endmacro()

# ament_add_default_options([EXCLUDE_BUILD_SHARED_LIBS]): does nothing; the defaults are set above.
function(ament_add_default_options)
  cmake_parse_arguments(ARG "EXCLUDE_BUILD_SHARED_LIBS" "" "" ${ARGN})
  _ament_refuse_unknown(ament_add_default_options ${ARG_UNPARSED_ARGUMENTS})
endfunction()

cmake_policy(POP)
