"""`--target`: builds for other platforms, with zig or with the compilers of a CMake toolchain file.

Needs the extra `cross` unless a toolchain file names other compilers. No other command imports it.
"""
