"""The installed files of packages in their last few states, so that dependents can compare them."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path

from forge.base.files import read_json, replace_file
from forge.base.layout import INSTALLED_STATES_DIR
from forge.build.inputs.fingerprints import Changes, compare

_SHARED_LIBRARY = re.compile(r"/lib[^/]+\.so(\.[\d.]+)?$")
"""Paths of shared libraries, by the names that linkers look for."""
_KEPT = 8
"""The number of states kept per package: dependents may have been built with different ones."""
_INTERFACES = "interfaces"
"""The interface of each shared library in these states, by the digest of its content."""
_LIBRARIES = 64


class InstalledStates:
    """Lists of installed files by package and by the digest of all of them."""

    def __init__(self, build: Path) -> None:
        """Store the path of the lists; `build` is the parent of all build folders."""
        self._home = build / INSTALLED_STATES_DIR
        self._compared: dict[tuple[str, str, str], Changes | None] = {}

    def keep(self, name: str, digest: str, contents: Mapping[str, str]) -> None:
        """Record the contents of a package's installed files by absolute path; remove old states."""
        folder = self._home / name
        replace_file(folder / f"{digest}.json", json.dumps(contents).encode())
        libraries = {content: path for path, content in contents.items() if _SHARED_LIBRARY.search(path)}
        if libraries:
            from forge.build.inputs.elf_abi import abi_digest

            interfaces = read_json(folder / _INTERFACES)
            now = {
                content: interfaces.get(content) or abi_digest(path) for content, path in libraries.items()
            }
            older = {content: interface for content, interface in interfaces.items() if content not in now}
            updated = dict([*older.items()][-max(_LIBRARIES, _KEPT * len(now)) :]) | now
            if updated != interfaces:
                replace_file(folder / _INTERFACES, json.dumps(updated).encode())
        states = [*folder.glob("*.json")]
        if len(states) > _KEPT:
            states.sort(key=lambda path: path.stat().st_mtime_ns)
            for path in states[:-_KEPT]:
                path.unlink(missing_ok=True)

    def contents(self, name: str, digest: str) -> Mapping[str, str] | None:
        """Return the installed files of a package in one of its states, None if it is unknown."""
        return read_json(self._home / name / f"{digest}.json") or None

    def changes(self, name: str, then: str, now: str) -> Changes | None:
        """Return how two states of a package differ, by their digests; None if one of them is unknown.

        An empty digest means that the package was not installed.
        """
        key = (name, then, now)
        if key not in self._compared:
            one, other = (self.contents(name, digest) if digest else {} for digest in (then, now))
            self._compared[key] = None if one is None or other is None else compare(one, other)
        return self._compared[key]

    def only_library_code_changed(self, name: str, then: str, now: str) -> bool:
        """Return whether two states of a package differ only in the code of shared libraries.

        Linking with either gives the same program: the libraries have equal interfaces.
        """
        changes = self.changes(name, then, now)
        if not changes or changes.names:
            return False
        one, other = (self.contents(name, digest) or {} for digest in (then, now))
        interfaces = read_json(self._home / name / _INTERFACES)
        return all(
            _SHARED_LIBRARY.search(path)
            and (interface := interfaces.get(one[path]))
            and interface == interfaces.get(other[path])
            for path in changes.modified
        )
