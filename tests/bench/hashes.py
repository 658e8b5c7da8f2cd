"""Compare type hashes with those that others computed.

python -m tests.bench.hashes FOLDER HASHES.json

FOLDER holds a folder per package with msg, srv and action in it; HASHES.json an object of names and
hashes, derived types included. Prints what differs, and how many agree.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from forge.interfaces.hashing import hashes
from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library, read_folder
from forge.interfaces.resolve.resolution import resolve


def hashes_below(folder: Path) -> dict[str, str]:
    """Return the hash of each type of each package in a folder; raises InterfaceError."""
    library = Library(embedded=folder)
    found = {}
    for package, definitions in library.packages().items():
        catalog = resolve(package, parse_all(read_folder(package, definitions)), library)
        found.update({str(name): text for name, text in hashes(catalog).items()})
    return found


def main(folder: str, expected: str) -> int:
    """Print the differences and return how many there are, at most 1."""
    found = hashes_below(Path(folder))
    wanted: dict[str, str] = json.loads(Path(expected).read_text(encoding="utf-8"))
    different = [name for name in sorted(found.keys() | wanted.keys()) if found.get(name) != wanted.get(name)]
    for name in different:
        print(f"{name}: {found.get(name, 'not there')}, expected {wanted.get(name, 'nothing')}")
    print(f"{len(wanted) - len(set(different) & wanted.keys())} of {len(wanted)} agree")
    return min(len(different), 1)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
