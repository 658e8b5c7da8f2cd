"""Install only the files of a CMake package that have changed since the last build."""
