"""Find packages and their definitions in a folder of sources or of installed packages.

The discovery of workspaces leaves out install folders, and knows no packages without a manifest.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from forge.base.errors import ForgeError
from forge.base.files import read_file
from forge.base.layout import IGNORE_MARK
from forge.base.xml import parse_xml
from forge.interfaces.read.parsing import SECTIONS
from forge.interfaces.read.sources import definition_files
from forge.workspace.discovery import discover
from forge.workspace.root import find_root, is_root

IGNORED = frozenset({IGNORE_MARK, "AMENT_IGNORE"})
"""Files that hide a folder."""


def packages_in(root: Path, package: str) -> Iterator[tuple[str, Path]]:
    """Yield the names and folders of the packages below a folder: of sources, or installed ones."""
    for path, folders, files in os.walk(root):
        if path != str(root) and not IGNORED.isdisjoint(files):
            folders.clear()
            continue
        if "package.xml" in files:
            home = Path(path)
            yield _stated_name(home) or (package if home == root else home.name), home
            folders.clear()
            continue
        if path == str(root) and not SECTIONS.keys().isdisjoint(folders):
            yield package, root
        folders[:] = sorted(name for name in folders if not name.startswith("."))


def _stated_name(home: Path) -> str:
    """Return the name in a manifest, which may be invalid otherwise; '' if there is none."""
    path = home / "package.xml"
    with suppress(ForgeError, OSError):
        root = parse_xml(read_file(path), path)
        return next((each.text.strip() for each in root.children if each.tag == "name"), "")
    return ""


def workspace_packages() -> dict[str, Path]:
    """Return the packages with interfaces of the enclosing workspace, which need not be built."""
    root = find_root(Path.cwd(), Path.home())
    if not is_root(root):
        return {}
    folders = {name: root / each.path for name, each in discover(root, ["."], os.environ).packages.items()}
    return {name: folder for name, folder in folders.items() if definition_files(folder)}


def definitions_in(home: Path) -> Iterator[str]:
    """Yield the definitions of a package, also those in deeper folders, as paths below its folder.

    An .idl file beside a definition of the same name was generated from it.
    """
    for kind in SECTIONS:
        paths = (path for path in (home / kind).rglob("*") if not path.name.startswith("."))
        files = sorted(path for path in paths if path.suffix in {f".{kind}", ".idl"})
        own = {path.with_suffix("") for path in files if path.suffix != ".idl"}
        for path in files:
            if path.suffix != ".idl" or path.with_suffix("") not in own:
                yield path.relative_to(home).as_posix()
