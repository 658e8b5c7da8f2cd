include("${house_rules_DIR}/house_rules.cmake")
