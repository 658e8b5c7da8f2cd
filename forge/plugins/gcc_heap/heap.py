"""Sizes the heap of GCC by the memory of the machine."""

from __future__ import annotations

from pathlib import Path

from forge.toolchain.resources import Memory

SCRIPT = Path(__file__).parent / "templates/compile_cxx.sh"
CXX_LAUNCHER = "FORGE_CXX"
"""The variable with the prefix of C++ compiler command lines."""
HEAP_VARIABLE = "FORGE_GCC_HEAP"
"""The heap size in kB."""
_GCC_DEFAULT_HEAP = 128 << 20
_LARGEST_HEAP = 512 << 20
"""Larger heaps save no further time when compiling rclcpp."""
_HEAP_SHARE = 8
"""Since GCC allocates twice the size, all jobs together use at most a quarter of the memory."""


def heap_variables(memory: Memory | None, jobs: int) -> dict[str, str]:
    """Return the variables that make `jobs` C++ compilers share the memory; empty for GCC's default.

    GCC collects garbage for the first time when it has allocated twice `ggc-min-heapsize`, which is 128 MB on
    every machine with more than 1 GB. Sources that include rclcpp allocate 300 to 700 MB, and collecting
    takes 3 to 15 % of their compile time. The heap size does not change the compiled code.
    """
    size = min(_LARGEST_HEAP, memory.total // (_HEAP_SHARE * jobs)) if memory else 0
    script = str(SCRIPT)
    # The shell splits the value, and would expand patterns in it.
    if size <= _GCC_DEFAULT_HEAP or any(character in script for character in " \t\n*?["):
        return {}
    return {CXX_LAUNCHER: f"sh {script}", HEAP_VARIABLE: str(size >> 10)}
