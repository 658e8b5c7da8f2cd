# 'ament_cmake' defines the whole API except for gtest, auto, ros and vendor, which are found by name.
include("${ament_cmake_DIR}/ament/main.cmake")
