"""Building for another platform: its name, its compilers, and the CMake toolchain file that describes them.

Imported only by commands with '--target'.
"""
