"""Copy a staged tree into a prefix and list its files; runs as a separate program, without forge.

    python install_tree.py STAGED PREFIX MANIFEST

MANIFEST is written like CMake's install_manifest.txt: in a merged install folder, it lists the files of the
package for forge.
"""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator


def main(staged: Path, prefix: Path, manifest: Path) -> None:
    """Install all files below `staged`; links are kept as links, and replace existing files."""
    installed = []
    log = os.environ.get("FORGE_OBSERVER_LOG")
    for source in _files(staged):
        target = prefix / source.relative_to(staged)
        if log:
            with Path(f"{log}.notes").open("ab") as stream:
                stream.write(b"W%s\0" % os.fsencode(target))
        target.parent.mkdir(parents=True, exist_ok=True)
        target.unlink(missing_ok=True)
        shutil.copy2(source, target, follow_symlinks=False)
        installed.append(f"{target}\n")
    manifest.write_text("".join(installed), encoding="utf-8", errors="surrogateescape")


def _files(folder: Path) -> Iterator[Path]:
    for place, names, files in os.walk(folder):
        names.sort()
        linked = [name for name in names if (Path(place) / name).is_symlink()]
        yield from (Path(place) / name for name in sorted((*files, *linked)))


if __name__ == "__main__":
    try:
        main(*map(Path, sys.argv[1:]))
    except OSError as error:
        sys.exit(
            f"error: cannot install '{error.filename2 or error.filename or sys.argv[3]}': {error.strerror}"
        )
