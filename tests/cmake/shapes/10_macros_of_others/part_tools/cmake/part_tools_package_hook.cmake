# Inside ament_package(): what part_tools_register() calls have collected in the caller's scope.
list(REMOVE_DUPLICATES _PART_TOOLS_RESOURCE_INDICES)
foreach(index ${_PART_TOOLS_RESOURCE_INDICES})
  ament_index_register_resource(${index} CONTENT "${_PART_TOOLS_${index}__PARTS}")
endforeach()
