"""Lets GCC allocate more memory before it collects garbage, if there is enough.

GCC collects garbage for the first time when it has allocated twice `ggc-min-heapsize`, which is 128 MB on
every machine with more than 1 GB. Sources that include rclcpp allocate 300 to 700 MB, and collecting takes 3
to 15 % of the time in which they compile. What is compiled does not depend on it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.layout import templates_folder

if TYPE_CHECKING:
    from forge.toolchain.resources import Memory

CXX_LAUNCHER = "FORGE_CXX"
"""What precedes the command lines of C++ compilers, in the environment of builds."""
HEAP_VARIABLE = "FORGE_GCC_HEAP"
"""The heap size in kB."""
LIBRARY_PATH_BELOW = "FORGE_LIBRARY_PATH_BELOW"
"""What LD_LIBRARY_PATH is without the packages of the workspace."""

_DEFAULT = 128 << 20
_LARGEST = 512 << 20
"""With more than that, the compilers of rclcpp save no more time."""
_SHARE = 8
"""Since GCC allocates twice the size, all jobs together take a quarter of the memory at most."""


def gcc_heap(memory: Memory | None, jobs: int) -> dict[str, str]:
    """Return the variables by which `jobs` C++ compilers share the memory; empty for GCC's default."""
    size = min(_LARGEST, memory.total // (_SHARE * jobs)) if memory else 0
    script = str(templates_folder() / "cmake/compile_cxx.sh")
    # The shell splits the value, and would expand patterns in it.
    if size <= _DEFAULT or any(character in script for character in " \t\n*?["):
        return {}
    return {CXX_LAUNCHER: f"sh {script}", HEAP_VARIABLE: str(size >> 10)}
