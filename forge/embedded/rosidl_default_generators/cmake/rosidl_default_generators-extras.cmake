include("${rosidl_default_generators_DIR}/rosidl/main.cmake")
