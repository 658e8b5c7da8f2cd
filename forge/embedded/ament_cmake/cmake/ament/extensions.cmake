# Extension points: files of other packages to include at certain steps.
#
# Other packages read these variables, so their names and the form of entries, 'package:file', are fixed.

# ament_register_extension(<point> <package> <file>): include <file>, relative to <package>_DIR, at the point.
macro(ament_register_extension extension_point package_name cmake_filename)
  set(_ament_extension "${package_name}:${cmake_filename}")
  if(NOT _ament_extension IN_LIST AMENT_EXTENSIONS_${extension_point})
    list(APPEND AMENT_EXTENSIONS_${extension_point} "${_ament_extension}")
  endif()
  unset(_ament_extension)
endmacro()

# ament_execute_extensions(<point> [EXCLUDE <package>...]): include the files, in the order of registration.
macro(ament_execute_extensions extension_point)
  _ament_extension_files(_ament_files_${extension_point} ${extension_point} ${ARGN})
  foreach(_ament_file IN LISTS _ament_files_${extension_point})
    include("${_ament_file}")
  endforeach()
  unset(_ament_files_${extension_point})
endmacro()

# _ament_extension_files(<variable> <point> [EXCLUDE <package>...]): what ament_execute_extensions() includes.
function(_ament_extension_files variable extension_point)
  cmake_parse_arguments(ARG "" "" "EXCLUDE" ${ARGN})
  _ament_refuse_unknown(ament_execute_extensions ${ARG_UNPARSED_ARGUMENTS})
  set(files "")
  foreach(extension IN LISTS AMENT_EXTENSIONS_${extension_point})
    if(NOT extension MATCHES "^([^:]+):([^:]+)$")
      message(FATAL_ERROR
        "the extension '${extension}' of '${extension_point}' does not read 'package:file'")
    endif()
    set(package "${CMAKE_MATCH_1}")
    set(file "${${package}_DIR}/${CMAKE_MATCH_2}")
    if(package IN_LIST ARG_EXCLUDE)
      continue()
    endif()
    if(NOT EXISTS "${file}")
      message(FATAL_ERROR
        "'${package}' extends '${extension_point}' by '${file}', which does not exist")
    endif()
    list(APPEND files "${file}")
  endforeach()
  set(${variable} "${files}" PARENT_SCOPE)
endfunction()
