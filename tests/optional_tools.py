"""The test modules that know optional tools: `python -m tests.optional_tools` prints their paths.

Those are modules that name such a tool in a string, or import a module of tests that starts one. Unit tests
start no programs.
"""

import re
from pathlib import Path

from tests.conftest import REMEDIES

ON_BARE_MACHINES = frozenset({"bash", "cmake", "dash", "g++", "gcc", "make", "ninja"})
"""Tools that tests need and that no bare machine lacks: CMake and Ninja are wheels beside forge."""
HERE = Path(__file__).parent


def modules() -> list[Path]:
    """Return the test modules that know optional tools, outside of the unit tests."""
    tools = "|".join(re.escape(tool) for tool in sorted({*REMEDIES} - ON_BARE_MACHINES))
    starts = "browser|fastcdr|nginx|peers|rosidl"
    names = re.compile(
        rf"[\"'](?:\S*/)?(?:{tools})[\"' ]|^from tests(?:\.| import )(?:{starts})\b", re.MULTILINE
    )
    paths = sorted(
        path
        for folder in ("e2e", "integration", "plugins")
        for path in HERE.joinpath(folder).rglob("test_*.py")
    )
    return [
        path
        for path in paths
        # New users have bare machines.
        if path.name == "test_tutorial.py" or names.search(path.read_text(encoding="utf-8"))
    ]


if __name__ == "__main__":
    print(*(path.relative_to(HERE.parent) for path in modules()))
