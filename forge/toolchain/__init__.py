"""The programs and the machine that a build uses: CMake, compilers, Python, processors and memory.

May import the packages above it in docs/explanation/architecture.md, up to `workspace`.
"""

__all__ = [
    "cmake_variables",
    "compiler_launchers",
    "interpreter",
    "programs",
    "python_modules",
    "resources",
    "targets",
]
