# The build step that calls forge's interface compiler, and the targets for generated code.

# _rosidl_generate(<target> <tuples> <interface packages>): add the custom target and its command.
function(_rosidl_generate target tuples packages)
  _rosidl_output_folder(output "${target}")
  _rosidl_place_code("${target}")
  get_property(distribution GLOBAL PROPERTY rosidl_distribution)
  set(words
    --package ${PROJECT_NAME} --rosdistro ${distribution} --output "${output}" --no-runtime
    --stamp "${output}/stamp" --depfile "${output}/stamp.d")
  if(NOT DEFINED FORGE_INTERFACE_TARGETS)
    set(FORGE_INTERFACE_TARGETS python cpp c idl json)
  endif()
  foreach(language IN LISTS FORGE_INTERFACE_TARGETS)
    list(APPEND words --lang ${language})
  endforeach()
  foreach(package IN LISTS packages)
    get_filename_component(share "${${package}_DIR}/.." ABSOLUTE)
    list(APPEND words --include "${package}=${share}")
  endforeach()
  foreach(tuple IN LISTS tuples)
    list(APPEND words --file "${tuple}")
  endforeach()
  string(REPLACE ";" "\n" text "${words}")
  _rosidl_write("${output}/generate.args" "${text}\n")
  # A new version of forge may generate different code.
  _rosidl_write("${output}/forge_version" "${FORGE_VERSION}\n")

  _rosidl_forge_command(forge)
  _rosidl_known_inputs(inputs "${output}" "${tuples}" ${packages})
  set(track_inputs DEPENDS ${inputs})
  if(CMAKE_VERSION VERSION_GREATER_EQUAL 3.20)
    list(APPEND track_inputs DEPFILE "${output}/stamp.d")
  endif()
  _rosidl_headers(headers "${target}" ${tuples})
  _rosidl_service_command(cut_services byproducts "${output}" ${tuples})
  add_custom_command(
    OUTPUT "${output}/stamp"
    BYPRODUCTS ${headers} ${byproducts}  # otherwise Ninja may check them before they are written
    COMMAND ${forge} interface generate "@${output}/generate.args"
    ${cut_services}
    ${track_inputs}
    COMMENT "Generating the interfaces of ${PROJECT_NAME}"
    VERBATIM)
  add_custom_target(${target} ALL DEPENDS "${output}/stamp")
  foreach(part IN ITEMS cpp py)
    # Names for add_dependencies() in other packages; a command must not belong to several targets.
    add_custom_target(${target}__${part})
    add_dependencies(${target}__${part} ${target})
  endforeach()
endfunction()

# _rosidl_place_code(<target>)
#
# Some packages include generated code not through a target, but from the output folders of rosidl's generators:
# rosidl_generator_cpp and so on in the build folder. The code of the first target of a folder is written there,
# through symbolic links in the output folder of the compiler.
function(_rosidl_place_code target)
  set(is_first FALSE)
  get_property(first DIRECTORY PROPERTY rosidl_first_target)
  if(NOT first)
    set_property(DIRECTORY PROPERTY rosidl_first_target ${target})
    set(is_first TRUE)
  endif()
  _rosidl_output_folder(output ${target})
  set(has_links FALSE)
  if(IS_SYMLINK "${output}/cpp")
    set(has_links TRUE)
  endif()
  if(NOT has_links STREQUAL is_first)
    file(REMOVE_RECURSE "${output}")  # remove output of an older forge, or of another first target
  endif()
  if(is_first)
    file(MAKE_DIRECTORY "${output}")
    foreach(language IN ITEMS cpp c python)
      _rosidl_code_folder(folder ${target} ${language})
      file(MAKE_DIRECTORY "${folder}")
      file(CREATE_LINK "${folder}" "${output}/${language}" SYMBOLIC)
    endforeach()
  endif()
endfunction()

# _rosidl_code_folder(<variable> <target> <cpp, c or python>): the parent folder of the target's <project>/.
function(_rosidl_code_folder variable target language)
  get_property(first DIRECTORY PROPERTY rosidl_first_target)
  if(NOT first STREQUAL target)
    _rosidl_output_folder(output ${target})
    set(folder "${output}/${language}")
  elseif(language STREQUAL "python")
    set(folder "${CMAKE_CURRENT_BINARY_DIR}/rosidl_generator_py")
  else()
    set(folder "${CMAKE_CURRENT_BINARY_DIR}/rosidl_generator_${language}")
  endif()
  set(${variable} "${folder}" PARENT_SCOPE)
endfunction()

# _rosidl_add_targets(<target> <interface packages>)
#
# All targets are INTERFACE libraries, because everything is header-only. A target links the targets of the same
# kind of the dependencies. Targets of this project that link one are built after the generation.
function(_rosidl_add_targets target packages)
  foreach(kind IN ITEMS
      rosidl_generator_c rosidl_typesupport_introspection_c rosidl_typesupport_fastrtps_c rosidl_typesupport_c
      rosidl_generator_cpp rosidl_typesupport_introspection_cpp rosidl_typesupport_fastrtps_cpp
      rosidl_typesupport_cpp rosidl_generator_py)
    set(library ${target}__${kind})
    add_library(${library} INTERFACE)
    add_library(${PROJECT_NAME}::${library} ALIAS ${library})
    add_dependencies(${library} ${target})
    if(kind MATCHES "_(cpp|c)$")
      set(language ${CMAKE_MATCH_1})
      _rosidl_code_folder(code ${target} ${language})
      target_include_directories(${library} INTERFACE
        "$<BUILD_INTERFACE:${code}>" "$<INSTALL_INTERFACE:include/${PROJECT_NAME}>")
      foreach(package IN LISTS packages)
        target_link_libraries(${library} INTERFACE ${${package}_TARGETS__${kind}})
      endforeach()
      if(kind MATCHES "^rosidl_generator_")
        target_link_libraries(${library} INTERFACE rosidl_runtime_${language}::rosidl_runtime_${language})
      else()
        target_link_libraries(${library} INTERFACE ${target}__rosidl_generator_${language})
      endif()
    endif()
    if(kind MATCHES "_cpp$" AND CMAKE_VERSION VERSION_GREATER_EQUAL 3.22)
      # A property, because target_compile_features() fails if C++ is not enabled. Before CMake 3.22, the
      # property is an error if a C program links all exported targets.
      set_property(TARGET ${library} PROPERTY INTERFACE_COMPILE_FEATURES cxx_std_17)
    endif()
    set_property(GLOBAL APPEND PROPERTY rosidl_libraries_of_${target} ${library})
  endforeach()
  # All of them at once, unless the project may have a library of its own name.
  if(target STREQUAL PROJECT_NAME)
    get_property(libraries GLOBAL PROPERTY rosidl_libraries_of_${target})
    add_library(${PROJECT_NAME}::${PROJECT_NAME} INTERFACE IMPORTED GLOBAL)
    set_property(TARGET ${PROJECT_NAME}::${PROJECT_NAME} PROPERTY INTERFACE_LINK_LIBRARIES ${libraries})
  endif()
endfunction()

# _rosidl_forge_command(<variable>): the command of forge.
function(_rosidl_forge_command variable)
  if(FORGE_COMMAND)
    set(command "${FORGE_COMMAND}")
  elseif(NOT "$ENV{FORGE_COMMAND}" STREQUAL "")
    separate_arguments(command UNIX_COMMAND "$ENV{FORGE_COMMAND}")
  else()
    find_program(FORGE_EXECUTABLE NAMES forge DOC "The program that compiles interfaces")
    set(command "${FORGE_EXECUTABLE}")
    if(NOT command)
      message(FATAL_ERROR
        "'${PROJECT_NAME}' defines interfaces, and the program that compiles them was not found: "
        "put 'forge' on PATH (pip install ros-forge), or set FORGE_COMMAND")
    endif()
  endif()
  set(${variable} "${command}" PARENT_SCOPE)
endfunction()

# _rosidl_known_inputs(<variable> <output folder> <tuples> <package>...): the known inputs of the generation.
function(_rosidl_known_inputs variable output tuples)
  set(inputs "${output}/generate.args" "${output}/forge_version")
  foreach(tuple IN LISTS tuples)
    string(REGEX REPLACE ":([^:]+)$" "/\\1" file "${tuple}")
    list(APPEND inputs "${file}")
  endforeach()
  if(CMAKE_VERSION VERSION_LESS 3.20)
    # Older versions of CMake do not support depfiles: depend on all definitions of the dependencies.
    foreach(package IN LISTS ARGN)
      foreach(file IN LISTS ${package}_INTERFACE_FILES ${package}_IDL_FILES)
        get_filename_component(file "${${package}_DIR}/../${file}" ABSOLUTE)
        if(EXISTS "${file}")
          list(APPEND inputs "${file}")
        endif()
      endforeach()
    endforeach()
  endif()
  set(${variable} "${inputs}" PARENT_SCOPE)
endfunction()

# _rosidl_headers(<variable> <target> <tuple>...): the generated headers.
function(_rosidl_headers variable target)
  _rosidl_code_folder(in_cpp ${target} cpp)
  _rosidl_code_folder(in_c ${target} c)
  string(APPEND in_cpp "/${PROJECT_NAME}")
  string(APPEND in_c "/${PROJECT_NAME}")
  set(headers
    "${in_cpp}/msg/rosidl_generator_cpp__visibility_control.hpp"
    "${in_c}/msg/rosidl_generator_c__visibility_control.h")
  set(c_parts struct functions type_support)
  get_property(describes_types GLOBAL PROPERTY rosidl_describes_types)
  if(describes_types)
    list(APPEND c_parts description)
  endif()
  _rosidl_names(names ${ARGN})
  foreach(name IN LISTS names)
    get_filename_component(namespace "${name}" DIRECTORY)
    get_filename_component(stem "${name}" NAME)
    string_camel_case_to_lower_case_underscore("${stem}" stem)
    list(APPEND headers "${in_cpp}/${namespace}/${stem}.hpp" "${in_c}/${namespace}/${stem}.h")
    foreach(part IN ITEMS struct builder traits type_support cdr)
      list(APPEND headers "${in_cpp}/${namespace}/detail/${stem}__${part}.hpp")
    endforeach()
    foreach(part IN LISTS c_parts)
      list(APPEND headers "${in_c}/${namespace}/detail/${stem}__${part}.h")
    endforeach()
  endforeach()
  set(${variable} "${headers}" PARENT_SCOPE)
endfunction()

# _rosidl_service_command(<command variable> <byproducts variable> <output folder> <tuple>...)
#
# ROS tools list requests and responses of services as messages.
function(_rosidl_service_command command_variable byproducts_variable output)
  set(services "")
  set(byproducts "")
  foreach(tuple IN LISTS ARGN)
    if(tuple MATCHES "^(.*):([^:]+/([^:/]+))\\.srv$")
      list(APPEND services "${CMAKE_MATCH_1}/${CMAKE_MATCH_2}.srv")
      list(APPEND byproducts
        "${output}/halves/${CMAKE_MATCH_3}_Request.msg" "${output}/halves/${CMAKE_MATCH_3}_Response.msg")
    endif()
  endforeach()
  set(command "")
  if(services)
    get_property(folder GLOBAL PROPERTY rosidl_folder)
    string(REPLACE ";" "\n" services "${services}")
    _rosidl_write("${output}/services" "${services}\n")
    set(command COMMAND "${CMAKE_COMMAND}" "-DSERVICES=${output}/services" "-DOUTPUT=${output}/halves"
      -P "${folder}/cut_services.cmake" DEPENDS "${output}/services")
  endif()
  set(${command_variable} "${command}" PARENT_SCOPE)
  set(${byproducts_variable} "${byproducts}" PARENT_SCOPE)
endfunction()

# _rosidl_write(<file> <text>): write the text if it differs from that of the file.
function(_rosidl_write file text)
  if(EXISTS "${file}")
    file(READ "${file}" current)
    if(current STREQUAL text)
      return()
    endif()
  endif()
  file(WRITE "${file}" "${text}")
endfunction()
