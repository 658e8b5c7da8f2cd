# Let pkg-config find the .pc files of this prefix.
ament_prepend_unique_value PKG_CONFIG_PATH "$AMENT_CURRENT_PREFIX/lib/pkgconfig"
