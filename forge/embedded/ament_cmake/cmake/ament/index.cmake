# The ament resource index: share/ament_index/resource_index/TYPE/NAME below each prefix.

# ament_index_register_resource(<type> [CONTENT <text>] [CONTENT_FILE <file>] [PACKAGE_NAME <name>]
#                               [AMENT_INDEX_BINARY_DIR <folder>] [SKIP_INSTALL])
#
# Write a marker file at generate time, so the text can contain generator expressions, and install it. A content
# file ending in .in is configured first. Line breaks and semicolons in the text are kept.
function(ament_index_register_resource type)
  # Not PARSE_ARGV: arguments split at semicolons here are joined again below.
  cmake_parse_arguments(ARG "SKIP_INSTALL" "AMENT_INDEX_BINARY_DIR;CONTENT_FILE;PACKAGE_NAME" "CONTENT" ${ARGN})
  _ament_refuse_unknown(ament_index_register_resource ${ARG_UNPARSED_ARGUMENTS})
  if(type STREQUAL "")
    message(FATAL_ERROR "ament_index_register_resource() needs the type of the resource")
  endif()
  if(DEFINED ARG_CONTENT AND ARG_CONTENT_FILE)
    message(FATAL_ERROR "ament_index_register_resource() takes either CONTENT or CONTENT_FILE")
  endif()
  if(NOT ARG_PACKAGE_NAME)
    set(ARG_PACKAGE_NAME "${PROJECT_NAME}")
  endif()
  if(NOT ARG_AMENT_INDEX_BINARY_DIR)
    set(ARG_AMENT_INDEX_BINARY_DIR "${CMAKE_BINARY_DIR}/ament_cmake_index")
  endif()
  set(folder "share/ament_index/resource_index/${type}")
  set(marker "${ARG_AMENT_INDEX_BINARY_DIR}/${folder}/${ARG_PACKAGE_NAME}")

  if(ARG_CONTENT_FILE)
    get_filename_component(input "${ARG_CONTENT_FILE}" ABSOLUTE)
    if(NOT EXISTS "${input}")
      message(FATAL_ERROR "ament_index_register_resource() was given '${input}', which does not exist")
    endif()
    if(input MATCHES "\\.in$")
      set(expanded "${CMAKE_CURRENT_BINARY_DIR}/ament_cmake/index/${type}/${ARG_PACKAGE_NAME}")
      configure_file("${input}" "${expanded}" @ONLY)
      set(input "${expanded}")
    endif()
    file(GENERATE OUTPUT "${marker}" INPUT "${input}")
  else()
    file(GENERATE OUTPUT "${marker}" CONTENT "${ARG_CONTENT}")
  endif()
  if(NOT ARG_SKIP_INSTALL)
    install(FILES "${marker}" DESTINATION "${folder}")
  endif()
endfunction()

# ament_index_register_package([PACKAGE_NAME <name>] ...): register the package in the index.
function(ament_index_register_package)
  ament_index_register_resource(packages ${ARGN})
endfunction()

# ament_index_get_prefix_path(<variable> [SKIP_AMENT_PREFIX_PATH] [SKIP_BINARY_DIR])
#
# Return the prefixes to search: the index in the build folder, the install prefix, then AMENT_PREFIX_PATH.
function(ament_index_get_prefix_path variable)
  cmake_parse_arguments(ARG "SKIP_AMENT_PREFIX_PATH;SKIP_BINARY_DIR" "" "" ${ARGN})
  _ament_refuse_unknown(ament_index_get_prefix_path ${ARG_UNPARSED_ARGUMENTS})
  set(prefixes "")
  if(NOT ARG_SKIP_BINARY_DIR)
    list(APPEND prefixes "${CMAKE_BINARY_DIR}/ament_cmake_index")
  endif()
  list(APPEND prefixes "${CMAKE_INSTALL_PREFIX}")
  if(NOT ARG_SKIP_AMENT_PREFIX_PATH AND NOT "$ENV{AMENT_PREFIX_PATH}" STREQUAL "")
    file(TO_CMAKE_PATH "$ENV{AMENT_PREFIX_PATH}" others)
    list_append_unique(prefixes ${others})
  endif()
  set(${variable} "${prefixes}" PARENT_SCOPE)
endfunction()

# ament_index_has_resource(<variable> <type> <name> [PREFIX_PATH <prefix>...]): a prefix, or FALSE.
function(ament_index_has_resource variable type name)
  _ament_index_prefixes(prefixes ament_index_has_resource ${ARGN})
  set(${variable} FALSE PARENT_SCOPE)
  foreach(prefix IN LISTS prefixes)
    if(EXISTS "${prefix}/share/ament_index/resource_index/${type}/${name}")
      set(${variable} "${prefix}" PARENT_SCOPE)
      return()
    endif()
  endforeach()
endfunction()

# ament_index_get_resource(<variable> <type> <name> [PREFIX_PATH <prefix>...]): the text of the marker file.
function(ament_index_get_resource variable type name)
  ament_index_has_resource(prefix ${type} ${name} ${ARGN})
  if(NOT prefix)
    message(FATAL_ERROR "the ament index has no resource '${name}' of the type '${type}'")
  endif()
  file(READ "${prefix}/share/ament_index/resource_index/${type}/${name}" text)
  set(${variable} "${text}" PARENT_SCOPE)
endfunction()

# ament_index_get_resources(<variable> <type> [PREFIX_PATH <prefix>...]): all names, without duplicates.
function(ament_index_get_resources variable type)
  _ament_index_prefixes(prefixes ament_index_get_resources ${ARGN})
  set(names "")
  foreach(prefix IN LISTS prefixes)
    file(GLOB found RELATIVE "${prefix}/share/ament_index/resource_index/${type}"
      "${prefix}/share/ament_index/resource_index/${type}/*")
    list(FILTER found EXCLUDE REGEX "^\\.")
    list_append_unique(names ${found})
  endforeach()
  set(${variable} "${names}" PARENT_SCOPE)
endfunction()

# _ament_index_prefixes(<variable> <command> [PREFIX_PATH <prefix>...]): the given prefixes, or all.
function(_ament_index_prefixes variable command)
  cmake_parse_arguments(ARG "" "" "PREFIX_PATH" ${ARGN})
  _ament_refuse_unknown(${command} ${ARG_UNPARSED_ARGUMENTS})
  if(NOT ARG_PREFIX_PATH)
    ament_index_get_prefix_path(ARG_PREFIX_PATH)
  endif()
  set(${variable} "${ARG_PREFIX_PATH}" PARENT_SCOPE)
endfunction()
