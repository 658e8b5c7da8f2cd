"""The installed files of packages in their last few states, so that dependents can compare them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from forge.base.extensions import OPTIONS, find, is_installed
from forge.base.files import read_json, replace_file
from forge.base.layout import INSTALLED_STATES_DIR
from forge.build.inputs.fingerprints import Changes, compare

STATES_PER_PACKAGE = 8
"""Dependents may have been built with different states."""


class InstalledStates:
    """Lists of installed files by package and by the digest of all of them."""

    def __init__(self, build: Path) -> None:
        """Store the path of the lists; `build` is the parent of all build folders."""
        self._home = build / INSTALLED_STATES_DIR
        self._compared: dict[tuple[str, str, str], Changes | None] = {}

    def folder(self, name: str) -> Path:
        """Return the folder for what is recorded about the installed files of a package."""
        return self._home / name

    def keep(self, name: str, digest: str, contents: Mapping[str, str]) -> None:
        """Record the contents of a package's installed files by absolute path; remove old states."""
        replace_file(self.folder(name) / f"{digest}.json", json.dumps(contents).encode())
        if is_installed(OPTIONS, "library-abi"):
            find(OPTIONS, "library-abi", "option").keep_interfaces(name, contents, self)
        states = [*self.folder(name).glob("*.json")]
        if len(states) > STATES_PER_PACKAGE:
            states.sort(key=lambda path: path.stat().st_mtime_ns)
            for path in states[:-STATES_PER_PACKAGE]:
                path.unlink(missing_ok=True)

    def contents(self, name: str, digest: str) -> Mapping[str, str] | None:
        """Return the installed files of a package in one of its states, None if it is unknown."""
        return read_json(self.folder(name) / f"{digest}.json") or None

    def changes(self, name: str, then: str, now: str) -> Changes | None:
        """Return how two states of a package differ, by their digests; None if one of them is unknown.

        An empty digest means that the package was not installed.
        """
        key = (name, then, now)
        if key not in self._compared:
            one, other = (self.contents(name, digest) if digest else {} for digest in (then, now))
            self._compared[key] = None if one is None or other is None else compare(one, other)
        return self._compared[key]
