# Runs in ament_package(), after the package has configured its linters.
if(BUILD_TESTING)
  ament_execute_extensions(ament_lint_auto EXCLUDE ${AMENT_LINT_AUTO_EXCLUDE})
endif()
