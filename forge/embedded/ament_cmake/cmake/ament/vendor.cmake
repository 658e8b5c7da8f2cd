# ament_vendor(): build a third-party CMake project if it is not installed.

find_package(ament_cmake QUIET REQUIRED)

include_guard(GLOBAL)
cmake_policy(PUSH)
cmake_policy(VERSION 3.18)

# ament_vendor(<name> VCS_URL <url> [VCS_TYPE git|tar|zip|svn|path] [VCS_VERSION <version>] [SATISFIED <bool>]
#              [PATCHES <file or folder>...] [CMAKE_ARGS <argument>...] [SOURCE_SUBDIR <folder>] [SKIP_INSTALL]
#              [GLOBAL_HOOK])
#
# Build the project and install it to opt/<package>, where users of the package find it. If SATISFIED is true,
# do nothing unless FORCE_BUILD_VENDOR_PKG is on.
macro(ament_vendor name)
  cmake_parse_arguments(_ament_vendor "SKIP_INSTALL;GLOBAL_HOOK"
    "VCS_URL;VCS_TYPE;VCS_VERSION;SATISFIED;SOURCE_SUBDIR" "PATCHES;CMAKE_ARGS" ${ARGN})
  _ament_refuse_after_package(ament_vendor)
  _ament_refuse_unknown(ament_vendor ${_ament_vendor_UNPARSED_ARGUMENTS})
  option(FORCE_BUILD_VENDOR_PKG "Build vendored projects even where the machine has them" OFF)
  _ament_vendor_check(${name})
  if(_ament_vendor_SATISFIED AND NOT FORCE_BUILD_VENDOR_PKG)
    message(STATUS "'${name}' is already installed and is not built")
  else()
    _ament_vendor_build(${name})
    if(NOT _ament_vendor_SKIP_INSTALL)
      _ament_vendor_export()
    endif()
  endif()
endmacro()

# _ament_vendor_check(<name>): fail if options are contradictory.
function(_ament_vendor_check name)
  if(NOT _ament_vendor_VCS_URL)
    message(FATAL_ERROR "ament_vendor() needs the VCS_URL of '${name}'")
  endif()
  if(_ament_vendor_VCS_TYPE STREQUAL "path" AND (_ament_vendor_PATCHES OR _ament_vendor_SOURCE_SUBDIR))
    message(FATAL_ERROR "ament_vendor() takes neither PATCHES nor SOURCE_SUBDIR with VCS_TYPE path")
  endif()
  if(_ament_vendor_GLOBAL_HOOK AND _ament_vendor_SKIP_INSTALL)
    message(FATAL_ERROR "ament_vendor() takes either GLOBAL_HOOK or SKIP_INSTALL")
  endif()
endfunction()

# _ament_vendor_build(<name>): fetch, build and stage the project with ExternalProject.
function(_ament_vendor_build name)
  include(ExternalProject)
  set(stage "${CMAKE_CURRENT_BINARY_DIR}/${name}-prefix/install")
  if(NOT _ament_vendor_VCS_TYPE OR _ament_vendor_VCS_TYPE STREQUAL "git")
    set(source GIT_REPOSITORY "${_ament_vendor_VCS_URL}" GIT_TAG "${_ament_vendor_VCS_VERSION}")
  elseif(_ament_vendor_VCS_TYPE STREQUAL "svn")
    set(source SVN_REPOSITORY "${_ament_vendor_VCS_URL}" SVN_REVISION "${_ament_vendor_VCS_VERSION}")
  elseif(_ament_vendor_VCS_TYPE STREQUAL "path")
    set(source SOURCE_DIR "${_ament_vendor_VCS_URL}")
  else()
    set(source URL "${_ament_vendor_VCS_URL}")
  endif()
  _ament_vendor_patch_command(patch)
  set(arguments "-DCMAKE_INSTALL_PREFIX=${stage}" -DBUILD_TESTING=OFF -DBUILD_SHARED_LIBS=ON)
  foreach(variable IN ITEMS
      CMAKE_BUILD_TYPE CMAKE_TOOLCHAIN_FILE CMAKE_C_FLAGS CMAKE_CXX_FLAGS CMAKE_POLICY_VERSION_MINIMUM)
    if(NOT "${${variable}}" STREQUAL "")
      list(APPEND arguments "-D${variable}=${${variable}}")
    endif()
  endforeach()
  get_property(earlier GLOBAL PROPERTY ament_${PROJECT_NAME}_vendored)
  string(REPLACE ";" "|" paths "${earlier};${CMAKE_PREFIX_PATH}")
  list(APPEND arguments "-DCMAKE_PREFIX_PATH=${paths}")
  if(_ament_vendor_SOURCE_SUBDIR)
    list(APPEND source SOURCE_SUBDIR "${_ament_vendor_SOURCE_SUBDIR}")
  endif()
  externalproject_add(${name} ${source} ${patch} LIST_SEPARATOR "|"
    CMAKE_ARGS ${arguments} ${_ament_vendor_CMAKE_ARGS})
  set_property(GLOBAL APPEND PROPERTY ament_${PROJECT_NAME}_vendored "${stage}")
  if(NOT _ament_vendor_SKIP_INSTALL)
    install(DIRECTORY "${stage}/" DESTINATION "opt/${PROJECT_NAME}" USE_SOURCE_PERMISSIONS)
  endif()
endfunction()

# _ament_vendor_patch_command(<variable>): the PATCH_COMMAND for all patches, including those in folders.
function(_ament_vendor_patch_command variable)
  set(command "")
  foreach(patch IN LISTS _ament_vendor_PATCHES)
    get_filename_component(patch "${patch}" ABSOLUTE BASE_DIR "${CMAKE_CURRENT_LIST_DIR}")
    set(files "${patch}")
    if(IS_DIRECTORY "${patch}")
      file(GLOB files "${patch}/*.diff" "${patch}/*.patch")
    endif()
    foreach(file IN LISTS files)
      if(command)
        list(APPEND command COMMAND)
      else()
        set(command PATCH_COMMAND)
      endif()
      list(APPEND command patch -p1 -N -i "${file}")
    endforeach()
  endforeach()
  set(${variable} "${command}" PARENT_SCOPE)
endfunction()

# _ament_vendor_export(): let users of the package find the vendored project.
macro(_ament_vendor_export)
  get_property(_ament_vendor_is_exported GLOBAL PROPERTY ament_${PROJECT_NAME}_vendor_is_exported)
  if(NOT _ament_vendor_is_exported)
    set_property(GLOBAL PROPERTY ament_${PROJECT_NAME}_vendor_is_exported TRUE)
    _ament_folder(_ament_templates)
    ament_index_register_resource(vendor_packages CONTENT "opt/${PROJECT_NAME}")
    set(AMENT_CMAKE_ENVIRONMENT_HOOKS_DESC_vendor_path
      "prepend-non-duplicate-if-exists;PATH;opt/${PROJECT_NAME}/bin")
    set(AMENT_CMAKE_ENVIRONMENT_HOOKS_DESC_vendor_library_path
      "prepend-non-duplicate;LD_LIBRARY_PATH;opt/${PROJECT_NAME}/lib")
    ament_environment_hooks("${_ament_templates}/templates/vendor_path.sh.in"
      "${_ament_templates}/templates/vendor_library_path.sh.in")
    if(_ament_vendor_GLOBAL_HOOK)
      set(AMENT_CMAKE_ENVIRONMENT_HOOKS_DESC_vendor_prefix
        "prepend-non-duplicate;CMAKE_PREFIX_PATH;opt/${PROJECT_NAME}")
      ament_environment_hooks("${_ament_templates}/templates/vendor_prefix.sh.in")
    else()
      # An early extra: it is included before the dependencies of the package are found.
      list(APPEND ${PROJECT_NAME}_CONFIG_EXTRAS "${_ament_templates}/templates/vendor_prefix.cmake.in")
    endif()
    unset(_ament_templates)
  endif()
endmacro()

cmake_policy(POP)
