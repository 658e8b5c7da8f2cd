"""Finds the Python for which an underlay was built."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path

from forge.base.files import names_in
from forge.base.layout import LAYOUT_MARKER
from forge.environment.install_state import recorded_python

Version = tuple[int, int]

_FOLDER = re.compile(r".*/python(\d+)\.(\d+)")
_SHEBANG = re.compile(rb"#!\s*(/\S*/python3?(?:\.\d+)?)\s")
_SCRIPTS_READ = 20
"""The maximum number of scripts that are read per prefix: most have the same interpreter."""


def python_versions(root: Path) -> frozenset[Version]:
    """Return the Python versions of an underlay's modules in lib/pythonX.Y; empty without modules."""
    versions = (frozenset(version for _, version in _module_folders(prefix)) for prefix in _prefixes(root))
    return next(filter(None, versions), frozenset())


def lacks_modules(root: Path, variables: Mapping[str, str]) -> bool:
    """Return whether a prefix has Python modules, but none of its folders is on PYTHONPATH.

    This is the case if only AMENT_PREFIX_PATH or CMAKE_PREFIX_PATH contain a distribution, as with `sudo -E`.
    """
    python_path = {
        os.path.realpath(entry) for entry in variables.get("PYTHONPATH", "").split(os.pathsep) if entry
    }
    folders = [folder for folder, _ in _module_folders(root)]
    return bool(folders) and python_path.isdisjoint(map(os.path.realpath, folders))


def underlay_python(root: Path) -> Path | None:
    """Return the interpreter that an underlay was built with: recorded by forge, else that of its scripts."""
    if (recorded := recorded_python(root)) is not None:
        return Path(recorded)
    for prefix in _prefixes(root):
        for name in names_in(f"{prefix}/bin")[:_SCRIPTS_READ]:
            with suppress(OSError), Path(prefix, "bin", name).open("rb") as stream:
                match = _SHEBANG.match(stream.readline(512))
                python = Path(os.fsdecode(match[1])) if match else None  # no path if `env` finds it
                if python is not None and python.exists():
                    return python
    return None


def _prefixes(root: Path) -> Iterator[Path]:
    yield root
    if (root / LAYOUT_MARKER).is_file():
        yield from (root / name for name in names_in(f"{root}"))


def _module_folders(prefix: Path) -> Iterator[tuple[str, Version]]:
    """Yield the folders with Python modules of one prefix, and the versions in their names."""
    for library in ("lib", "local/lib"):
        for folder in (f"{library}/{name}" for name in names_in(f"{prefix}/{library}")):
            match = _FOLDER.fullmatch(folder)
            for modules in ("site-packages", "dist-packages") if match else ():
                # Empty folders of that name also belong to underlays without modules.
                if match and names_in(f"{prefix}/{folder}/{modules}"):
                    yield f"{prefix}/{folder}/{modules}", (int(match[1]), int(match[2]))
