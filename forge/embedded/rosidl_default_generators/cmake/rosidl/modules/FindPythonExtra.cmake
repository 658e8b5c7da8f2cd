# Find the headers and suffixes for extension modules of the workspace's Python interpreter.
#
# Sets PythonExtra_FOUND, PythonExtra_INCLUDE_DIRS, PythonExtra_LIBRARIES, PythonExtra_EXTENSION_SUFFIX
# (.cpython-311-x86_64-linux-gnu), PythonExtra_EXTENSION_EXTENSION (.so), PYTHON_SOABI, and the variables of
# FindPythonInterp and FindPythonLibs. Missing headers are not an error, because most packages only need the
# interpreter: include folders and libraries are set if they exist.

if(NOT PYTHON_EXECUTABLE)
  set(PYTHON_EXECUTABLE "${Python3_EXECUTABLE}")
endif()
if(NOT PythonExtra_ASKED STREQUAL PYTHON_EXECUTABLE)
  execute_process(
    COMMAND "${PYTHON_EXECUTABLE}" -S -E -c [[
from sysconfig import get_config_var as ask, get_path
from platform import python_version
library = f"{ask('LIBDIR')}/{ask('LDLIBRARY')}"
print(python_version(), ask("SOABI") or "", ask("EXT_SUFFIX") or ".so", get_path("include"), library, sep=";", end="")]]
    OUTPUT_VARIABLE _python_extra_answer RESULT_VARIABLE _python_extra_code)
  if(_python_extra_code EQUAL 0)
    set(PythonExtra_ANSWER "${_python_extra_answer}" CACHE INTERNAL "What PythonExtra_ASKED said")
    set(PythonExtra_ASKED "${PYTHON_EXECUTABLE}" CACHE INTERNAL "The Python that was asked")
  endif()
endif()

set(PythonExtra_FOUND FALSE)
if(PythonExtra_ASKED STREQUAL PYTHON_EXECUTABLE)
  set(PythonExtra_FOUND TRUE)
  set(PYTHONINTERP_FOUND TRUE)
  list(GET PythonExtra_ANSWER 0 PYTHON_VERSION_STRING)
  list(GET PythonExtra_ANSWER 1 PYTHON_SOABI)
  list(GET PythonExtra_ANSWER 2 PythonExtra_EXTENSION_EXTENSION)
  list(GET PythonExtra_ANSWER 3 PythonExtra_INCLUDE_DIRS)
  list(GET PythonExtra_ANSWER 4 PythonExtra_LIBRARIES)
  string(REGEX MATCH "^([0-9]+)\\.([0-9]+)" _python_extra_answer "${PYTHON_VERSION_STRING}")
  set(PYTHON_VERSION_MAJOR "${CMAKE_MATCH_1}")
  set(PYTHON_VERSION_MINOR "${CMAKE_MATCH_2}")
  string(REGEX MATCH "\\.[^.]*$" PythonExtra_EXTENSION_EXTENSION "${PythonExtra_EXTENSION_EXTENSION}")
  set(PythonExtra_EXTENSION_SUFFIX "")
  if(PYTHON_SOABI)
    set(PythonExtra_EXTENSION_SUFFIX ".${PYTHON_SOABI}")
  endif()
  foreach(_python_extra_list IN ITEMS INCLUDE_DIRS LIBRARIES)
    if(NOT EXISTS "${PythonExtra_${_python_extra_list}}")
      set(PythonExtra_${_python_extra_list} "")
    endif()
    set(PYTHON_${_python_extra_list} "${PythonExtra_${_python_extra_list}}")
  endforeach()
  if(PythonExtra_INCLUDE_DIRS AND PythonExtra_LIBRARIES)
    set(PYTHONLIBS_FOUND TRUE)
  endif()
endif()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(PythonExtra
  REQUIRED_VARS PYTHON_EXECUTABLE PythonExtra_EXTENSION_EXTENSION VERSION_VAR PYTHON_VERSION_STRING)
unset(_python_extra_answer)
unset(_python_extra_code)
unset(_python_extra_list)
