"""Read the interfaces of all packages in a folder, or in a revision of a git repository.

A folder contains sources or installed packages. Workspace discovery skips install folders and does not find
packages without a manifest.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path, PurePosixPath

from forge.base.errors import (
    ForgeError,
    InterfaceError,
    Location,
    Problem,
    SelectionError,
    print_warnings,
    raise_if_any,
)
from forge.base.files import read_file, text_or_nothing
from forge.base.layout import IGNORE_MARK
from forge.base.xml import parse_xml
from forge.interfaces.model import SECTIONS, Catalog, TypeName, nested_types, sections_of
from forge.interfaces.read.parsing import ENDINGS, Parsed, parse
from forge.interfaces.read.sources import Library, contradictions, definition_files, key_of, read_source
from forge.interfaces.resolve.resolution import nested_messages, resolve
from forge.workspace.cmake_text import calls
from forge.workspace.discovery import discover
from forge.workspace.root import find_root, is_root

CMAKE_FILE = "CMakeLists.txt"
IGNORED = frozenset({IGNORE_MARK, "AMENT_IGNORE"})
"""Files that exclude a folder."""

Invalid = dict[TypeName, tuple[Problem, ...]]
"""Interfaces that cannot be read, or contain such an interface or an unknown type, with the reasons."""

_SUBMODULE = "160000"
"""The mode of the commit of another repository in a tree of git."""


def read_version(text: str, others: Library, package: str | None) -> tuple[list[Catalog], Invalid]:
    """Return the interfaces of each package in a version, or of one `package`, and its invalid ones.

    A version is a folder, or REVISION or REVISION:FOLDER as in git; the default FOLDER is the working
    directory. `others` has the definitions of other packages that they refer to. Raises SelectionError if
    neither exists, and names files of a revision as git does.
    """
    if Path(text).is_dir():
        return _catalogs_in(Path(text), Path(text).resolve().name, others, package, lambda problem: problem)
    # Without ':', git lists the current folder of the tree.
    listed = _git("ls-tree", "-r", "-z", *(("--full-tree",) if ":" in text else ()), "--end-of-options", text)
    if listed.returncode:
        reason = listed.stderr.decode(errors="replace").strip().removeprefix("fatal: ")
        hint = "revisions refer to the repository of the current folder, as in HEAD~1 or v1.2.0:src/my_msgs"
        raise SelectionError(Problem(f"'{text}' is neither a folder nor a git revision: {reason}", hint=hint))
    with tempfile.TemporaryDirectory(prefix="forge-") as folder:
        _extract(listed.stdout, Path(folder), text)
        name = Path(text.partition(":")[2]).absolute().name
        return _catalogs_in(Path(folder), name, others, package, partial(_renamed, Path(folder), text))


def _extract(listing: bytes, folder: Path, revision: str) -> None:
    """Write definitions and manifests into a folder; `listing` is the output of `git ls-tree -r -z`.

    Raises SelectionError if a partial clone lacks one of the files.
    """
    objects, cmake_files = dict[str, str](), dict[str, str]()
    links: list[Problem] = []
    for entry in filter(None, listing.decode(errors="surrogateescape").split("\0")):
        (mode, _, name), path = entry.partition("\t")[0].split(" "), entry.partition("\t")[2]
        if mode.startswith("100") and _is_read(PurePosixPath(path)):
            objects[path] = name
        elif mode.startswith("100") and PurePosixPath(path).name == CMAKE_FILE:
            cmake_files[path] = name
        elif mode == _SUBMODULE:
            hint = "compare its own revisions in its folder, or folders instead of revisions"
            print_warnings([Problem(f"the submodule '{path}' of '{revision}' is left out", hint=hint)])
        elif _is_read(PurePosixPath(path)):
            links.append(Problem(f"'{path}' of '{revision}' is a symbolic link", hint="compare folders"))
    raise_if_any(links, SelectionError)
    for path, name in cmake_files.items():
        if PurePosixPath(path).with_name("package.xml").as_posix() in objects:
            objects[path] = name
    contents = _git("cat-file", "--batch", content="\n".join(objects.values()).encode()).stdout
    offset = 0
    for path in objects:
        end = contents.index(b"\n", offset)
        size = contents[offset:end].rpartition(b" ")[2]
        if not size.isdigit():
            message = f"'{path}' of '{revision}' is not in this clone"
            raise SelectionError(Problem(message, hint="fetch it: git fetch --unshallow, or --refetch"))
        offset = end + 1 + int(size) + 1
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(contents[end + 1 : offset - 1])


def _is_read(path: PurePosixPath) -> bool:
    is_safe = ".." not in path.parts
    return is_safe and (path.name in {"package.xml", *IGNORED} or path.suffix.removeprefix(".") in ENDINGS)


def _git(*words: str, content: bytes = b"") -> subprocess.CompletedProcess[bytes]:
    try:
        return subprocess.run(("git", *words), input=content, capture_output=True, check=False)
    except OSError:
        hint = "install it, or name folders instead of revisions"
        raise SelectionError(Problem("git is not installed", hint=hint)) from None


def _renamed(folder: Path, text: str, problem: Problem) -> Problem:
    """Return a problem with a location in the revision instead of the extracted folder."""
    place = problem.location
    if place is None or not Path(place.path).is_relative_to(folder):
        return problem
    relative = Path(place.path).relative_to(folder)
    return replace(
        problem, location=replace(place, path=Path(f"{text}{'/' if ':' in text else ':'}{relative}"))
    )


@dataclass
class _Version(Library):
    """The library of a version, whose own interfaces come first."""

    invalid: Invalid = field(default_factory=dict)
    """Types that cannot be used, including missing ones of other packages."""

    def find(self, name: TypeName) -> Parsed | None:
        if name in self.invalid:
            raise InterfaceError(*self.invalid[name])
        return super().find(name)


def _catalogs_in(
    folder: Path, name: str, others: Library, package: str | None, renamed: Callable[[Problem], Problem]
) -> tuple[list[Catalog], Invalid]:
    """Return the interfaces of the packages in a folder, and the reasons why others are invalid.

    Definitions without a package.xml belong to a package with the `name` of the folder. Raises InterfaceError
    if two packages have the same name.
    """
    library = _Version(others.includes, others.prefixes, others.embedded, others.rosdistro)
    packages: dict[str, list[Parsed]] = {}
    for each, home in packages_in(folder, package or name):
        definitions = packages.setdefault(each, [])
        if definitions:
            problem = Problem(f"another package of '{name}' is called '{each}', too", Location(home))
            raise InterfaceError(renamed(problem))
        for relative in definitions_in(home):
            try:
                source = read_source(each, home, relative)
                interface = parse(source)
            except InterfaceError as error:
                library.invalid[TypeName(each, *key_of(relative))] = error.problems
                continue
            print_warnings(map(renamed, contradictions([source])))
            definitions.append(Parsed(source, interface))
    library.given = {one.interface.name: one for definitions in packages.values() for one in definitions}
    own = {*library.given, *library.invalid}
    catalogs = []
    for each in sorted(packages) if package is None else {package} & packages.keys():
        definitions = packages[each]
        while definitions:
            try:
                catalogs.append(resolve(each, definitions, library, events=library.has_events))
                break
            except InterfaceError as error:
                definitions = _valid_ones(definitions, library, error)
    return catalogs, {
        each: tuple(map(renamed, problems))
        for each, problems in library.invalid.items()
        if each in own and package in {None, each.package}
    }


def _valid_ones(parsed: list[Parsed], library: _Version, error: InterfaceError) -> list[Parsed]:
    """Return the interfaces that are valid despite `error`; the others become invalid.

    Each unknown type is reported once, at its first use.
    """
    before = len(library.invalid)
    for each in parsed:
        try:
            nested_messages(each, library)
            continue
        except InterfaceError as reason:
            problems = reason.problems
        library.invalid[each.interface.name] = problems
        for other in nested_types(sections_of(each.interface)):
            with suppress(InterfaceError):
                if library.find(other):
                    continue
            library.invalid[other] = problems
    if len(library.invalid) == before:  # each is valid alone: two of them have the same name
        places = {problem.location.path for problem in error.problems if problem.location}
        duplicates = [each for each in parsed if each.source.path in places] or parsed
        library.invalid |= {each.interface.name: error.problems for each in duplicates}
    return [each for each in parsed if each.interface.name not in library.invalid]


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
