# Finding 'ament_cmake' defines the whole API but the leaves: gtest, auto, ros and vendor are found by name.
include("${ament_cmake_DIR}/ament/main.cmake")
