# The state of a project, in global properties, and checks shared by all commands.

# _ament_remember(<what> <value>...): append to the project's list.
function(_ament_remember what)
  if(ARGN)
    set_property(GLOBAL APPEND PROPERTY "ament_${PROJECT_NAME}_${what}" ${ARGN})
  endif()
endfunction()

# _ament_recall(<variable> <what>): return the project's list, which may be empty.
function(_ament_recall variable what)
  get_property(values GLOBAL PROPERTY "ament_${PROJECT_NAME}_${what}")
  set(${variable} "${values}" PARENT_SCOPE)
endfunction()

# _ament_folder(<variable>): the install folder of this API.
function(_ament_folder variable)
  get_property(folder GLOBAL PROPERTY ament_cmake_folder)
  set(${variable} "${folder}" PARENT_SCOPE)
endfunction()

# _ament_refuse_unknown(<command> <unparsed>): fail if a command has unknown arguments.
function(_ament_refuse_unknown command)
  if(ARGN)
    string(REPLACE ";" "' '" words "${ARGN}")
    message(FATAL_ERROR "${command}() does not accept '${words}'")
  endif()
endfunction()

# _ament_refuse_after_package(<command>): fail if ament_package() was called before.
function(_ament_refuse_after_package command)
  if(_${PROJECT_NAME}_AMENT_PACKAGE)
    message(FATAL_ERROR
      "${command}() must be called before ament_package(), which writes down what the package exports")
  endif()
endfunction()

# _ament_write(<file> <text>): write the text if it differs from that of the file.
function(_ament_write file text)
  if(EXISTS "${file}")
    file(READ "${file}" current)
    if(current STREQUAL text)
      return()
    endif()
  endif()
  file(WRITE "${file}" "${text}")
endfunction()
