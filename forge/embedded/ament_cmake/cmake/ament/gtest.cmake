# Google Test, Google Mock and Google Benchmark.
#
# If they are missing, targets and tests are still defined, but excluded from the default build, and the tests
# are reported as skipped. CMakeLists.txt files therefore need no conditions.

include_guard(GLOBAL)
cmake_policy(PUSH)
cmake_policy(VERSION 3.18)

# ament_find_gtest(): set GTEST_FOUND, GTEST_INCLUDE_DIRS, GTEST_LIBRARIES, GTEST_MAIN_LIBRARIES and
# GTEST_BOTH_LIBRARIES for the caller.
macro(ament_find_gtest)
  _ament_find_google(gtest GTEST)
endmacro()

# ament_find_gmock(): the same with GMOCK_.
macro(ament_find_gmock)
  _ament_find_google(gmock GMOCK)
endmacro()

# _ament_find_google(<gtest or gmock> <GTEST or GMOCK>)
#
# A vendor package or the folder in $GTEST_DIR has priority. An installed library comes before system sources,
# because it saves about ten seconds per package. CMAKE_DISABLE_FIND_PACKAGE_GTest disables all of them.
macro(_ament_find_google name upper)
  if(NOT ${upper}_FOUND AND NOT CMAKE_DISABLE_FIND_PACKAGE_GTest)
    find_package(${name}_vendor QUIET)
    _ament_locate_google(_ament_google_source ${name} "$ENV{${upper}_DIR}" "${${name}_vendor_BASE_DIR}")
    if(NOT TARGET ${name} AND NOT _ament_google_source)
      find_package(GTest QUIET CONFIG)
      if(NOT TARGET GTest::${name})
        _ament_locate_google(_ament_google_source ${name} /usr/src/googletest /usr/src/${name})
      endif()
    endif()
    if(NOT TARGET ${name} AND _ament_google_source)
      _ament_build_google("${_ament_google_source}" ${name})
    endif()
    _ament_name_google(${name} ${upper})
    unset(_ament_google_source)
  endif()
endmacro()

# _ament_locate_google(<variable> <name> <folder>...): the first folder with sources, or nothing.
function(_ament_locate_google variable name)
  set(${variable} "" PARENT_SCOPE)
  foreach(folder IN LISTS ARGN)
    if(folder)
      if(EXISTS "${folder}/CMakeLists.txt")  # nested, because CMake evaluates both sides of AND
        set(${variable} "${folder}" PARENT_SCOPE)
        return()
      endif()
    endif()
  endforeach()
endfunction()

# _ament_build_google(<folder> <name>): add the sources to this build; only targets that tests link are built.
function(_ament_build_google folder name)
  get_property(languages GLOBAL PROPERTY ENABLED_LANGUAGES)
  if(NOT "CXX" IN_LIST languages)
    return()
  endif()
  set(INSTALL_GTEST OFF)
  set(INSTALL_GMOCK OFF)
  set(BUILD_SHARED_LIBS OFF)
  set(CMAKE_POLICY_DEFAULT_CMP0077 NEW)  # the variables above override option() in the sources
  set(CMAKE_WARN_DEPRECATED OFF)
  add_subdirectory("${folder}" "${CMAKE_BINARY_DIR}/${name}" EXCLUDE_FROM_ALL)
endfunction()

# _ament_name_google(<name> <NAME>): set the result variables for existing targets, and create short aliases.
macro(_ament_name_google name upper)
  set(${upper}_FOUND FALSE)
  foreach(_ament_target IN ITEMS ${name} ${name}_main)
    if(TARGET GTest::${_ament_target} AND NOT TARGET ${_ament_target})
      add_library(${_ament_target} ALIAS GTest::${_ament_target})
    endif()
  endforeach()
  unset(_ament_target)
  if(TARGET ${name})
    set(${upper}_FOUND TRUE)
    set(${upper}_LIBRARIES ${name})
    set(${upper}_MAIN_LIBRARIES ${name}_main)
    set(${upper}_BOTH_LIBRARIES ${${upper}_MAIN_LIBRARIES} ${${upper}_LIBRARIES})
    get_target_property(${upper}_INCLUDE_DIRS ${name} INTERFACE_INCLUDE_DIRECTORIES)
  endif()
endmacro()

# ament_add_gtest(<target> <source>... [SKIP_LINKING_MAIN_LIBRARIES] [options of ament_add_test]...)
#
# Add an executable with Google Test, and a test of the same name that runs it.
macro(ament_add_gtest target)
  ament_find_gtest()
  _ament_add_google_executable(${target} GTEST ${ARGN})
  _ament_add_google_test(${target} ${target} gtest ${ARGN})
endmacro()

macro(ament_add_gtest_executable target)
  ament_find_gtest()
  _ament_add_google_executable(${target} GTEST ${ARGN})
endmacro()

# ament_add_gtest_test(<target> [TEST_NAME <name>] [options]...): does nothing if the target does not exist.
macro(ament_add_gtest_test target)
  _ament_add_google_test(${target} ${target} gtest ${ARGN})
endmacro()

# ament_add_gmock(...): ament_add_gtest() with Google Mock.
macro(ament_add_gmock target)
  ament_find_gmock()
  _ament_add_google_executable(${target} GMOCK ${ARGN})
  _ament_add_google_test(${target} ${target} gmock ${ARGN})
endmacro()

macro(ament_add_gmock_executable target)
  ament_find_gmock()
  _ament_add_google_executable(${target} GMOCK ${ARGN})
endmacro()

macro(ament_add_gmock_test target)
  _ament_add_google_test(${target} ${target} gmock ${ARGN})
endmacro()

# ament_add_google_benchmark(<target> <source>... [RUN_PARALLEL] [options of ament_add_test]...)
#
# Runs only with AMENT_RUN_PERFORMANCE_TESTS.
macro(ament_add_google_benchmark target)
  find_package(benchmark QUIET)
  _ament_add_benchmark_executable(${target} ${ARGN})
  _ament_add_benchmark_test(${target} ${ARGN})
endmacro()

macro(ament_add_google_benchmark_executable target)
  find_package(benchmark QUIET)
  _ament_add_benchmark_executable(${target} ${ARGN})
endmacro()

# ament_add_google_benchmark_test(<target> [options]...): does nothing if the target does not exist.
macro(ament_add_google_benchmark_test target)
  _ament_add_benchmark_test(${target} ${ARGN})
endmacro()

# _ament_add_google_executable(<target> <GTEST or GMOCK> <source>... [options]...)
function(_ament_add_google_executable target upper)
  _ament_parse_program(${ARGN})
  if(NOT ARG_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "the test '${target}' has no source files")
  endif()
  if(NOT ${upper}_FOUND)
    string(TOLOWER "${upper}" name)
    _ament_add_program_without(${name} ${target} ${ARG_UNPARSED_ARGUMENTS})
    return()
  endif()
  add_executable(${target} ${ARG_UNPARSED_ARGUMENTS})
  target_include_directories(${target} SYSTEM PRIVATE ${${upper}_INCLUDE_DIRS})
  # The plain signature of target_link_libraries(), because packages use it for further libraries.
  if(NOT ARG_SKIP_LINKING_MAIN_LIBRARIES)
    target_link_libraries(${target} ${${upper}_MAIN_LIBRARIES})
  endif()
  target_link_libraries(${target} ${${upper}_LIBRARIES})
  if(upper STREQUAL "GTEST")
    set(THREADS_PREFER_PTHREAD_FLAG ON)
    find_package(Threads REQUIRED)
    target_link_libraries(${target} Threads::Threads)
  endif()
endfunction()

# _ament_add_google_test(<target> <test> <label> [options]...)
function(_ament_add_google_test target name label)
  if(NOT TARGET ${target})
    return()
  endif()
  _ament_parse_program(${ARGN})
  if(ARG_TEST_NAME)
    set(name "${ARG_TEST_NAME}")
  endif()
  set(result "${AMENT_TEST_RESULTS_DIR}/${PROJECT_NAME}/${name}.gtest.xml")
  _ament_add_program_test(${target} "${name}" ${label} "${result}" "--gtest_output=xml:${result}")
endfunction()

# _ament_add_benchmark_executable(<target> <source>... [options]...)
function(_ament_add_benchmark_executable target)
  _ament_parse_program(${ARGN})
  if(NOT ARG_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "the benchmark '${target}' has no source files")
  endif()
  if(NOT benchmark_FOUND)
    _ament_add_program_without(benchmark ${target} ${ARG_UNPARSED_ARGUMENTS})
    return()
  endif()
  add_executable(${target} ${ARG_UNPARSED_ARGUMENTS})
  if(NOT ARG_SKIP_LINKING_MAIN_LIBRARIES)
    target_link_libraries(${target} benchmark::benchmark_main)
  endif()
  target_link_libraries(${target} benchmark::benchmark)
endfunction()

# _ament_add_benchmark_test(<target> [RUN_PARALLEL] [options]...)
function(_ament_add_benchmark_test target)
  if(NOT TARGET ${target})
    return()
  endif()
  _ament_parse_program(${ARGN})
  get_target_property(missing ${target} AMENT_MISSING_LIBRARY)
  if(missing)
    set(ARG_SKIP_REASON "${missing} was not found")
  endif()
  if(missing OR NOT AMENT_RUN_PERFORMANCE_TESTS)
    set(ARG_SKIP_TEST TRUE)
  endif()
  set(result "${AMENT_TEST_RESULTS_DIR}/${PROJECT_NAME}/${target}.google_benchmark")
  _ament_collect_test_options(options)
  ament_add_test(${target} COMMAND "$<TARGET_FILE:${target}>" "--benchmark_out_format=json"
    "--benchmark_out=${result}.json" RESULT_FILE "${result}.xml" GENERATE_RESULT_FOR_RETURN_CODE_ZERO
    OUTPUT_FILE "${CMAKE_BINARY_DIR}/ament_cmake_google_benchmark/${target}.txt" ${options})
  set_tests_properties(${target} PROPERTIES LABELS "google_benchmark;performance")
  if(NOT ARG_RUN_PARALLEL)
    set_tests_properties(${target} PROPERTIES RUN_SERIAL TRUE)
  endif()
endfunction()

cmake_policy(POP)
