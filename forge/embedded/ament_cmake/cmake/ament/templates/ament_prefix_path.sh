# Add this prefix to AMENT_PREFIX_PATH, so that tools find its resources.
ament_prepend_unique_value AMENT_PREFIX_PATH "$AMENT_CURRENT_PREFIX"
