"""`python -m tests.upstream`: count the tests of workspaces that contain upstream's suites.

A workspace is one that was built with `forge build --rosdistro NAME` and tested with `forge test`; each
suite is a package of its own name. `python -m tests.upstream.page` makes the page of what this writes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from tests.upstream.figures import as_text, by_distribution, read, with_counts
from tests.upstream.results import count_tests, missed_tests
from tests.upstream.suites import SUITES


def main(argv: Sequence[str] | None = None) -> int:
    """Count, merge into the file, and list the tests that want a note."""
    options = _parser().parse_args(argv)
    found = replace(read(options.output), commit=options.commit)
    for distribution, folder in options.workspace:
        found = with_counts(found, distribution, count_tests(Path(folder), SUITES))
        for test in missed_tests(Path(folder), SUITES):
            print(f"{distribution}: {test}")
    found = replace(found, sources={**found.sources, **dict(options.sources)})
    options.output.write_text(as_text(found), encoding="utf-8")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.upstream", description="Count upstream's tests.")
    parser.add_argument(
        "--workspace",
        action="append",
        default=[],
        type=by_distribution,
        metavar="DISTRO=FOLDER",
        help="a workspace with test results; may be repeated",
    )
    parser.add_argument(
        "--sources",
        action="append",
        default=[],
        type=by_distribution,
        metavar="DISTRO=VERSIONS",
        help="versions of the suites, as the page shows them",
    )
    parser.add_argument("--commit", required=True, help="the commit of forge that built the workspaces")
    parser.add_argument("--output", type=Path, required=True, metavar="FILE", help="the file to update")
    return parser


if __name__ == "__main__":
    sys.exit(main())
