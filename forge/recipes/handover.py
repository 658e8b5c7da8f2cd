"""What forge tells CMake beforehand: the workspace's Python, forge's own argv, the manifest as variables."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge import __version__
from forge.frozen import frozen
from forge.launching.choice import launcher_variables
from forge.model import Kind
from forge.names import is_word
from forge.templating import render

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from forge.model import Export, Manifest, Pairs
    from forge.recipes.kitchen import Kitchen

_LISTS = {
    "BUILD_DEPENDS": Kind.BUILD,
    "BUILDTOOL_DEPENDS": Kind.BUILDTOOL,
    "BUILD_EXPORT_DEPENDS": Kind.BUILD_EXPORT,
    "BUILDTOOL_EXPORT_DEPENDS": Kind.BUILDTOOL_EXPORT,
    "EXEC_DEPENDS": Kind.EXEC,
    "TEST_DEPENDS": Kind.TEST,
}
_PYTHON_VERSION = re.compile(r"python(\d+\.\d+)")


@frozen
class _Entry:
    """A cache entry as the template sets it: every part a finished CMake argument."""

    name: str
    value: str
    type: str
    doc: str


@frozen
class _Variable:
    """A variable with its elements as finished CMake arguments."""

    name: str
    arguments: str


def handover(kitchen: Kitchen, manifest: Path, ament: Pairs = ()) -> str:
    """Return the cache entries for CMake's -C option; `manifest` is where manifest_variables() go.

    All packages may use them, whether they know forge or not; `ament` are more, for those of that build
    type: as -D CMake would complain of a package that finds no ament. The text depends on nothing else,
    so it changes exactly when a package must be configured again.
    """
    python = quoted(str(kitchen.python))
    version = _PYTHON_VERSION.search(kitchen.site_packages)
    launchers = launcher_variables(kitchen.launcher)
    entries = (
        ("Python3_EXECUTABLE", python, "FILEPATH", "The workspace's Python interpreter"),
        ("PYTHON_EXECUTABLE", python, "FILEPATH", "The same, as older packages call it"),
        ("PYTHON_INSTALL_DIR", quoted(kitchen.site_packages), "STRING", "Where Python modules are installed"),
        ("FORGE_PYTHON_VERSION", quoted(version[1] if version else ""), "STRING", "What that Python is"),
        ("FORGE_COMMAND", quoted(*kitchen.generator), "STRING", "The words that start forge"),
        ("FORGE_VERSION", quoted(__version__), "STRING", "A new one generates interfaces anew"),
        ("FORGE_MANIFEST", quoted(str(manifest)), "FILEPATH", "This package's package.xml as variables"),
        *((name, quoted(value), "STRING", "What ament is told") for name, value in ament),
        *((name, quoted(value), "STRING", "What starts the compiler") for name, value in launchers if value),
    )
    return render(
        "cmake/handover.cmake.j2",
        entries=[_Entry(name, value, type_, quoted(doc)) for name, value, type_, doc in entries],
        gone=[name for name, value in launchers if not value],
    )


def manifest_variables(manifest: Manifest) -> str:
    """Return the CMake variables that ament_package_xml() publishes for the manifest.

    The first line names the package: the embedded ament looks there whether the file is its own.
    """
    variables = [_Variable("_AMENT_PACKAGE_NAME", quoted(manifest.name))]
    for name, elements in _values(manifest):
        # An empty list is set to an empty string, so that an older value does not shine through.
        arguments = " ".join(map(quoted, elements)) or '""'
        variables.append(_Variable(f"{manifest.name}_{name}", arguments))
    return render("cmake/manifest.cmake.j2", package=manifest.name, variables=variables)


def quoted(*elements: str) -> str:
    """Return a quoted CMake argument: the list of the elements, each of which may hold any character."""
    escaped = (re.sub(r'([\\"$])', r"\\\1", element).replace(";", r"\;") for element in elements)
    return '"' + ";".join(escaped) + '"'


def _values(manifest: Manifest) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield each variable's name, without the package's, and its elements."""
    people = (f"{p.name} <{p.email}>" if p.email else p.name for p in manifest.maintainers)
    yield "VERSION", (manifest.version,)
    yield "MAINTAINER", (", ".join(people),)
    yield "DEPRECATED", (_deprecation(manifest.exports),)
    for name, kind in _LISTS.items():
        yield name, manifest.names(frozenset({kind}))
    yield "GROUP_DEPENDS", manifest.group_dependencies
    yield "MEMBER_OF_GROUPS", manifest.groups
    yield "EXPORT_TAGS", tuple(_xml(export).replace("${prefix}/", "") for export in manifest.exports)
    for name, kind in _LISTS.items():
        for dependency in manifest.dependencies:
            if kind in dependency.kinds and is_word(dependency.name):
                for comparison, version in dependency.versions:
                    yield f"{name}_{dependency.name}_VERSION_{comparison.upper()}", (version,)


def _deprecation(exports: tuple[Export, ...]) -> str:
    """Return the deprecation's text, TRUE when it has none, nothing when there is no deprecation."""
    return next((export.content or "TRUE" for export in exports if export.tag == "deprecated"), "")


def _xml(export: Export) -> str:
    attributes = "".join(f' {name}="{_escaped(value)}"' for name, value in export.attributes)
    if not export.content:
        return f"<{export.tag}{attributes}/>"
    return f"<{export.tag}{attributes}>{export.content}</{export.tag}>"


def _escaped(value: str) -> str:
    return value.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
