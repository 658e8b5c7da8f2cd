# The targets 'uninstall' and '<project>_uninstall': remove the files of the last installation.

macro(_ament_settle_uninstall)
  if(AMENT_CMAKE_UNINSTALL_TARGET)
    _ament_add_uninstall_target(uninstall)
    _ament_add_uninstall_target(${PROJECT_NAME}_uninstall)
  endif()
endmacro()

function(_ament_add_uninstall_target name)
  if(TARGET ${name})
    return()
  endif()
  _ament_folder(folder)
  add_custom_target(${name} VERBATIM COMMAND "${CMAKE_COMMAND}"
    "-DMANIFEST=${CMAKE_BINARY_DIR}/install_manifest.txt"
    "-DPREFIX=${CMAKE_INSTALL_PREFIX}"
    "-DMORE=${CMAKE_BINARY_DIR}/ament_cmake_uninstall.cmake"
    -P "${folder}/run_uninstall.cmake")
endfunction()

# ament_cmake_uninstall_target_append_uninstall_code(<code>... [COMMENTS <text>]): run additional code.
function(ament_cmake_uninstall_target_append_uninstall_code)
  cmake_parse_arguments(ARG "" "COMMENTS" "" ${ARGN})
  set(file "${CMAKE_BINARY_DIR}/ament_cmake_uninstall.cmake")
  get_property(is_started GLOBAL PROPERTY ament_cmake_uninstall_is_started)
  if(NOT is_started)
    file(WRITE "${file}" "# More to do when the package is uninstalled.\n")
    set_property(GLOBAL PROPERTY ament_cmake_uninstall_is_started TRUE)
  endif()
  if(ARG_COMMENTS)
    file(APPEND "${file}" "\n# ${ARG_COMMENTS}\n")
  endif()
  foreach(line IN LISTS ARG_UNPARSED_ARGUMENTS)
    file(APPEND "${file}" "${line}\n")
  endforeach()
endfunction()
