"""Searches package config files below a prefix like CMake's find_package."""

from __future__ import annotations

import os
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import islice

from forge.base.files import names_in

_INSIDE = ("", "/cmake", "/CMake")
_LIBRARIES = ("lib64", "lib32", "libx32", "lib", "share")


def prefixes_of_path(folders: Sequence[str]) -> tuple[str, ...]:
    """Return the prefixes that CMake derives from PATH: the parents of 'bin' and 'sbin'."""
    pairs = (folder.rstrip("/").rpartition("/") for folder in folders)
    return tuple(dict.fromkeys(above or "/" for above, _, last in pairs if last in {"bin", "sbin"}))


class ConfigSearch:
    """Searches config files; each folder is read once."""

    def __init__(self) -> None:
        self._bases = cache(self._find_bases)
        self._listed = cache(self._sorted_entries)

    def folder(self, prefix: str, name: str) -> str:
        """Return the real folder of a package's config file below a prefix, '' if there is none."""
        files = (f"{name}Config.cmake", f"{name.lower()}-config.cmake")
        for folder in self._candidates(prefix, name.lower()):
            if any((file.lower(), file) in self._listed(folder) for file in files):
                return os.path.realpath(folder)
        return ""

    def _candidates(self, prefix: str, name: str) -> Iterator[str]:
        """Yield the folders below a prefix that CMake searches, ignoring the case of the name."""
        yield from (f"{prefix}{below}" for below in _INSIDE)
        for entry in self._named(prefix, name):
            yield from (f"{prefix}/{entry}{below}" for below in _INSIDE)
        for base in self._bases(prefix):
            yield from (f"{base}/cmake/{entry}" for entry in self._named(f"{base}/cmake", name))
            for entry in self._named(base, name):
                yield from (f"{base}/{entry}{below}" for below in _INSIDE)

    def _find_bases(self, prefix: str) -> tuple[str, ...]:
        native = (f"lib/{entry}" for _, entry in self._listed(f"{prefix}/lib") if "-linux-" in entry)
        return tuple(f"{prefix}/{below}" for below in (*native, *_LIBRARIES))

    def _named(self, folder: str, name: str) -> Iterator[str]:
        listed = self._listed(folder)
        for low, entry in islice(listed, bisect_left(listed, (name, "")), None):
            if not low.startswith(name):
                break
            yield entry

    @staticmethod
    def _sorted_entries(folder: str) -> list[tuple[str, str]]:
        """Return the entries of a folder as (lower-case name, name), sorted."""
        return sorted((entry.lower(), entry) for entry in names_in(folder))
