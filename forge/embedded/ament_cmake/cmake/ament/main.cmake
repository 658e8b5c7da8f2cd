# The ament CMake API; all config files of this package include this file.
#
# Commands are defined once per CMake run, variables once per scope that calls find_package(). The state of a
# project is in global properties named after it (state.cmake), so commands can be called from any function or
# subdirectory.

cmake_policy(PUSH)
cmake_policy(VERSION 3.18)  # functions and macros use the policies of their definition

set(_ament_modules
  state paths_and_lists extensions interpreter manifest index environment exports target_dependencies
  package python version testing uninstall)
get_property(_ament_is_loaded GLOBAL PROPERTY ament_cmake_is_loaded)
if(NOT _ament_is_loaded)
  foreach(_ament_module IN LISTS _ament_modules)
    include("${CMAKE_CURRENT_LIST_DIR}/${_ament_module}.cmake")
  endforeach()
  set_property(GLOBAL PROPERTY ament_cmake_is_loaded TRUE)
  set_property(GLOBAL PROPERTY ament_cmake_folder "${CMAKE_CURRENT_LIST_DIR}")
endif()
unset(_ament_modules)
unset(_ament_module)
unset(_ament_is_loaded)

option(BUILD_TESTING "Configure the tests as well" ON)
option(AMENT_CMAKE_UNINSTALL_TARGET "Add the targets 'uninstall' and '<project>_uninstall'" ON)
option(AMENT_CMAKE_SYMLINK_INSTALL "The workspace is installed by links instead of copies" OFF)
option(AMENT_CMAKE_ENVIRONMENT_PACKAGE_GENERATION "Install the environment files of the package" ON)
option(AMENT_CMAKE_ENVIRONMENT_GENERATION "Install setup files for the whole prefix" OFF)
option(AMENT_CMAKE_ENVIRONMENT_PARENT_PREFIX_PATH_GENERATION "Record what the package was built upon" ON)
set(AMENT_TEST_RESULTS_DIR "${CMAKE_BINARY_DIR}/test_results" CACHE PATH "Where tests leave their results")
set(AMENT_BUILD_CONFIGURATION_KEYWORD_SEPARATOR ":")

_ament_settle_python()
_ament_settle_environment()
_ament_settle_testing()
_ament_settle_uninstall()

cmake_policy(POP)
