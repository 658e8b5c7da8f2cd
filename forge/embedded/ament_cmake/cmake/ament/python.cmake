# Python packages and modules that a CMake project installs.

# ament_python_install_package(<name> [PACKAGE_DIR <folder>] [VERSION <version>] [SETUP_CFG <file>]
#                              [DESTINATION <folder>] [SCRIPTS_DESTINATION <folder>] [SKIP_COMPILE])
#
# Install a Python package from the folder of the calling file, with metadata, and byte-compile it. Console
# scripts of setup.cfg are installed if a destination is given.
macro(ament_python_install_package)
  _ament_python_install_package(${ARGN})
endmacro()

# ament_python_install_module(<file> [DESTINATION_SUFFIX <folder>] [SKIP_COMPILE])
macro(ament_python_install_module)
  _ament_python_install_module(${ARGN})
endmacro()

function(_ament_python_install_package name)
  cmake_parse_arguments(ARG "SKIP_COMPILE" "PACKAGE_DIR;VERSION;SETUP_CFG;DESTINATION;SCRIPTS_DESTINATION" "" ${ARGN})
  _ament_refuse_unknown(ament_python_install_package ${ARG_UNPARSED_ARGUMENTS})
  if(NOT ARG_PACKAGE_DIR)
    set(ARG_PACKAGE_DIR "${CMAKE_CURRENT_LIST_DIR}/${name}")
  endif()
  get_filename_component(ARG_PACKAGE_DIR "${ARG_PACKAGE_DIR}" ABSOLUTE)
  if(NOT EXISTS "${ARG_PACKAGE_DIR}/__init__.py")
    message(FATAL_ERROR "ament_python_install_package(): '${ARG_PACKAGE_DIR}' contains no __init__.py")
  endif()
  if(NOT ARG_VERSION)
    if(NOT _AMENT_PACKAGE_NAME)
      ament_package_xml()
    endif()
    set(ARG_VERSION "${${PROJECT_NAME}_VERSION}")
  endif()
  if(NOT ARG_SETUP_CFG AND EXISTS "${CMAKE_CURRENT_LIST_DIR}/setup.cfg")
    set(ARG_SETUP_CFG "${CMAKE_CURRENT_LIST_DIR}/setup.cfg")
  endif()
  if(NOT ARG_DESTINATION)
    set(ARG_DESTINATION "${PYTHON_INSTALL_DIR}")
  endif()

  _ament_claim_python_name("${name}")
  install(DIRECTORY "${ARG_PACKAGE_DIR}/" DESTINATION "${ARG_DESTINATION}/${name}"
    PATTERN "__pycache__" EXCLUDE PATTERN "*.pyc" EXCLUDE)
  _ament_install_python_metadata("${name}" "${ARG_VERSION}" "${ARG_DESTINATION}" "${ARG_SETUP_CFG}"
    "${ARG_SCRIPTS_DESTINATION}")
  if(NOT ARG_SKIP_COMPILE)
    _ament_compile_python("${ARG_DESTINATION}/${name}")
  endif()
  _ament_announce_python("${ARG_DESTINATION}")
endfunction()

function(_ament_python_install_module file)
  cmake_parse_arguments(ARG "SKIP_COMPILE" "DESTINATION_SUFFIX" "" ${ARGN})
  _ament_refuse_unknown(ament_python_install_module ${ARG_UNPARSED_ARGUMENTS})
  get_filename_component(file "${file}" ABSOLUTE BASE_DIR "${CMAKE_CURRENT_LIST_DIR}")
  if(NOT EXISTS "${file}")
    message(FATAL_ERROR "ament_python_install_module() was given '${file}', which does not exist")
  endif()
  set(destination "${PYTHON_INSTALL_DIR}")
  if(ARG_DESTINATION_SUFFIX)
    string(APPEND destination "/${ARG_DESTINATION_SUFFIX}")
  endif()
  get_filename_component(name "${file}" NAME)
  _ament_claim_python_name("${destination}/${name}")
  install(FILES "${file}" DESTINATION "${destination}")
  if(NOT ARG_SKIP_COMPILE)
    _ament_compile_python("${destination}/${name}")
  endif()
  _ament_announce_python("${PYTHON_INSTALL_DIR}")
endfunction()

# _ament_claim_python_name(<name>): fail if the project already installs this Python package or module.
function(_ament_claim_python_name name)
  _ament_recall(names python_names)
  if(name IN_LIST names)
    message(FATAL_ERROR
      "'${PROJECT_NAME}' installs the Python package '${name}' twice; "
      "generated interfaces count as a Python package with the project's name")
  endif()
  _ament_remember(python_names "${name}")
endfunction()

# _ament_announce_python(<folder>): add the hook that sets PYTHONPATH.
function(_ament_announce_python folder)
  if(folder STREQUAL PYTHON_INSTALL_DIR)
    ament_environment_hooks("${ament_cmake_package_templates_ENVIRONMENT_HOOK_PYTHONPATH}")
  endif()
endfunction()

# _ament_compile_python(<path>): byte-compile the installed files; errors are ignored.
function(_ament_compile_python path)
  set(AMENT_COMPILED_PATH "${path}")
  string(CONFIGURE [[
    # A symlink install would write the cache into the source folder.
    if(NOT "$ENV{CMAKE_INSTALL_MODE}" MATCHES "SYMLINK")
      set(_ament_path "@AMENT_COMPILED_PATH@")
      if(NOT IS_ABSOLUTE "${_ament_path}")
        set(_ament_path "${CMAKE_INSTALL_PREFIX}/${_ament_path}")
      endif()
      execute_process(COMMAND "@Python3_EXECUTABLE@" -S -m compileall -q "$ENV{DESTDIR}${_ament_path}")
    endif()]] code @ONLY)
  install(CODE "${code}")
endfunction()

# _ament_install_python_metadata(<name> <version> <destination> <setup.cfg> <scripts destination>)
function(_ament_install_python_metadata name version destination setup_cfg scripts)
  set(info "${name}-${version}-py${Python3_VERSION_MAJOR}.${Python3_VERSION_MINOR}.egg-info")
  set(folder "${CMAKE_CURRENT_BINARY_DIR}/ament_cmake_python/${name}")
  _ament_write("${folder}/${info}/PKG-INFO" "Metadata-Version: 2.1\nName: ${name}\nVersion: ${version}\n")
  _ament_write("${folder}/${info}/top_level.txt" "${name}\n")
  _ament_write("${folder}/${info}/dependency_links.txt" "\n")
  if(setup_cfg)
    _ament_folder(ament)
    stamp("${setup_cfg}")
    file(REMOVE_RECURSE "${folder}/scripts")
    execute_process(
      COMMAND "${Python3_EXECUTABLE}" -S -E "${ament}/entry_points.py" "${setup_cfg}" "${folder}/${info}"
        "${folder}/scripts"
      RESULT_VARIABLE code ERROR_VARIABLE problem)
    if(NOT code EQUAL 0)
      message(FATAL_ERROR "${problem}")
    endif()
  endif()
  install(DIRECTORY "${folder}/${info}" DESTINATION "${destination}")
  file(GLOB programs "${folder}/scripts/*")
  if(scripts AND programs)
    install(PROGRAMS ${programs} DESTINATION "${scripts}")
  endif()
endfunction()
