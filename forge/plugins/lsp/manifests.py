"""A package.xml in an editor: its problems, and the locations of package names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from forge.base.errors import Location, Problem, WorkspaceError
from forge.base.frozen import frozen
from forge.base.xml import Element, parse_xml
from forge.plugins.lsp.text import Span, span_at
from forge.workspace.discovery import ROS_DEFAULTS
from forge.workspace.manifest import DEPENDENCY_KINDS, parse_manifest
from forge.workspace.model import Manifest

MANIFEST = "package.xml"


@frozen
class PackageMention:
    """A package that a manifest names: its own in <name>, or a dependency."""

    tag: str
    name: str
    span: Span


@frozen
class ManifestReading:
    """The result of reading one package.xml; `manifest` is None if it is invalid."""

    path: Path
    text: str
    manifest: Manifest | None
    errors: tuple[Problem, ...] = ()
    warnings: tuple[Problem, ...] = ()
    mentions: tuple[PackageMention, ...] = ()
    build_type: Span | None = None
    """The position of the build type; None if the manifest is invalid or names none."""

    @property
    def name(self) -> str | None:
        """The name of the package, even if the manifest is invalid; None if it has none."""
        return next((each.name for each in self.mentions if each.tag == "name"), None)

    @property
    def dependencies(self) -> frozenset[str]:
        """The packages that it depends on."""
        return frozenset(each.name for each in self.mentions if each.tag != "name")


def read_manifest(path: Path, text: str, variables: Mapping[str, str]) -> ManifestReading:
    """Read a package.xml that may be incomplete."""
    content = text.encode()
    try:
        root, lines = parse_xml(content, path), text.split("\n")
        mentions = tuple(_mentions(root, lines))
    except WorkspaceError as error:
        return ManifestReading(path, text, None, error.problems)
    try:
        manifest = parse_manifest(content, path, {**ROS_DEFAULTS, **variables})
    except WorkspaceError as error:
        return ManifestReading(path, text, None, error.problems, mentions=mentions)
    build_type = _build_type(root, manifest.build_type, lines)
    return ManifestReading(path, text, manifest, (), manifest.warnings, mentions, build_type)


def _mentions(root: Element, lines: list[str]) -> Iterator[PackageMention]:
    for child in root.children:
        name = child.text.strip()
        if name and (child.tag == "name" or child.tag in DEPENDENCY_KINDS):
            span = _span_of_text(child, name, lines)
            if span:
                yield PackageMention(child.tag, name, span)


def _build_type(root: Element, name: str, lines: list[str]) -> Span | None:
    """Return the position of the build type: the last element with its name, since others are inactive."""
    elements = (each for export in root.all("export") for each in export.all("build_type"))
    matches = [each for each in elements if each.inner.strip() == name]
    if not matches:
        return None
    span = _span_of_text(matches[-1], name, lines) if name else None
    return span or span_at(Location("", matches[-1].line, matches[-1].column), lines)


def _span_of_text(element: Element, text: str, lines: list[str]) -> Span | None:
    """Return the position of the text of an element.

    None if it is not on one of the first lines of the element.
    """
    line = element.line - 1
    start = lines[line].find(">", element.column - 1) + 1
    if not start:
        return None
    for number, begin in ((line, start), (line + 1, 0)):
        column = lines[number].find(text, begin) if number < len(lines) else -1
        if column >= 0:
            return Span(number, column, column + len(text))
    return None
