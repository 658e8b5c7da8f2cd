# Included when one of the replaced packages is found: the API, and the optional part of that name.

include("${CMAKE_CURRENT_LIST_DIR}/main.cmake")
set(${CMAKE_FIND_PACKAGE_NAME}_FOUND_AMENT_PACKAGE TRUE)
if(CMAKE_FIND_PACKAGE_NAME MATCHES "^ament_cmake_(gtest|gmock|google_benchmark)$")
  include("${CMAKE_CURRENT_LIST_DIR}/gtest.cmake")
elseif(CMAKE_FIND_PACKAGE_NAME STREQUAL "ament_cmake_auto")
  include("${CMAKE_CURRENT_LIST_DIR}/auto.cmake")
elseif(CMAKE_FIND_PACKAGE_NAME MATCHES "^ament_cmake_ros(_core)?$")
  include("${CMAKE_CURRENT_LIST_DIR}/ros.cmake")
elseif(CMAKE_FIND_PACKAGE_NAME STREQUAL "ament_cmake_vendor_package")
  include("${CMAKE_CURRENT_LIST_DIR}/vendor.cmake")
endif()
