# Let installed programs without an RPATH find the libraries of this prefix.
if [ "$(uname -s)" = Darwin ]; then
  ament_prepend_unique_value DYLD_LIBRARY_PATH "$AMENT_CURRENT_PREFIX/lib"
else
  ament_prepend_unique_value LD_LIBRARY_PATH "$AMENT_CURRENT_PREFIX/lib"
fi
