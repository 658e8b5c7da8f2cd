"""The C99 target: headers with the paths and names of rosidl_generator_c."""
