# The Python interpreter of the workspace, and the install folder of modules.
#
# forge passes both as cache entries. Otherwise the interpreter is queried once per build folder, which is
# about ten times faster than FindPython3; projects can still call FindPython3 for other components.

macro(_ament_settle_python)
  if(NOT Python3_EXECUTABLE)
    if(PYTHON_EXECUTABLE)
      set(Python3_EXECUTABLE "${PYTHON_EXECUTABLE}")
    else()
      find_program(Python3_EXECUTABLE NAMES python3 python DOC "The Python interpreter")
      if(NOT Python3_EXECUTABLE)
        message(FATAL_ERROR "no Python 3 found: put python3 on PATH or set Python3_EXECUTABLE")
      endif()
    endif()
  endif()
  _ament_python_version(_ament_python_version)
  if(NOT Python3_VERSION)
    set(Python3_VERSION "${_ament_python_version}")
  endif()
  string(REGEX MATCH "^([0-9]+)\\.([0-9]+)" _ament_python_version "${Python3_VERSION}")
  set(Python3_VERSION_MAJOR "${CMAKE_MATCH_1}")
  set(Python3_VERSION_MINOR "${CMAKE_MATCH_2}")
  set(Python3_FOUND TRUE)
  set(Python3_Interpreter_FOUND TRUE)
  if(NOT PYTHON_EXECUTABLE)
    set(PYTHON_EXECUTABLE "${Python3_EXECUTABLE}")  # for older packages
  endif()
  if(NOT TARGET Python3::Interpreter)
    add_executable(Python3::Interpreter IMPORTED)
    set_property(TARGET Python3::Interpreter PROPERTY IMPORTED_LOCATION "${Python3_EXECUTABLE}")
  endif()
  set(PYTHON_INSTALL_DIR "lib/python${_ament_python_version}/site-packages"
    CACHE STRING "Where Python modules are installed, relative to the prefix")
  unset(_ament_python_version)
endmacro()

# _ament_python_version(<variable>): the version X.Y.Z of the interpreter, or X.Y if only that was passed.
function(_ament_python_version variable)
  if(NOT FORGE_PYTHON_VERSION STREQUAL "" AND DEFINED FORGE_PYTHON_VERSION)
    set(${variable} "${FORGE_PYTHON_VERSION}" PARENT_SCOPE)
    return()
  endif()
  if(NOT AMENT_PYTHON_VERSION MATCHES "^(.*) of (.*)$" OR NOT CMAKE_MATCH_2 STREQUAL Python3_EXECUTABLE)
    execute_process(
      COMMAND "${Python3_EXECUTABLE}" -S -E -c "import platform; print(platform.python_version())"
      OUTPUT_VARIABLE version OUTPUT_STRIP_TRAILING_WHITESPACE RESULT_VARIABLE code)
    if(NOT code EQUAL 0)
      message(FATAL_ERROR "'${Python3_EXECUTABLE}' does not run as a Python interpreter")
    endif()
    set(AMENT_PYTHON_VERSION "${version} of ${Python3_EXECUTABLE}" CACHE INTERNAL "What Python3_EXECUTABLE said")
    string(REGEX MATCH "^(.*) of (.*)$" answer "${AMENT_PYTHON_VERSION}")
  endif()
  set(${variable} "${CMAKE_MATCH_1}" PARENT_SCOPE)
endfunction()

# ament_get_python_install_dir(<variable>): the install folder of Python modules, relative to the prefix.
function(ament_get_python_install_dir variable)
  set(${variable} "${PYTHON_INSTALL_DIR}" PARENT_SCOPE)
endfunction()
