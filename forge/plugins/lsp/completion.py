"""Proposals for the word before a cursor: types, packages, values of constants, elements of package.xml."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Literal

from forge.base import ament_index
from forge.base.distributions import EMBEDDED
from forge.base.frozen import frozen
from forge.build.build_types import known_types
from forge.interfaces.model import TypeName, element_of, sections_of
from forge.interfaces.notation import type_text, value_text
from forge.interfaces.read.declarations import PRIMITIVES, read_declaration
from forge.interfaces.read.literals import ParseError
from forge.plugins.lsp.index import Index
from forge.plugins.lsp.occurrences import Reading
from forge.plugins.lsp.text import Span
from forge.workspace.manifest import DEPENDENCY_KINDS, tags_of
from forge.workspace.resolve import INTERFACE_GROUP

MOST = 100
"""The maximum number of proposals; with more, the editor asks again after the next character."""

_TEXTS = ("string", "wstring")
_IDL_TYPES = (
    *("boolean", "octet", "char", "wchar", "float", "double", "string", "wstring", "sequence"),
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
)

_TYPE = re.compile(r"[\w/]*")
_VALUE = re.compile(r"(\S+)\s+\w+(?:\s+|\s*=\s*)(\S*)")
_SCOPED = re.compile(r"(?:\w+::)*\w*\Z")
_INCLUDE = re.compile(r"""\s*\#include\b(?:\s*["<]([\w/.]*)\Z)?""")
_TAG = re.compile(r"<(\w*)\Z")
_CONTENT = re.compile(r"<(\w+)[^<>]*>\s*([^<>\s]*)\Z")


@frozen
class Proposal:
    """A word that may replace the typed text; editors compare `match`, or else `label`, with that text."""

    label: str
    kind: Literal["type", "package", "constant", "keyword", "value"]
    text: str | None = None
    """The text to insert, if it differs from the label."""
    match: str | None = None
    detail: str | None = None


@frozen
class Proposals:
    """Completion proposals for a part of a line; more exist unless they are `complete`."""

    span: Span
    items: tuple[Proposal, ...]
    complete: bool = True


def complete(index: Index, path: Path, line: int, column: int) -> Proposals:
    """Return the proposals at a cursor."""
    lines = index.text(path).splitlines()
    before = lines[line][:column] if line < len(lines) else ""
    reading = index.readings.get(path)
    if reading is None:
        typed, proposals = _in_manifest(index, before)
    elif path.suffix == ".idl":
        typed, proposals = _in_idl(index, before)
    else:
        typed, proposals = _in_declaration(index, reading, line, before)
    word = typed.lower()
    matching = [
        each
        for each in proposals
        if each.label.lower().startswith(word) or (each.match or "").lower().startswith(word)
    ]
    return Proposals(Span(line, column - len(typed), column), tuple(matching[:MOST]), len(matching) <= MOST)


def _in_declaration(index: Index, reading: Reading, line: int, before: str) -> tuple[str, Iterable[Proposal]]:
    """Return the typed text in a line of a .msg, .srv or .action file, and the proposals for it."""
    if _TYPE.fullmatch(before):
        return before, _types(index, reading, before)
    value = _VALUE.fullmatch(before)
    if value is None or "#" in before:
        return "", ()
    return value[2], _values(reading, line, value[1])


def _types(index: Index, reading: Reading, typed: str) -> Iterator[Proposal]:
    own = typed.rpartition("/")[0]
    if not own:
        yield from (Proposal(word, "keyword") for word in (*PRIMITIVES, *_TEXTS))
    package = reading.source.package
    messages = list(_messages(index))
    if not own:
        siblings = (name for name in messages if name.package == package)
        yield from (Proposal(name.name, "type", detail=str(name)) for name in siblings)
        others = {name.package for name in messages} - {package}
        manifest = index.manifest_of(reading.source.path)
        declared = manifest.dependencies if manifest else frozenset()
        near_first = sorted(others, key=lambda name: (name not in declared, name))
        yield from (Proposal(f"{name}/", "package") for name in near_first)
    word = typed.lower()
    for name in messages if typed else ():
        # Propose only a few of thousands of messages; a package matches the text before '/'.
        is_match = (
            own == name.package
            if own
            else name.name.lower().startswith(word) or name.package.startswith(word)
        )
        if is_match and name.package != package:
            label = f"{name.package}/{name.name}"
            yield Proposal(label, "type", match=None if own else name.name, detail=str(name))


def _values(reading: Reading, line: int, written: str) -> Iterator[Proposal]:
    """Yield the values of constants with the type of a field, and those of a boolean."""
    try:
        type_ = read_declaration(f"{written} x", reading.source.package).type
    except ParseError:
        return
    element = element_of(type_)
    if type_text(element, "").word == "bool":
        yield from (Proposal(word, "value") for word in ("true", "false"))
    owner = next((each.owner for each in reversed(reading.occurrences) if each.span.line <= line), None)
    for section in sections_of(reading.interface) if reading.interface else ():
        for constant in section.constants if section.name == owner else ():
            if constant.type == element:
                text = value_text(constant.value)
                yield Proposal(constant.name, "constant", text, detail=f"= {text}")


def _in_idl(index: Index, before: str) -> tuple[str, Iterable[Proposal]]:
    """Return the typed text in a line of an .idl file, and the proposals for it."""
    if include := _INCLUDE.match(before):
        typed = include[1] or ""
        return typed, _idl_files(index, typed) if include[1] is not None else ()
    typed = _SCOPED.search(before)[0]  # type: ignore[index]  # matches nothing as well
    return typed, _idl_types(index, typed)


def _idl_files(index: Index, typed: str) -> Iterator[Proposal]:
    """Yield the paths of messages in #include directives; messages of .msg files also have such paths."""
    for name in _messages(index):
        label = f"{name}.idl"
        # Editors compare the typed text with the label, unless `match` is set.
        match = None if label.lower().startswith(typed.lower()) else name.name
        yield Proposal(label, "type", match=match, detail=str(name))


def _messages(index: Index) -> Iterator[TypeName]:
    """Yield the names of all interfaces that can be the type of a field."""
    return (name for name in index.names() if name.kind not in {"srv", "action"})


def _idl_types(index: Index, typed: str) -> Iterator[Proposal]:
    package = typed.partition("::")[0] if "::" in typed else None
    if package is None:
        yield from (Proposal(word, "keyword") for word in _IDL_TYPES)
    for name in _messages(index):
        if package in {None, name.package}:
            label = str(name).replace("/", "::")
            yield Proposal(label, "type", match=None if package else name.name, detail=str(name))


def _in_manifest(index: Index, before: str) -> tuple[str, Iterable[Proposal]]:
    """Return the typed text in a package.xml, and the proposals for it."""
    if opened := _TAG.search(before):
        return opened[1], (Proposal(name, "keyword") for name in tags_of(3))
    content = _CONTENT.search(before)
    if content is None:
        return "", ()
    tag, typed = content.groups()
    if tag in DEPENDENCY_KINDS:
        own = {manifest.name for manifest in index.manifests.values() if manifest.name}
        installed = ament_index.resources("packages", index.library.prefixes)
        embedded = (path.parent.name for path in EMBEDDED.glob("*/package.xml"))
        return typed, (Proposal(name, "package") for name in sorted({*own, *installed, *embedded}))
    words = known_types() if tag == "build_type" else (INTERFACE_GROUP,) * (tag == "member_of_group")
    return typed, (Proposal(word, "value") for word in words)
