"""Runs linters in the tests of Python packages, which import them as ament_flake8.main, ament_mypy.main etc.

A linter that is not installed skips the test that calls it.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib.machinery import PathFinder
from pathlib import Path
from typing import TYPE_CHECKING
from unittest import SkipTest

from ament_lint_stand_ins.run_linter import LINTERS, complaints_of, parse

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

# Programs that are not named like the tool.
PROGRAMS = {"clang_format": "clang-format", "lint_cmake": "cmakelint", "pep257": "pydocstyle"}


def real_locations(name: str) -> list[str]:
    """Return the folders of ROS's own package of this name, which takes precedence."""
    own = Path(__file__).parents[1].resolve()
    others = [entry for entry in sys.path if Path(entry).resolve() != own]
    spec = PathFinder.find_spec(name, others)
    return [*(spec.submodule_search_locations or ())] if spec else []


def functions(tool: str) -> tuple[Callable[..., int], Callable[..., tuple[int, list[str]]]]:
    """Return the functions main() and main_with_errors() of a linter."""

    def main_with_errors(argv: Sequence[str] | None = None) -> tuple[int, list[str]]:
        """Run the linter on the files and folders of `argv`; return the exit code and the complaints."""
        return _run(tool, sys.argv[1:] if argv is None else [*argv])

    def main(argv: Sequence[str] | None = None) -> int:
        """Like main_with_errors, but return only the exit code."""
        return main_with_errors(argv)[0]

    return main, main_with_errors


def _run(tool: str, words: list[str]) -> tuple[int, list[str]]:
    path = os.pathsep.join((os.environ.get("PATH", os.defpath), str(Path(sys.executable).parent)))
    if program := shutil.which(f"ament_{tool}", path=path):
        return subprocess.run([program, *words], check=False).returncode, []
    name = PROGRAMS.get(tool, tool if tool in LINTERS else f"ament_{tool}")
    program = shutil.which(name, path=path)
    if program is None or tool not in LINTERS:
        raise SkipTest(f"{name} is not installed")
    complaints = complaints_of(parse([tool, program, *words], folders_first=True))
    return int(bool(complaints)), [line for text in complaints.values() for line in text.splitlines()]
