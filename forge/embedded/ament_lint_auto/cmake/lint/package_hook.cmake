# Inside ament_package(): only now does the package have said everything about its linters.
if(BUILD_TESTING)
  ament_execute_extensions(ament_lint_auto EXCLUDE ${AMENT_LINT_AUTO_EXCLUDE})
endif()
