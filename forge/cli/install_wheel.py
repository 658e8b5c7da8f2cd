"""`python -m forge.cli.install_wheel SOURCE ...`: build the wheel of a Python package and install it."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from forge.base.errors import ForgeError, print_problem, print_warnings, problems_of
from forge.base.files import naming
from forge.build.wheels.install_wheel import WheelInstall, install_wheel
from forge.cli.options import add_options, read_options


def main(argv: Sequence[str] | None = None) -> int:
    """Install one package; returns 0, or 2 after printing problems."""
    parser = argparse.ArgumentParser(prog="python -m forge.cli.install_wheel", description=__doc__)
    add_options(parser, WheelInstall)
    try:
        options = read_options(WheelInstall, parser.parse_args(argv))
        with naming(options.build):
            print_warnings(install_wheel(options))
    except (ForgeError, OSError) as error:
        for problem in problems_of(error):
            print_problem(problem)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
