"""Find packages and their definitions in a folder of sources or of installed packages.

The discovery of workspaces leaves out install folders, and knows no packages without a manifest.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from forge.base.errors import WorkspaceError
from forge.base.files import read_file
from forge.base.layout import IGNORE_MARK
from forge.interfaces.read.parsing import SECTIONS
from forge.workspace.manifest import parse_manifest

IGNORED = frozenset({IGNORE_MARK, "AMENT_IGNORE"})
"""Files that hide a folder."""


def packages_in(root: Path, package: str) -> Iterator[tuple[str, Path]]:
    """Yield the names and folders of the packages below a folder: of sources, or installed ones."""
    for path, folders, files in os.walk(root):
        if "package.xml" in files:
            home = Path(path)
            try:
                name = parse_manifest(read_file(home / "package.xml"), home / "package.xml", os.environ).name
            except WorkspaceError:
                name = home.name
            yield name, home
            folders.clear()
            continue
        if path != str(root) and not IGNORED.isdisjoint(files):
            folders.clear()
            continue
        if path == str(root) and not SECTIONS.keys().isdisjoint(folders):
            yield package, root
        folders[:] = sorted(name for name in folders if not name.startswith("."))


def definitions_in(home: Path) -> Iterator[str]:
    """Yield the definitions of a package, also those in deeper folders, as paths below its folder.

    An .idl file beside a definition of the same name was generated from it.
    """
    for kind in SECTIONS:
        files = sorted(path for path in (home / kind).rglob("*") if path.suffix in {f".{kind}", ".idl"})
        own = {path.with_suffix("") for path in files if path.suffix != ".idl"}
        for path in files:
            if path.suffix != ".idl" or path.with_suffix("") not in own:
                yield path.relative_to(home).as_posix()
