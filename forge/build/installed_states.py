"""What packages have installed, file by file, in their last few states: dependents see how these differ."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.build.input_manifest import FileState, compare, read_manifest, write_manifest

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from forge.build.input_manifest import Changes

INSTALLED = ".forge_installed"
"""The folder beside build folders with a list of files for each package and state."""
_KEPT = 8
"""How many states of a package are kept: each dependent may have been built with another one."""


class InstalledStates:
    """Lists of installed files by package and by the digest of all of them."""

    def __init__(self, build: Path) -> None:
        """Remember where the lists are kept; `build` is the folder that holds all build folders."""
        self._home = build / INSTALLED
        self._compared: dict[tuple[str, str, str], Changes | None] = {}

    def keep(self, name: str, digest: str, contents: Mapping[str, str]) -> None:
        """Write down the contents of what a package has installed, by absolute path; forget old states."""
        folder = self._home / name
        manifest = {path: FileState("", content) for path, content in contents.items()}
        write_manifest(folder / f"{digest}.json", manifest)
        newest_first = sorted(folder.iterdir(), key=lambda path: path.stat().st_mtime_ns, reverse=True)
        for path in newest_first[_KEPT:]:
            path.unlink(missing_ok=True)

    def changes(self, name: str, then: str, now: str) -> Changes | None:
        """Return how two states of a package differ, by their digests; None when one of them is not known.

        An empty digest stands for a package that was not installed.
        """
        key = (name, then, now)
        if key not in self._compared:
            one, other = (
                read_manifest(self._home / name / f"{digest}.json") if digest else {}
                for digest in (then, now)
            )
            self._compared[key] = None if one is None or other is None else compare(one, other)
        return self._compared[key]
