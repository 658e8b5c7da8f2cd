"""Find packages and their definitions in a folder of sources or of installed packages.

Workspace discovery skips install folders and does not find packages without a manifest.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath

from forge.base.errors import ForgeError
from forge.base.files import read_file, text_or_nothing
from forge.base.layout import IGNORE_MARK
from forge.base.xml import parse_xml
from forge.interfaces.read.parsing import ENDINGS, SECTIONS
from forge.interfaces.read.sources import definition_files, key_of
from forge.workspace.cmake_text import calls
from forge.workspace.discovery import discover
from forge.workspace.root import find_root, is_root

CMAKE_FILE = "CMakeLists.txt"
IGNORED = frozenset({IGNORE_MARK, "AMENT_IGNORE"})
"""Files that exclude a folder."""


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
    """Return the name in a manifest, which may otherwise be invalid; '' if there is none."""
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
    """Yield the definitions of a package, as paths below its folder.

    These are the definitions below msg, srv and action, at any depth, and those in other folders that its
    CMakeLists.txt names. An .idl file beside a definition of the same name was generated from it.
    """
    definitions: list[str] = []
    for kind in SECTIONS:
        paths = (path for path in (home / kind).rglob("*") if not path.name.startswith("."))
        files = sorted(path for path in paths if path.suffix in {f".{kind}", ".idl"})
        own = {path.with_suffix("") for path in files if path.suffix != ".idl"}
        definitions += (
            path.relative_to(home).as_posix()
            for path in files
            if path.suffix != ".idl" or path.with_suffix("") not in own
        )
    keys = {*map(key_of, definitions)}
    yield from definitions
    yield from (path for path in _named_in_cmake(home) if key_of(path) not in keys)


def _named_in_cmake(home: Path) -> list[str]:
    """Return the definitions whose literal paths are arguments in CMakeLists.txt, except those for tests."""
    words = {
        word.removeprefix("${CMAKE_CURRENT_SOURCE_DIR}").lstrip(":/")
        for call in calls(text_or_nothing(home / CMAKE_FILE))
        if not any("BUILD_TESTING" in condition for condition in call.conditions)
        for word in call.words
    }
    paths = {PurePosixPath(word) for word in words if word.rpartition(".")[2] in ENDINGS}
    return sorted(path.as_posix() for path in paths if ".." not in path.parts and (home / path).is_file())
