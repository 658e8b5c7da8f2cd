"""Write the result file of a linter test that is skipped, because the linter is not installed.

    skip_linter.py PROGRAM PACKAGE TEST FILE

Exits with 77, the code that tells CTest that the test was skipped. Uses only the standard library.
"""

from __future__ import annotations

import sys
from pathlib import Path
from xml.sax.saxutils import quoteattr

SKIPPED = 77


def main(words: list[str]) -> int:
    """Write the file, and return the exit code."""
    program, package, test, file = words
    reason = f"{program} is not installed"
    Path(file).write_text(
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<testsuite name={quoteattr(package)} tests="1" failures="0" errors="0" skipped="1" time="0">\n'
        f'  <testcase classname={quoteattr(package)} name={quoteattr(test)} time="0">'
        f"<skipped message={quoteattr(reason)}/></testcase>\n</testsuite>\n",
        encoding="utf-8",
    )
    sys.stdout.write(f"{reason}\n")
    return SKIPPED


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
