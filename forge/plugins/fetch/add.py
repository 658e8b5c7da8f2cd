"""`forge add`: add dependencies to the manifest of a package."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

from forge.base.errors import Location, Problem, SelectionError, WorkspaceError, raise_if_any
from forge.base.files import read_file, replace_file, text_or_nothing
from forge.base.frozen import frozen
from forge.base.names import did_you_mean, is_safe_name
from forge.base.options import flag, option, options_of
from forge.base.xml import parse_xml
from forge.cli import options as shared
from forge.workspace.cmake_text import calls
from forge.workspace.load import LoadedWorkspace, load_workspace
from forge.workspace.manifest import DEPENDENCY_KINDS, parse_manifest
from forge.workspace.model import CMAKE_TYPES, Package
from forge.workspace.selection import Query

_BEFORE_EXPORT = re.compile(r"^[ \t]*(?:<export\b|</package>)", re.MULTILINE)
_OLD_DEPEND = ("build_depend", "run_depend")
"""The equivalent of <depend> in format 1."""


@frozen
class Options:
    names: tuple[str, ...] = option(
        "dependencies to add: packages, or keys of rosdep", nargs="+", positional=True, metavar="DEP"
    )
    package: str | None = option(
        "package to change (default: that of the current folder, or the only one)", metavar="PKG"
    )
    build: bool = flag("needed only to build the package", conflicts="kind")
    exec: bool = flag("needed only to run it", conflicts="kind")
    test: bool = flag("needed only to test it", conflicts="kind")
    cmake: bool = flag("also write 'find_package' to CMakeLists.txt")
    query: Query = options_of(Query)
    origin: str = os.curdir


def run(options: Options) -> int:
    """Change package.xml, and print further lines that the package needs; returns 0."""
    loaded = load_workspace(Path.cwd(), options.query, os.environ)
    package = _package(options, loaded)
    raise_if_any(
        (
            Problem(f"invalid dependency name '{name}'", hint="names cannot contain blanks or quotes")
            for name in options.names
            if not is_safe_name(name)
        ),
        SelectionError,
    )
    path = package.manifest.path
    content = read_file(path)
    tag = next((kind for kind in ("build", "exec", "test") if getattr(options, kind)), "")
    text, added = with_dependencies(content, path, options.names, f"{tag}_depend" if tag else "depend")
    parse_manifest(text.encode(), path, os.environ)
    shown = shared.displayed(path, options.origin)
    if added:
        replace_file(path, text.encode())
        print(f"added {', '.join(added)} to {shown}")
    for name in options.names:
        if name not in added:
            print(f"{shown} already has {name}")
    if package.build_type in CMAKE_TYPES and not options.exec:
        _find_packages(options, package)
    if any(name not in loaded.workspace.packages for name in added):
        print("if 'forge build' does not find them, 'forge fetch' fetches them")
    return 0


def with_dependencies(
    content: bytes, path: Path, names: Iterable[str], tag: str
) -> tuple[str, tuple[str, ...]]:
    """Return a manifest with elements for the missing names, and these names.

    The elements follow the last one of the same tag, else the last dependency, in its indentation. Raises
    WorkspaceError if the manifest is not well-formed.
    """
    root = parse_xml(content, path)
    tags = _OLD_DEPEND if root.attributes.get("format", "1") == "1" and tag == "depend" else (tag,)
    existing = {
        (each.tag, each.text.strip())
        for each in root.children
        if each.tag in DEPENDENCY_KINDS and "condition" not in each.attributes
    }
    added = tuple(
        name
        for name in dict.fromkeys(names)
        if not {(each, name) for each in tags} <= existing and ("depend", name) not in existing
    )
    try:
        text = content.decode()
    except UnicodeDecodeError:
        raise WorkspaceError(Problem("the manifest is not UTF-8", Location(path))) from None
    dependencies = [each for each in root.children if each.tag in DEPENDENCY_KINDS]
    siblings = [each for each in dependencies if each.tag in tags] or dependencies
    newline = "\r\n" if "\r\n" in text else "\n"
    if siblings:
        last = siblings[-1]
        end = content.index(b">", last.end) + 1
        before = content[: last.start].decode()
        _, newlines, indentation = before.rpartition("\n")
        place = len(content[:end].decode())
        if not newlines or indentation.strip():
            indentation = "  "
        lines = "".join(
            f"{newline}{indentation}<{each}>{name}</{each}>"
            for each in tags
            for name in added
            if (each, name) not in existing
        )
    else:
        match = _BEFORE_EXPORT.search(text)
        if match is None:
            raise WorkspaceError(
                Problem(f"'{path}' has no line with </package>", hint="write it on a separate line")
            )
        place = match.start()
        lines = "".join(f"  <{each}>{name}</{each}>{newline}" for each in tags for name in added)
    return f"{text[:place]}{lines}{text[place:]}", added


def _package(options: Options, loaded: LoadedWorkspace) -> Package:
    """Return the package to change; raises SelectionError if it is not clear which one."""
    packages = loaded.workspace.packages
    if options.package:
        if options.package not in packages:
            hint = did_you_mean(options.package, packages) or "'forge list' lists the packages"
            raise SelectionError(Problem(f"no package is named '{options.package}'", hint=hint))
        return packages[options.package]
    here = Path.cwd() / options.origin
    enclosing = [each for each in packages.values() if here.resolve().is_relative_to(each.path.resolve())]
    candidates = enclosing or list(packages.values())
    if len(candidates) != 1:
        message = "no package in the workspace" if not candidates else f"there are {len(candidates)} packages"
        hint = "name one with '--package', or change to its folder"
        raise SelectionError(Problem(message, hint=hint))
    return candidates[0]


def _find_packages(options: Options, package: Package) -> None:
    """Print or write the CMake code that finds the dependencies."""
    path = package.path / "CMakeLists.txt"
    text = text_or_nothing(path)
    find_package_calls = [call for call in calls(text) if call.command == "find_package" and call.words]
    missing = [name for name in options.names if all(call.words[0] != name for call in find_package_calls)]
    lines = [f"find_package({name} REQUIRED)" for name in missing]
    shown = shared.displayed(path, options.origin)
    top = [call.line for call in find_package_calls if not call.conditions]
    if lines and options.cmake and top:
        rows, start = text.split("\n"), top[-1] - 1
        ends = range(start + 1, len(rows) + 1)
        after = next(end for end in ends if any(calls("\n".join(rows[start:end]))))
        replace_file(path, "\n".join((*rows[:after], *lines, *rows[after:])).encode())
        print(f"wrote to {shown}:", *lines, sep="\n  ")
    elif lines:
        print(f"to use them, write to {shown}:", *lines, sep="\n  ")
    if missing and package.build_type == "ament_cmake" and not options.test:
        print(f"  ament_target_dependencies(TARGET {' '.join(missing)})")
