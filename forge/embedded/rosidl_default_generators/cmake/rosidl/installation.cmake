# Installation and exports of interface packages.

# _rosidl_install(<target> <tuples>): install code, definitions and targets.
function(_rosidl_install target tuples)
  _rosidl_output_folder(output "${target}")
  foreach(language IN ITEMS cpp c)
    _rosidl_code_folder(code ${target} ${language})
    install(DIRECTORY "${code}/${PROJECT_NAME}/"
      DESTINATION "include/${PROJECT_NAME}/${PROJECT_NAME}")
  endforeach()
  foreach(language IN ITEMS idl json)
    install(DIRECTORY "${output}/${language}/${PROJECT_NAME}/" DESTINATION "share/${PROJECT_NAME}")
  endforeach()
  foreach(tuple IN LISTS tuples)
    if(tuple MATCHES "^(.*):([^:/]+)/([^:/]+)$")
      install(FILES "${CMAKE_MATCH_1}/${CMAKE_MATCH_2}/${CMAKE_MATCH_3}"
        DESTINATION "share/${PROJECT_NAME}/${CMAKE_MATCH_2}")
    endif()
  endforeach()
  if(tuples MATCHES "\\.srv(;|$)")
    install(DIRECTORY "${output}/halves/" DESTINATION "share/${PROJECT_NAME}/srv")
  endif()
  _rosidl_install_python("${target}")

  get_property(libraries GLOBAL PROPERTY rosidl_libraries_of_${target})
  install(TARGETS ${libraries} EXPORT export_${target}__rosidl)
endfunction()

# _rosidl_install_python(<target>): install the generated Python package with its metadata.
function(_rosidl_install_python target)
  _rosidl_output_folder(output "${target}")
  _rosidl_code_folder(code "${target}" python)
  if(COMMAND _ament_claim_python_name)
    _ament_claim_python_name("${PROJECT_NAME}")
  endif()
  install(DIRECTORY "${code}/${PROJECT_NAME}/" DESTINATION "${PYTHON_INSTALL_DIR}/${PROJECT_NAME}"
    PATTERN "__pycache__" EXCLUDE)

  set(version "${${PROJECT_NAME}_VERSION}")
  set(info "${PROJECT_NAME}-${version}-py${Python3_VERSION_MAJOR}.${Python3_VERSION_MINOR}.egg-info")
  _rosidl_write("${output}/${info}/PKG-INFO"
    "Metadata-Version: 2.1\nName: ${PROJECT_NAME}\nVersion: ${version}\n")
  _rosidl_write("${output}/${info}/top_level.txt" "${PROJECT_NAME}\n")
  _rosidl_write("${output}/${info}/dependency_links.txt" "\n")
  _rosidl_write("${output}/${info}/SOURCES.txt" "")
  install(DIRECTORY "${output}/${info}" DESTINATION "${PYTHON_INSTALL_DIR}")
endfunction()

# _rosidl_describe(<target> <tuples>)
#
# Export the package. A macro, because ament may store state in variables of the caller.
macro(_rosidl_describe target tuples)
  ament_export_targets("export_${target}__rosidl")
  ament_export_include_directories("include/${PROJECT_NAME}")
  ament_environment_hooks("${ament_cmake_package_templates_ENVIRONMENT_HOOK_PYTHONPATH}")
  _rosidl_list_files(_rosidl_idl_files _rosidl_interface_files _rosidl_all_files "${tuples}")
  ament_index_register_resource(rosidl_interfaces CONTENT "${_rosidl_all_files}")
  _rosidl_write_extras("${target}" "${_rosidl_idl_files}" "${_rosidl_interface_files}")
  list(APPEND ${PROJECT_NAME}_CONFIG_EXTRAS "${CMAKE_CURRENT_BINARY_DIR}/rosidl/rosidl_interfaces-extras.cmake.in")
  list(REMOVE_DUPLICATES ${PROJECT_NAME}_CONFIG_EXTRAS)
endmacro()

# _rosidl_list_files(<idl variable> <interface variable> <all variable> <tuples>)
#
# Files relative to the share folder: .idl files, original files, and the lines of the index entry.
function(_rosidl_list_files idl_variable interface_variable all_variable tuples)
  _rosidl_names(names ${tuples})
  set(idl "${names}")
  list(TRANSFORM idl APPEND ".idl")
  set(interface "")
  set(halves "")
  foreach(tuple IN LISTS tuples)
    if(tuple MATCHES ":([^:]+)\\.(msg|srv|action)$")
      list(APPEND interface "${CMAKE_MATCH_1}.${CMAKE_MATCH_2}")
      if(CMAKE_MATCH_2 STREQUAL "srv")
        get_filename_component(name "${CMAKE_MATCH_1}" NAME)
        list(APPEND halves "srv/${name}_Request.msg" "srv/${name}_Response.msg")
      endif()
    endif()
  endforeach()
  set(all ${idl} ${interface} ${halves})
  list(SORT all)
  string(REPLACE ";" "\n" all "${all}")
  set(${idl_variable} "${idl}" PARENT_SCOPE)
  set(${interface_variable} "${interface}" PARENT_SCOPE)
  set(${all_variable} "${all}" PARENT_SCOPE)
endfunction()

# _rosidl_write_extras(<target> <idl files> <interface files>): write the extra file that ament_package() configures.
function(_rosidl_write_extras target idl_files interface_files)
  get_property(libraries GLOBAL PROPERTY rosidl_libraries_of_${target})
  set(lines "")
  foreach(library IN LISTS libraries)
    string(REGEX REPLACE "^.*__(rosidl_.*)$" "\\1" kind "${library}")
    string(APPEND lines "list(APPEND ${PROJECT_NAME}_TARGETS__${kind} ${PROJECT_NAME}::${library})\n")
  endforeach()
  if(target STREQUAL PROJECT_NAME)
    list(TRANSFORM libraries PREPEND "${PROJECT_NAME}::")
    string(APPEND lines
      "if(NOT TARGET ${PROJECT_NAME}::${PROJECT_NAME})\n"
      "  add_library(${PROJECT_NAME}::${PROJECT_NAME} INTERFACE IMPORTED)\n"
      "  set_property(TARGET ${PROJECT_NAME}::${PROJECT_NAME} PROPERTY INTERFACE_LINK_LIBRARIES\n"
      "    \"${libraries}\")\n"
      "endif()\n")
  endif()
  string(REPLACE ";" "\n  " idl_files "${idl_files}")
  string(REPLACE ";" "\n  " interface_files "${interface_files}")
  set(more "@rosidl_typesupport_EXPORTS@")  # from rosidl_export_typesupport_*(), called later
  get_property(folder GLOBAL PROPERTY rosidl_folder)
  configure_file("${folder}/templates/rosidl_interfaces-extras.cmake.in"
    "${CMAKE_CURRENT_BINARY_DIR}/rosidl/rosidl_interfaces-extras.cmake.in" @ONLY)
endfunction()
