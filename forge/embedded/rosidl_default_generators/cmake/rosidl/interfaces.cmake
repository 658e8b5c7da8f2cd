# rosidl_generate_interfaces(): generate, install and export the interfaces of a package.

# rosidl_generate_interfaces(<target> <file>... [DEPENDENCIES <package>...] [LIBRARY_NAME <name>]
#                            [SKIP_INSTALL] [SKIP_GROUP_MEMBERSHIP_CHECK] [ADD_LINTER_TESTS])
#
# A file is relative to the current source folder, or BASE:msg/X.msg. Creates the custom target <target>,
# header-only targets <target>__rosidl_typesupport_cpp and so on (also as <project>::...), and a Python
# package. A macro, so that the caller sees the packages that it finds, and extensions see the caller's variables.
#
# LIBRARY_NAME is passed on to extensions, but has no effect on header-only code. ADD_LINTER_TESTS adds no test.
macro(rosidl_generate_interfaces target)
  cmake_parse_arguments(_rosidl
    "SKIP_INSTALL;SKIP_GROUP_MEMBERSHIP_CHECK;ADD_LINTER_TESTS" "LIBRARY_NAME" "DEPENDENCIES" ${ARGN})
  if(_${PROJECT_NAME}_AMENT_PACKAGE)
    message(FATAL_ERROR "rosidl_generate_interfaces() must be called before ament_package()")
  endif()
  _rosidl_read_files(_rosidl_tuples "${target}" ${_rosidl_UNPARSED_ARGUMENTS})
  if(_rosidl_ADD_LINTER_TESTS)
    message(STATUS "ADD_LINTER_TESTS adds no tests: nobody edits the generated code")
  endif()

  # Actions, and services with events, use these packages; most packages do not declare them.
  _rosidl_implied_packages(_rosidl_implied ${_rosidl_tuples})
  foreach(_rosidl_dependency IN LISTS _rosidl_implied)
    if(NOT ${_rosidl_dependency}_FOUND)
      find_package(${_rosidl_dependency} QUIET)
    endif()
    if(NOT ${_rosidl_dependency}_FOUND)
      message(FATAL_ERROR
        "'${PROJECT_NAME}' defines services or actions, which need the package '${_rosidl_dependency}': "
        "add <depend>${_rosidl_dependency}</depend> to package.xml")
    endif()
  endforeach()
  if(_rosidl_implied)
    list(APPEND _rosidl_DEPENDENCIES ${_rosidl_implied})
    list(REMOVE_DUPLICATES _rosidl_DEPENDENCIES)
  endif()
  foreach(_rosidl_dependency IN LISTS _rosidl_DEPENDENCIES)
    if(NOT ${_rosidl_dependency}_FOUND)
      message(FATAL_ERROR
        "rosidl_generate_interfaces() depends on '${_rosidl_dependency}', which was not found "
        "(is there a find_package(${_rosidl_dependency} REQUIRED) above?)")
    endif()
  endforeach()
  _rosidl_interface_packages(_rosidl_packages ${_rosidl_DEPENDENCIES})

  if(NOT _rosidl_SKIP_INSTALL)
    if(NOT _AMENT_PACKAGE_NAME)
      ament_package_xml()
    endif()
    if(NOT _rosidl_SKIP_GROUP_MEMBERSHIP_CHECK
        AND NOT "rosidl_interface_packages" IN_LIST ${PROJECT_NAME}_MEMBER_OF_GROUPS)
      message(FATAL_ERROR
        "the package.xml of '${PROJECT_NAME}' must contain "
        "<member_of_group>rosidl_interface_packages</member_of_group>")
    endif()
    ament_export_dependencies(${_rosidl_DEPENDENCIES} rosidl_default_runtime)
  endif()
  if(NOT DEFINED PYTHON_INSTALL_DIR)
    ament_get_python_install_dir(PYTHON_INSTALL_DIR)
  endif()

  _rosidl_check_names(${_rosidl_tuples})
  _rosidl_generate("${target}" "${_rosidl_tuples}" "${_rosidl_packages}")
  _rosidl_add_targets("${target}" "${_rosidl_packages}")
  if(NOT _rosidl_SKIP_INSTALL)
    _rosidl_install("${target}" "${_rosidl_tuples}")
    _rosidl_describe("${target}" "${_rosidl_tuples}")
  endif()

  # Variables for third-party generators.
  _rosidl_output_folder(_rosidl_output "${target}")
  _rosidl_idl_tuples(rosidl_generate_interfaces_IDL_TUPLES "${_rosidl_output}" ${_rosidl_tuples})
  string(REGEX REPLACE "(^|;)([^;]*):([^;:]*)" "\\1\\2/\\3"
    rosidl_generate_interfaces_ABS_IDL_FILES "${rosidl_generate_interfaces_IDL_TUPLES}")
  set(rosidl_generate_interfaces_TARGET "${target}")
  set(rosidl_generate_interfaces_DEPENDENCY_PACKAGE_NAMES "${_rosidl_packages}")
  set(rosidl_generate_interfaces_LIBRARY_NAME "${_rosidl_LIBRARY_NAME}")
  set(rosidl_generate_interfaces_SKIP_INSTALL "${_rosidl_SKIP_INSTALL}")
  set(rosidl_generate_interfaces_ADD_LINTER_TESTS "${_rosidl_ADD_LINTER_TESTS}")
  ament_execute_extensions(rosidl_generate_idl_interfaces)
endmacro()

# _rosidl_check_names(<tuple>...): reject interfaces whose generated files would have the same names.
#
# Ninja would report them by the names of files that no user has written.
function(_rosidl_check_names)
  foreach(tuple IN LISTS ARGN)
    string(REGEX REPLACE "^.*[:/]([^:/]+)\\.([^.]+)$" "\\1" name "${tuple}")
    string(REGEX REPLACE "^.*\\.([^.]+)$" "\\1" kind "${tuple}")
    if(kind STREQUAL "idl")
      string(REGEX REPLACE "^.*[:/]([^:/]+)/[^:/]+$" "\\1" kind "${tuple}")
    endif()
    string_camel_case_to_lower_case_underscore("${name}" output)
    set(first "${first_${kind}_${output}}")
    if(first AND NOT first STREQUAL name)
      message(FATAL_ERROR
        "'${name}' and '${first}' would both be generated into '${output}': "
        "rename one of them: the names of generated files are in lower case")
    endif()
    set("first_${kind}_${output}" "${name}")
  endforeach()
endfunction()

# rosidl_interfaces_of_distribution(<variable>)
#
# Return the definitions of the current source folder that the ROS distribution has: those of the oldest one in
# msg, srv and action, replaced or completed by those in since/<distribution>, without those named in
# since/<distribution>/removed. Only forge's own packages use it.
function(rosidl_interfaces_of_distribution variable)
  get_property(distributions GLOBAL PROPERTY rosidl_distributions)
  set(known "")
  set(tuples "")
  foreach(base IN LISTS distributions ITEMS .)
    if(NOT base STREQUAL ".")
      string(PREPEND base "since/")
    endif()
    get_filename_component(base "${base}" ABSOLUTE)
    file(GLOB found CONFIGURE_DEPENDS RELATIVE "${base}"
      "${base}/msg/*.msg" "${base}/srv/*.srv" "${base}/action/*.action")
    list(REMOVE_ITEM found "" ${known})
    list(APPEND known ${found})
    if(EXISTS "${base}/removed")
      file(STRINGS "${base}/removed" removed)
      list(APPEND known ${removed})
    endif()
    list(TRANSFORM found PREPEND "${base}:")
    list(APPEND tuples ${found})
  endforeach()
  set(${variable} "${tuples}" PARENT_SCOPE)
endfunction()

# _rosidl_implied_packages(<variable> <tuple>...): the packages that generated code refers to in any case.
function(_rosidl_implied_packages variable)
  set(packages "")
  get_property(has_events GLOBAL PROPERTY rosidl_has_service_events)
  if(ARGN MATCHES ":action/|\\.action(;|$)")
    list(APPEND packages action_msgs)
  endif()
  if(has_events AND ARGN MATCHES ":(srv|action)/|\\.(srv|action)(;|$)")
    list(APPEND packages service_msgs)
  endif()
  set(${variable} "${packages}" PARENT_SCOPE)
endfunction()

# _rosidl_read_files(<variable> <target> <file>...): check the files, and return them as BASE:NAMESPACE/NAME.EXT.
function(_rosidl_read_files variable target)
  if(TARGET "${target}")
    message(FATAL_ERROR
      "rosidl_generate_interfaces() makes a target '${target}', but there is one already: "
      "give the library or program another name")
  endif()
  if(NOT ARGN)
    message(FATAL_ERROR "rosidl_generate_interfaces() was given no files for '${target}'")
  endif()
  set(tuples "")
  foreach(file IN LISTS ARGN)
    if(file MATCHES "^(/.*):([^:]+)$")
      set(path "${CMAKE_MATCH_1}/${CMAKE_MATCH_2}")
    elseif(IS_ABSOLUTE "${file}")
      message(FATAL_ERROR
        "rosidl_generate_interfaces() takes an absolute path as BASE:NAMESPACE/NAME, not as '${file}'")
    else()
      set(path "${CMAKE_CURRENT_SOURCE_DIR}/${file}")
    endif()
    get_filename_component(path "${path}" ABSOLUTE)
    if(NOT EXISTS "${path}" OR IS_DIRECTORY "${path}")
      message(FATAL_ERROR "rosidl_generate_interfaces() was given '${path}', which does not exist")
    endif()
    if(NOT path MATCHES "^(.+)/([^/]+)/([^/]+\\.(msg|srv|action|idl))$")
      message(FATAL_ERROR
        "rosidl_generate_interfaces() was given '${path}', which is not a .msg, .srv, .action or .idl file")
    endif()
    list(APPEND tuples "${CMAKE_MATCH_1}:${CMAKE_MATCH_2}/${CMAKE_MATCH_3}")
  endforeach()
  list(REMOVE_DUPLICATES tuples)
  _rosidl_tell_of_forgotten_files("${tuples}")
  set(${variable} "${tuples}" PARENT_SCOPE)
endfunction()

# _rosidl_tell_of_forgotten_files(<tuples>): warn about definitions that CMakeLists.txt does not list.
function(_rosidl_tell_of_forgotten_files tuples)
  file(READ "${CMAKE_CURRENT_LIST_FILE}" text)
  if(text MATCHES "rosidl_interfaces_of_distribution")
    return()
  endif()
  file(GLOB found RELATIVE "${CMAKE_CURRENT_SOURCE_DIR}"
    "${CMAKE_CURRENT_SOURCE_DIR}/msg/*.msg"
    "${CMAKE_CURRENT_SOURCE_DIR}/srv/*.srv"
    "${CMAKE_CURRENT_SOURCE_DIR}/action/*.action")
  foreach(file IN LISTS found)
    get_filename_component(name "${file}" NAME)
    get_filename_component(stem "${file}" NAME_WE)
    string(FIND "${text}" "${stem}" place)
    string(FIND "${tuples}" "/${name}" listed)
    if(place EQUAL -1 AND listed EQUAL -1)
      message(WARNING
        "'${file}' is in the package and not in rosidl_generate_interfaces(): nobody can use its type")
    endif()
  endforeach()
endfunction()

# _rosidl_interface_packages(<variable> <package>...): the packages with interfaces, including dependencies.
function(_rosidl_interface_packages variable)
  set(packages "")
  foreach(package IN LISTS ARGN)
    foreach(candidate IN ITEMS ${package} ${${package}_RECURSIVE_DEPENDENCIES})
      if(DEFINED ${candidate}_IDL_FILES)
        list(APPEND packages "${candidate}")
      endif()
    endforeach()
  endforeach()
  list(REMOVE_DUPLICATES packages)
  set(${variable} "${packages}" PARENT_SCOPE)
endfunction()

# _rosidl_names(<variable> <tuple>...): each interface as NAMESPACE/NAME, with the namespace from the extension.
function(_rosidl_names variable)
  set(names "")
  foreach(tuple IN LISTS ARGN)
    if(tuple MATCHES ":[^:/]+/([^:/]+)\\.(msg|srv|action)$")
      list(APPEND names "${CMAKE_MATCH_2}/${CMAKE_MATCH_1}")
    elseif(tuple MATCHES ":([^:/]+)/([^:/]+)\\.idl$")
      list(APPEND names "${CMAKE_MATCH_1}/${CMAKE_MATCH_2}")
    endif()
  endforeach()
  set(${variable} "${names}" PARENT_SCOPE)
endfunction()

# _rosidl_idl_tuples(<variable> <output folder> <tuple>...): the paths of the .idl files.
function(_rosidl_idl_tuples variable output)
  _rosidl_names(names ${ARGN})
  list(TRANSFORM names PREPEND "${output}/idl/${PROJECT_NAME}:")
  list(TRANSFORM names APPEND ".idl")
  set(${variable} "${names}" PARENT_SCOPE)
endfunction()

# _rosidl_output_folder(<variable> <target>): the output folder of a target.
function(_rosidl_output_folder variable target)
  set(${variable} "${CMAKE_CURRENT_BINARY_DIR}/rosidl/${target}" PARENT_SCOPE)
endfunction()
