# package.xml as CMake variables.

# ament_package_xml([DIRECTORY <folder>])
#
# Set _AMENT_PACKAGE_NAME, PACKAGE_XML_DIRECTORY and <package>_VERSION, _MAINTAINER, _BUILD_DEPENDS and so on
# from the manifest. Fails if the manifest is not that of the project, or was read before.
#
# forge provides these variables in a file (FORGE_MANIFEST). If package.xml has changed since, or the build runs
# without forge, a small Python program parses package.xml.
macro(ament_package_xml)
  cmake_parse_arguments(_ARG "" "DIRECTORY" "" ${ARGN})
  _ament_refuse_unknown(ament_package_xml ${_ARG_UNPARSED_ARGUMENTS})
  if(DEFINED _AMENT_PACKAGE_NAME)
    message(FATAL_ERROR "ament_package_xml() was called before, for '${_AMENT_PACKAGE_NAME}'")
  endif()
  if(_ARG_DIRECTORY)
    get_filename_component(PACKAGE_XML_DIRECTORY "${_ARG_DIRECTORY}" ABSOLUTE)
  else()
    set(PACKAGE_XML_DIRECTORY "${PROJECT_SOURCE_DIR}")
  endif()
  _ament_manifest_file(_ament_manifest_file "${PACKAGE_XML_DIRECTORY}/package.xml")
  include("${_ament_manifest_file}")
  if(NOT _AMENT_PACKAGE_NAME STREQUAL PROJECT_NAME)
    message(FATAL_ERROR
      "package.xml names the package '${_AMENT_PACKAGE_NAME}', but project() says '${PROJECT_NAME}'")
  endif()
  unset(_ament_manifest_file)
endmacro()

# _ament_manifest_file(<variable> <package.xml>): the up-to-date file with the variables of the manifest.
function(_ament_manifest_file variable package_xml)
  if(NOT EXISTS "${package_xml}")
    message(FATAL_ERROR "there is no '${package_xml}'")
  endif()
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${package_xml}")
  if(FORGE_MANIFEST AND EXISTS "${FORGE_MANIFEST}" AND NOT "${package_xml}" IS_NEWER_THAN "${FORGE_MANIFEST}")
    file(STRINGS "${FORGE_MANIFEST}" first_line LIMIT_COUNT 1)
    if(first_line MATCHES "'${PROJECT_NAME}'")
      set(${variable} "${FORGE_MANIFEST}" PARENT_SCOPE)
      return()
    endif()
  endif()

  set(own_file "${CMAKE_CURRENT_BINARY_DIR}/ament_cmake/manifest.cmake")
  file(SHA256 "${package_xml}" digest)
  if(EXISTS "${own_file}")
    file(STRINGS "${own_file}" first_line LIMIT_COUNT 1)
    if(first_line MATCHES "${digest}")
      set(${variable} "${own_file}" PARENT_SCOPE)
      return()
    endif()
  endif()
  _ament_folder(folder)
  execute_process(
    COMMAND "${Python3_EXECUTABLE}" -S -E "${folder}/package_xml_to_cmake.py" "${package_xml}"
    OUTPUT_VARIABLE text ERROR_VARIABLE problem ERROR_STRIP_TRAILING_WHITESPACE RESULT_VARIABLE code)
  if(NOT code EQUAL 0)
    message(FATAL_ERROR "${problem}")
  endif()
  file(WRITE "${own_file}" "# From package.xml with the SHA-256 ${digest}\n${text}")
  set(${variable} "${own_file}" PARENT_SCOPE)
endfunction()
