"""The target 'docs': one Markdown page with the interfaces of a package."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.base.templating import render
from forge.interfaces.hashing import hashes
from forge.interfaces.model import Action, Array, File, Message, Named, Primitive, Sequence, Service, String
from forge.interfaces.read.comments import BIDI_CONTROLS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from forge.interfaces.model import Catalog, Constant, Field, Interface, Type, Value

_MARKUP = re.compile(r"([\\`*_<>\[\]|#])")
_UNSEEN = re.compile(f"[\0-\x1f\x7f-\x9f\u2028\u2029]|{BIDI_CONTROLS.pattern}")
_IN_FILES = {"boolean": "bool", "octet": "byte", "float": "float32", "double": "float64"}


@frozen
class Section:
    """A message; without a title unless it is a part of a service or an action."""

    title: str
    doc: tuple[str, ...]
    constants: tuple[str, ...]
    fields: tuple[str, ...]


def files(catalog: Catalog) -> Iterator[File]:
    """Yield 'PACKAGE.md'; links to other packages refer to pages in the same folder."""
    type_hashes = hashes(catalog)
    pages = [
        {
            "name": str(name),
            "kind": name.kind,
            "hash": type_hashes[name],
            "sections": list(_sections(interface)),
        }
        for name, interface in catalog.interfaces.items()
    ]
    yield File(f"{catalog.package}.md", render("docs/package.md.j2", package=catalog.package, pages=pages))


def _sections(interface: Interface) -> Iterator[Section]:
    match interface:
        case Message():
            yield _section("", interface)
        case Service():
            yield _section("Request", interface.request)
            yield _section("Response", interface.response)
        case Action():
            yield _section("Goal", interface.goal)
            yield _section("Result", interface.result)
            yield _section("Feedback", interface.feedback)


def _section(title: str, message: Message) -> Section:
    return Section(
        title,
        tuple(_escaped(line.strip()) for line in message.doc),
        tuple(_row(each, _shown(each.value)) for each in message.constants),
        tuple(_row(each, _shown(each.default), _escaped(each.unit or "")) for each in message.fields),
    )


def _row(declared: Field | Constant, *cells: str) -> str:
    doc = _escaped(" ".join(line.strip() for line in declared.doc if line))
    return " | ".join((f"| `{declared.name}`", _spell(declared.type), *cells, f"{doc} |"))


def _spell(type_: Type) -> str:
    match type_:
        case Primitive(name):
            return _IN_FILES.get(name, name)
        case String(wide, bound):
            return ("wstring" if wide else "string") + ("" if bound is None else _escaped(f"<={bound}"))
        case Named(name):
            return f"[{name.package}/{name.name}]({name.package}.md#{name})"
        case Array(of, size):
            return _spell(of) + _escaped(f"[{size}]")
        case Sequence(of, bound):
            return _spell(of) + _escaped("[]" if bound is None else f"[<={bound}]")


def _shown(value: Value | None) -> str:
    if value is None:
        return ""
    text = json.dumps(value, ensure_ascii=False)
    return _escaped(BIDI_CONTROLS.sub(lambda sign: f"\\u{ord(sign[0]):04x}", text))


def _escaped(text: str) -> str:
    return _MARKUP.sub(r"\\\1", _UNSEEN.sub(" ", text))
