# Catch2, version 2 or 3.
#
# If it is missing, targets and tests are still defined, but excluded from the default build, and the tests are
# reported as skipped.

include_guard(GLOBAL)
cmake_policy(PUSH)
cmake_policy(VERSION 3.18)

# ament_add_catch2(<target> <source>... [SKIP_LINKING_MAIN_LIBRARIES] [options of ament_add_test]...)
#
# Add an executable with Catch2, and a test of the same name that runs it. It needs no main(): one of the sources
# may have it or define CATCH_CONFIG_MAIN. If main() is in a library, pass SKIP_LINKING_MAIN_LIBRARIES.
macro(ament_add_catch2 target)
  ament_add_catch2_executable(${target} ${ARGN})
  ament_add_catch2_test(${target} ${ARGN})
endmacro()

function(ament_add_catch2_executable target)
  _ament_parse_program(${ARGN})
  if(NOT ARG_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "the test '${target}' has no source files")
  endif()
  _ament_read_catch2_sources(has_main has_catch2 ${ARG_UNPARSED_ARGUMENTS})
  if(NOT TARGET Catch2::Catch2 AND NOT has_catch2)
    find_package(Catch2 QUIET CONFIG)
    if(NOT TARGET Catch2::Catch2)
      _ament_add_program_without(Catch2 ${target} ${ARG_UNPARSED_ARGUMENTS})
      return()
    endif()
  endif()
  add_executable(${target} ${ARG_UNPARSED_ARGUMENTS})
  # Not target_link_libraries(): packages call it with or without PRIVATE, and CMake rejects a mixture.
  if(NOT ARG_SKIP_LINKING_MAIN_LIBRARIES AND NOT has_catch2)
    if(TARGET Catch2::Catch2WithMain)
      set_property(TARGET ${target} APPEND PROPERTY LINK_LIBRARIES Catch2::Catch2WithMain)
    elseif(NOT has_main)
      _ament_add_catch2_main()
      set_property(TARGET ${target} APPEND PROPERTY LINK_LIBRARIES ament_catch2_main)
    endif()
  endif()
  if(NOT has_catch2)
    set_property(TARGET ${target} APPEND PROPERTY LINK_LIBRARIES Catch2::Catch2)
  endif()
endfunction()

# ament_add_catch2_test(<target> [TEST_NAME <name>] [options]...): does nothing if the target does not exist.
function(ament_add_catch2_test target)
  if(NOT TARGET ${target})
    return()
  endif()
  _ament_parse_program(${ARGN})
  set(name "${target}")
  if(ARG_TEST_NAME)
    set(name "${ARG_TEST_NAME}")
  endif()
  set(result "${AMENT_TEST_RESULTS_DIR}/${PROJECT_NAME}/${name}.catch2.xml")
  _ament_add_program_test(${target} "${name}" catch2 "${result}" --reporter junit --out "${result}")
endfunction()

# _ament_read_catch2_sources(<has main> <has Catch2> <source>...)
#
# Whether a source defines main() by Catch2's macros; and whether the package has its own copy of Catch2: it
# defines main(), but includes nothing from the folder 'catch2' of an installation.
function(_ament_read_catch2_sources has_main has_catch2)
  set(main FALSE)
  set(installed FALSE)
  foreach(source IN LISTS ARGN)
    get_filename_component(path "${source}" ABSOLUTE)
    if(EXISTS "${path}" AND NOT IS_DIRECTORY "${path}")
      file(STRINGS "${path}" define REGEX "^[ \t]*#[ \t]*define[ \t]+CATCH_CONFIG_(MAIN|RUNNER)")
      file(STRINGS "${path}" include REGEX "^[ \t]*#[ \t]*include[ \t]+[<\"]catch2/")
      if(define)
        set(main TRUE)
        set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${path}")  # it may be removed
      endif()
      if(include)
        set(installed TRUE)
      endif()
    endif()
  endforeach()
  set(${has_main} ${main} PARENT_SCOPE)
  set(${has_catch2} FALSE PARENT_SCOPE)
  if(main AND NOT installed)
    set(${has_catch2} TRUE PARENT_SCOPE)
  endif()
endfunction()

# _ament_add_catch2_main(): the library with main(), which version 2 usually lacks; compiled once per project.
function(_ament_add_catch2_main)
  if(NOT TARGET ament_catch2_main)
    set(source "${CMAKE_BINARY_DIR}/ament_cmake_catch2/main.cpp")
    _ament_write("${source}" "#define CATCH_CONFIG_MAIN\n#include <catch2/catch.hpp>\n")
    add_library(ament_catch2_main STATIC EXCLUDE_FROM_ALL "${source}")
    target_link_libraries(ament_catch2_main PRIVATE Catch2::Catch2)
  endif()
endfunction()

cmake_policy(POP)
