# Type supports: the targets by kind, and what third-party generators call.

# rosidl_get_typesupport_target(<variable> <target> <typesupport>)
#
# The target to link for the interfaces of <target>; ends in -NOTFOUND if there is none.
function(rosidl_get_typesupport_target variable target typesupport)
  if(NOT TARGET "${target}")
    message(FATAL_ERROR "rosidl_get_typesupport_target() was given '${target}', which is no target")
  endif()
  set(answer "${target}__${typesupport}")
  if(NOT TARGET "${answer}")
    set(answer "${answer}-NOTFOUND")
  endif()
  set(${variable} "${answer}" PARENT_SCOPE)
endfunction()

# rosidl_target_interfaces(<target> <interface target> <typesupport>): the old way to link generated code.
function(rosidl_target_interfaces target interface_target typesupport)
  message(DEPRECATION
    "rosidl_target_interfaces() is deprecated, link what rosidl_get_typesupport_target() returns")
  foreach(name IN ITEMS ${target} ${interface_target} ${interface_target}__${typesupport})
    if(NOT TARGET ${name})
      message(FATAL_ERROR "rosidl_target_interfaces() needs '${name}', which is no target")
    endif()
  endforeach()
  add_dependencies(${target} ${interface_target})
  target_link_libraries(${target} ${interface_target}__${typesupport})
endfunction()

# rosidl_export_typesupport_targets(<kind> <target>...): add own targets to <project>_TARGETS__<kind>.
macro(rosidl_export_typesupport_targets kind)
  _rosidl_typesupport_lines(_rosidl_lines rosidl_export_typesupport_targets TARGETS__${kind} "::" ${ARGN})
  string(APPEND rosidl_typesupport_EXPORTS "${_rosidl_lines}")
endmacro()

# rosidl_export_typesupport_libraries(<kind> <target>...): add own libraries to <project>_LIBRARIES__<kind>.
macro(rosidl_export_typesupport_libraries kind)
  _rosidl_typesupport_lines(_rosidl_lines rosidl_export_typesupport_libraries LIBRARIES__${kind} "" ${ARGN})
  string(APPEND rosidl_typesupport_EXPORTS "${_rosidl_lines}")
endmacro()

# _rosidl_typesupport_lines(<variable> <command> <list> <namespace mark> <target>...): lines for the extra file.
function(_rosidl_typesupport_lines variable command list mark)
  if(_${PROJECT_NAME}_AMENT_PACKAGE)
    message(FATAL_ERROR "${command}() must be called before ament_package()")
  endif()
  set(lines "")
  foreach(target IN LISTS ARGN)
    if(NOT TARGET "${target}")
      message(FATAL_ERROR "${command}() was given '${target}', which is no target")
    endif()
    get_target_property(imported "${target}" IMPORTED)
    if(imported)
      message(FATAL_ERROR "${command}() was given '${target}', which belongs to another package")
    endif()
    if(mark STREQUAL "::")
      string(APPEND lines "list(APPEND ${PROJECT_NAME}_${list} ${PROJECT_NAME}::${target})\n")
    else()
      string(APPEND lines "find_library(_${PROJECT_NAME}_${target} NAMES ${target}"
        " PATHS \"\${${PROJECT_NAME}_DIR}/../../../lib\" NO_DEFAULT_PATH)\n"
        "list(APPEND ${PROJECT_NAME}_${list} \"\${_${PROJECT_NAME}_${target}}\")\n")
    endif()
  endforeach()
  set(${variable} "${lines}" PARENT_SCOPE)
endfunction()

# string_camel_case_to_lower_case_underscore(<text> <variable>): rosidl's snake case.
function(string_camel_case_to_lower_case_underscore text variable)
  string(REGEX REPLACE "(.)([A-Z][a-z]+)" "\\1_\\2" text "${text}")
  string(REGEX REPLACE "([a-z0-9])([A-Z])" "\\1_\\2" text "${text}")
  string(TOLOWER "${text}" text)
  set(${variable} "${text}" PARENT_SCOPE)
endfunction()

# get_used_typesupports(<variable> <index type>): the type supports that the index knows, or the chosen one.
function(get_used_typesupports variable type)
  string(TOUPPER "STATIC_${type}" choice)
  if(NOT "${${choice}}" STREQUAL "")
    set(names "${${choice}}")
  elseif(NOT "$ENV{${choice}}" STREQUAL "")
    set(names "$ENV{${choice}}")
  else()
    ament_index_get_resources(names ${type})
  endif()
  set(${variable} "${names}" PARENT_SCOPE)
endfunction()

# rosidl_generator_py_get_typesupports(<variable>): generated Python needs no type support of C.
function(rosidl_generator_py_get_typesupports variable)
  get_used_typesupports(names rosidl_typesupport_c)
  set(${variable} "${names}" PARENT_SCOPE)
endfunction()

# rosidl_write_generator_arguments(<file> PACKAGE_NAME <name> <KEY> <value>...)
#
# The arguments of a third-party generator as JSON, keys in lower case.
function(rosidl_write_generator_arguments file)
  set(single PACKAGE_NAME OUTPUT_DIR TEMPLATE_DIR)
  set(multiple IDL_TUPLES NON_IDL_TUPLES ROS_INTERFACE_FILES ROS_INTERFACE_DEPENDENCIES TARGET_DEPENDENCIES
    ADDITIONAL_FILES INCLUDE_PATHS TYPE_DESCRIPTION_TUPLES)
  cmake_parse_arguments(ARG "" "${single}" "${multiple}" ${ARGN})
  if(NOT ARG_PACKAGE_NAME)
    message(FATAL_ERROR "rosidl_write_generator_arguments() needs PACKAGE_NAME")
  endif()
  if(NOT ARG_IDL_TUPLES AND NOT ARG_NON_IDL_TUPLES AND NOT ARG_ROS_INTERFACE_FILES)
    message(FATAL_ERROR
      "rosidl_write_generator_arguments() needs IDL_TUPLES, NON_IDL_TUPLES or ROS_INTERFACE_FILES")
  endif()
  set(members "")
  foreach(key IN LISTS single multiple)
    if(NOT DEFINED ARG_${key})
      continue()
    endif()
    set(values "")
    foreach(value IN LISTS ARG_${key})
      string(REGEX REPLACE "([\\\\\"])" "\\\\\\1" value "${value}")
      list(APPEND values "\"${value}\"")
    endforeach()
    string(REPLACE ";" ",\n    " values "${values}")
    if(key IN_LIST multiple)
      set(values "[\n    ${values}\n  ]")
    endif()
    string(TOLOWER "${key}" key)
    list(APPEND members "  \"${key}\": ${values}")
  endforeach()
  string(REPLACE ";" ",\n" members "${members}")
  _rosidl_write("${file}" "{\n${members}\n}\n")
endfunction()
