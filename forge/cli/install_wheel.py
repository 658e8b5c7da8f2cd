"""`python -m forge.cli.install_wheel SOURCE ...`: build the wheel of a Python package and install it."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import ForgeError, Problem, problem_from_oserror
from forge.base.files import naming
from forge.build.wheels.install_wheel import WheelInstall, install_wheel

if TYPE_CHECKING:
    from collections.abc import Sequence


def main(argv: Sequence[str] | None = None) -> int:
    """Install one package; returns 0, or 2 after printing problems."""
    try:
        options = WheelInstall(**vars(_parser().parse_args(argv)))
        with naming(options.build):
            warnings = install_wheel(options)
    except ForgeError as error:
        problems: tuple[Problem, ...] = error.problems
    except OSError as error:
        problem = problem_from_oserror(error)
        if problem is None:
            raise
        problems = (problem,)
    else:
        for problem in warnings:
            print(problem.render("warning"), file=sys.stderr)
        return 0
    for problem in problems:
        print(problem.render(), file=sys.stderr)
    return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m forge.cli.install_wheel", description=__doc__)
    parser.add_argument("source", type=Path, metavar="SOURCE", help="folder of the package")
    parser.add_argument("--package", required=True, help="name of the package")
    parser.add_argument(
        "--build", required=True, type=Path, metavar="DIR", help="build folder of the package"
    )
    parser.add_argument("--prefix", required=True, type=Path, metavar="DIR", help="prefix to install into")
    parser.add_argument("--python", required=True, metavar="PATH", help="interpreter to build with and for")
    parser.add_argument(
        "--site-packages", required=True, metavar="DIR", help="site-packages folder, relative to the prefix"
    )
    parser.add_argument(
        "--scripts",
        metavar="DIR",
        help="folder for scripts of packages without setup.py, relative to the prefix (default: lib/PACKAGE)",
    )
    parser.add_argument("--target", default="", metavar="TARGET", help="platform, if it is not this machine")
    parser.add_argument("--link", action="store_true", help="install symbolic links instead of copies")
    return parser


if __name__ == "__main__":
    sys.exit(main())
