# Tests: commands that run through run_test.py, which always writes a result file.

macro(_ament_settle_testing)
  if(BUILD_TESTING)
    enable_testing()
    _ament_write_ctest_files()
  endif()
  option(AMENT_RUN_PERFORMANCE_TESTS "Run performance tests instead of skipping them" OFF)
endmacro()

# _ament_write_ctest_files(): configure CTest not to truncate the output of tests.
function(_ament_write_ctest_files)
  _ament_write("${CMAKE_BINARY_DIR}/CTestCustom.cmake"
    "set(CTEST_CUSTOM_MAXIMUM_PASSED_TEST_OUTPUT_SIZE 0)\nset(CTEST_CUSTOM_MAXIMUM_FAILED_TEST_OUTPUT_SIZE 0)\n")
  _ament_write("${CMAKE_BINARY_DIR}/CTestConfiguration.ini"
    "SourceDirectory: ${CMAKE_SOURCE_DIR}\nBuildDirectory: ${CMAKE_BINARY_DIR}\nSite: localhost\nBuildName: ${PROJECT_NAME}\n")
endfunction()

# ament_add_test(<name> COMMAND <word>... [OUTPUT_FILE <file>] [RESULT_FILE <file>] [RUNNER <script>]
#                [TIMEOUT <seconds>] [WORKING_DIRECTORY <folder>] [SKIP_RETURN_CODE <code>]
#                [ENV <key>=<value>...] [APPEND_ENV <key>=<value>...] [APPEND_LIBRARY_DIRS <folder>...]
#                [SKIP_TEST] [SKIP_REASON <text>] [GENERATE_RESULT_FOR_RETURN_CODE_ZERO])
function(ament_add_test name)
  cmake_parse_arguments(ARG "SKIP_TEST;GENERATE_RESULT_FOR_RETURN_CODE_ZERO"
    "OUTPUT_FILE;RESULT_FILE;RUNNER;SKIP_REASON;SKIP_RETURN_CODE;TIMEOUT;WORKING_DIRECTORY"
    "APPEND_ENV;APPEND_LIBRARY_DIRS;COMMAND;ENV" ${ARGN})
  _ament_refuse_unknown(ament_add_test ${ARG_UNPARSED_ARGUMENTS})
  if("${ARG_COMMAND}" STREQUAL "")  # not "if(NOT ...)": the program may be called false
    message(FATAL_ERROR "ament_add_test() needs the COMMAND of the test '${name}'")
  endif()
  if(NOT DEFINED ARG_TIMEOUT)
    set(ARG_TIMEOUT 60)
  endif()
  if(NOT ARG_TIMEOUT GREATER 0)
    message(FATAL_ERROR "ament_add_test(): the TIMEOUT of the test '${name}' must be more than 0 seconds")
  endif()
  if(NOT ARG_RESULT_FILE)
    set(ARG_RESULT_FILE "${AMENT_TEST_RESULTS_DIR}/${PROJECT_NAME}/${name}.xml")
  endif()
  if(NOT ARG_WORKING_DIRECTORY)
    set(ARG_WORKING_DIRECTORY "${CMAKE_CURRENT_BINARY_DIR}")
  endif()
  if(NOT ARG_RUNNER)
    _ament_folder(folder)
    set(ARG_RUNNER "${folder}/run_test.py")
  endif()

  set(words "${ARG_RESULT_FILE}" --package-name "${PROJECT_NAME}")
  if(ARG_OUTPUT_FILE)
    list(APPEND words --output-file "${ARG_OUTPUT_FILE}")
  endif()
  if(ARG_SKIP_TEST)
    list(APPEND words --skip-test)
    if(ARG_SKIP_REASON)
      list(APPEND words --skip-reason "${ARG_SKIP_REASON}")
    endif()
    set(ARG_SKIP_RETURN_CODE 0)  # CTest reports it as skipped as well
  elseif(DEFINED ARG_SKIP_RETURN_CODE)
    list(APPEND words --skip-return-code "${ARG_SKIP_RETURN_CODE}")
  endif()
  if(ARG_GENERATE_RESULT_FOR_RETURN_CODE_ZERO)
    list(APPEND words --generate-result-on-success)
  endif()
  if(APPLE)
    set(loader_variable DYLD_LIBRARY_PATH)
  else()
    set(loader_variable LD_LIBRARY_PATH)
  endif()
  foreach(library_dir IN LISTS ARG_APPEND_LIBRARY_DIRS)
    list(APPEND ARG_APPEND_ENV "${loader_variable}=${library_dir}")
  endforeach()
  foreach(list IN ITEMS ENV APPEND_ENV)
    if(ARG_${list})
      string(TOLOWER "--${list}" option)
      string(REPLACE "_" "-" option "${option}")
      list(APPEND words ${option} ${ARG_${list}})
    endif()
  endforeach()

  # CTest knows an emulator only for commands that are targets.
  if(CMAKE_CROSSCOMPILING_EMULATOR AND "${ARG_COMMAND}" MATCHES "^\\$<TARGET_FILE:")
    list(INSERT ARG_COMMAND 0 ${CMAKE_CROSSCOMPILING_EMULATOR})
  endif()
  add_test(NAME "${name}"
    COMMAND "${Python3_EXECUTABLE}" -u "${ARG_RUNNER}" ${words} --command ${ARG_COMMAND}
    WORKING_DIRECTORY "${ARG_WORKING_DIRECTORY}")
  set_tests_properties("${name}" PROPERTIES TIMEOUT ${ARG_TIMEOUT})
  if(DEFINED ARG_SKIP_RETURN_CODE)
    set_tests_properties("${name}" PROPERTIES SKIP_RETURN_CODE ${ARG_SKIP_RETURN_CODE})
  endif()
endfunction()

# ament_add_test_label(<test> <label>...)
function(ament_add_test_label name)
  set_property(TEST "${name}" APPEND PROPERTY LABELS ${ARGN})
endfunction()

# ament_add_pytest_test(<name> <path> [PYTHON_EXECUTABLE <python>] [WERROR ON|OFF] [NOCAPTURE]
#                       [options of ament_add_test]...)
function(ament_add_pytest_test name path)
  cmake_parse_arguments(ARG "NOCAPTURE;SKIP_TEST"
    "PYTHON_EXECUTABLE;RUNNER;SKIP_REASON;TIMEOUT;WERROR;WORKING_DIRECTORY"
    "APPEND_ENV;APPEND_LIBRARY_DIRS;ENV" ${ARGN})
  _ament_refuse_unknown(ament_add_pytest_test ${ARG_UNPARSED_ARGUMENTS})
  get_filename_component(file "${path}" ABSOLUTE BASE_DIR "${CMAKE_CURRENT_SOURCE_DIR}")
  if(path MATCHES "\\$<")
    set(file "${path}")
  elseif(NOT EXISTS "${file}")
    message(FATAL_ERROR "ament_add_pytest_test() was given '${file}', which does not exist")
  endif()
  if(NOT ARG_PYTHON_EXECUTABLE)
    set(ARG_PYTHON_EXECUTABLE "${Python3_EXECUTABLE}")
  endif()
  get_executable_path(python "${ARG_PYTHON_EXECUTABLE}" BUILD)
  ament_has_pytest(has_pytest QUIET PYTHON_EXECUTABLE "${ARG_PYTHON_EXECUTABLE}")
  if(NOT has_pytest)
    message(WARNING "'${name}' is skipped: '${ARG_PYTHON_EXECUTABLE}' has no pytest")
    return()
  endif()

  set(result "${AMENT_TEST_RESULTS_DIR}/${PROJECT_NAME}/${name}.xunit.xml")
  set(cache "${CMAKE_CURRENT_BINARY_DIR}/ament_cmake_pytest/${name}/.cache")
  set(command "${python}" -u -m pytest "${file}" -o "cache_dir=${cache}"
    "--junit-xml=${result}" "--junit-prefix=${PROJECT_NAME}")
  if(ARG_NOCAPTURE)
    list(APPEND command -s)
  endif()
  if(ARG_WERROR)
    list(APPEND command -W error)
  endif()
  if(AMENT_CMAKE_PYTEST_WITH_COVERAGE)
    list(APPEND command "--cov=${CMAKE_CURRENT_SOURCE_DIR}"
      "--cov-report=html:${CMAKE_CURRENT_BINARY_DIR}/pytest_cov/${name}/coverage.html"
      "--cov-report=xml:${CMAKE_CURRENT_BINARY_DIR}/pytest_cov/${name}/coverage.xml")
  endif()
  _ament_collect_test_options(options)
  ament_add_test("${name}" COMMAND ${command} RESULT_FILE "${result}"
    OUTPUT_FILE "${CMAKE_CURRENT_BINARY_DIR}/ament_cmake_pytest/${name}.txt" ${options})
  set_tests_properties("${name}" PROPERTIES LABELS "pytest")
endfunction()

# ament_has_pytest(<variable> [QUIET] [PYTHON_EXECUTABLE <python>]): cached per interpreter.
function(ament_has_pytest variable)
  cmake_parse_arguments(ARG "QUIET" "PYTHON_EXECUTABLE" "" ${ARGN})
  _ament_ask_python(answer pytest "${ARG_PYTHON_EXECUTABLE}")
  if(NOT answer AND NOT ARG_QUIET)
    message(WARNING "pytest was not found")
  endif()
  if(answer)
    set(answer TRUE)
  else()
    set(answer FALSE)
  endif()
  set(${variable} ${answer} PARENT_SCOPE)
endfunction()

# ament_get_pytest_cov_version(<variable> [QUIET] [PYTHON_EXECUTABLE <python>])
function(ament_get_pytest_cov_version variable)
  cmake_parse_arguments(ARG "QUIET" "PYTHON_EXECUTABLE" "" ${ARGN})
  _ament_ask_python(answer pytest_cov "${ARG_PYTHON_EXECUTABLE}")
  if(NOT answer)
    set(answer "${variable}-NOTFOUND")
  endif()
  set(${variable} "${answer}" PARENT_SCOPE)
endfunction()

# _ament_ask_python(<variable> <module> <python or nothing>): the module's version, 'unknown', or nothing.
# The module is not imported: pytest's import reads the metadata of every distribution on the path.
function(_ament_ask_python variable module python)
  if(python STREQUAL "")
    set(python "${Python3_EXECUTABLE}")
  endif()
  get_executable_path(python "${python}" CONFIGURE)
  string(SHA1 key "${python} ${module}")
  if(NOT DEFINED CACHE{AMENT_PYTHON_HAS_${key}})
    _ament_folder(folder)
    execute_process(
      COMMAND "${python}" "${folder}/module_version.py" "${module}"
      OUTPUT_VARIABLE answer OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE code)
    if(NOT code EQUAL 0)
      # Not cached: the user may install it before the next run.
      set(${variable} "" PARENT_SCOPE)
      return()
    endif()
    set(AMENT_PYTHON_HAS_${key} "${answer}" CACHE INTERNAL "Version of ${module} in ${python}")
  endif()
  set(${variable} "${AMENT_PYTHON_HAS_${key}}" PARENT_SCOPE)
endfunction()

# ament_add_nose_test(...): not supported, nose is obsolete.
function(ament_add_nose_test name)
  message(WARNING "'${name}' is skipped: nose is obsolete, call ament_add_pytest_test()")
endfunction()

# _ament_collect_test_options(<variable>): ament_add_test()'s options as the calling command's ARG_ variables.
macro(_ament_collect_test_options variable)
  set(${variable} "")
  foreach(_ament_option IN ITEMS SKIP_TEST)
    if(ARG_${_ament_option})
      list(APPEND ${variable} ${_ament_option})
    endif()
  endforeach()
  foreach(_ament_option IN ITEMS SKIP_REASON RUNNER TIMEOUT WORKING_DIRECTORY ENV APPEND_ENV APPEND_LIBRARY_DIRS)
    if(NOT "${ARG_${_ament_option}}" STREQUAL "")
      list(APPEND ${variable} ${_ament_option} ${ARG_${_ament_option}})
    endif()
  endforeach()
endmacro()

# _ament_parse_program(<argument>...): the options of tests that are programs, as ARG_ variables.
macro(_ament_parse_program)
  cmake_parse_arguments(ARG "SKIP_LINKING_MAIN_LIBRARIES;SKIP_TEST;RUN_PARALLEL"
    "RUNNER;TIMEOUT;WORKING_DIRECTORY;TEST_NAME;SKIP_REASON" "APPEND_ENV;APPEND_LIBRARY_DIRS;ENV" ${ARGN})
endmacro()

# _ament_add_program_without(<library> <target> <source>...): a target that is not built, because it needs a
# library that was not found. Its tests are skipped.
function(_ament_add_program_without library target)
  _ament_tell_missing(${library})
  add_executable(${target} EXCLUDE_FROM_ALL ${ARGN})
  set_property(TARGET ${target} PROPERTY AMENT_MISSING_LIBRARY "${library}")
endfunction()

# _ament_add_program_test(<target> <test> <label> <result> <argument of the program>...)
#
# A test that runs a target, with the options from _ament_parse_program().
function(_ament_add_program_test target name label result)
  get_target_property(missing ${target} AMENT_MISSING_LIBRARY)
  if(missing)
    set(ARG_SKIP_TEST TRUE)
    set(ARG_SKIP_REASON "${missing} was not found")
  endif()
  _ament_collect_test_options(options)
  ament_add_test(${name} COMMAND "$<TARGET_FILE:${target}>" ${ARGN}
    RESULT_FILE "${result}" OUTPUT_FILE "${CMAKE_BINARY_DIR}/ament_cmake_${label}/${name}.txt" ${options})
  set_tests_properties(${name} PROPERTIES LABELS ${label})
  if(NOT missing)
    set_tests_properties(${name} PROPERTIES REQUIRED_FILES "$<TARGET_FILE:${target}>")
  endif()
endfunction()

# _ament_tell_missing(<name>): report skipped tests, once per project.
function(_ament_tell_missing name)
  get_property(told GLOBAL PROPERTY ament_told_missing_${name})
  if(NOT told)
    message(STATUS "'${name}' was not found: tests that need it are skipped")
    set_property(GLOBAL PROPERTY ament_told_missing_${name} TRUE)
  endif()
endfunction()
