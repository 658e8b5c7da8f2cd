# The rosidl CMake API; all config files of this package include this file.
#
# Uses only public commands of ament, so it works with any ament. Also finds ament_cmake, because some packages
# do not.

find_package(ament_cmake QUIET REQUIRED)
find_package(rosidl_default_runtime QUIET REQUIRED)

cmake_policy(PUSH)
cmake_policy(VERSION 3.18)
if(POLICY CMP0116)
  cmake_policy(SET CMP0116 NEW)  # Ninja: paths in depfiles are relative to the build folder
endif()
get_property(_rosidl_is_loaded GLOBAL PROPERTY rosidl_is_loaded)
if(NOT _rosidl_is_loaded)
  set_property(GLOBAL PROPERTY rosidl_folder "${CMAKE_CURRENT_LIST_DIR}")
  include("${CMAKE_CURRENT_LIST_DIR}/distribution.cmake")
  include("${CMAKE_CURRENT_LIST_DIR}/interfaces.cmake")
  include("${CMAKE_CURRENT_LIST_DIR}/generation.cmake")
  include("${CMAKE_CURRENT_LIST_DIR}/installation.cmake")
  include("${CMAKE_CURRENT_LIST_DIR}/typesupport.cmake")
  set_property(GLOBAL PROPERTY rosidl_is_loaded TRUE)
endif()
unset(_rosidl_is_loaded)
if(CMAKE_FIND_PACKAGE_NAME STREQUAL "python_cmake_module")
  list(APPEND CMAKE_MODULE_PATH "${CMAKE_CURRENT_LIST_DIR}/modules")  # find_package(PythonExtra)
endif()
cmake_policy(POP)
