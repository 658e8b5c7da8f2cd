"""Print the version of a module's distribution without importing the module; exit with 1 without the module.

Called as `module_version.py MODULE`. Importing pytest would read the metadata of every distribution.
"""

from __future__ import annotations

import sys
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec


def main(module: str) -> int:
    """Print the version, or 'unknown' without metadata."""
    if find_spec(module) is None:
        return 1
    try:
        print(version(module))
    except PackageNotFoundError:
        print("unknown")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
