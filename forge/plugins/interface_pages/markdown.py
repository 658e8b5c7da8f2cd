"""The target 'docs': one Markdown page with the interfaces of a package."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator

from forge.base.templating import render
from forge.interfaces.hashing import hashes
from forge.interfaces.model import Catalog, Constant, Field, File, Type, Value, sections_of
from forge.interfaces.notation import BIDI_CONTROLS, type_text
from forge.plugins.interface_pages.site import TITLES

_MARKUP = re.compile(r"([\\`*_<>\[\]|#])")
_UNSEEN = re.compile(f"[\0-\x1f\x7f-\x9f\u2028\u2029]|{BIDI_CONTROLS.pattern}")


def files(catalog: Catalog) -> Iterator[File]:
    """Yield 'PACKAGE.md'; links to other packages refer to pages in the same folder."""
    type_hashes = hashes(catalog)
    sections = {name: sections_of(interface) for name, interface in catalog.interfaces.items()}
    pages = [
        {
            "name": str(name),
            "kind": name.kind,
            "hash": type_hashes[name],
            "sections": [
                {
                    "title": title,
                    "doc": [_escaped(line.strip()) for line in message.doc],
                    "constants": [_row(each, _value(each.value)) for each in message.constants],
                    "fields": [
                        _row(each, _value(each.default), _escaped(each.unit or "")) for each in message.fields
                    ],
                }
                for title, message in zip(TITLES[len(messages)], messages, strict=True)
            ],
        }
        for name, messages in sections.items()
    ]
    text = render("interface_pages/templates/package.md.j2", package=catalog.package, pages=pages)
    yield File(f"{catalog.package}.md", text)


def _row(declared: Field | Constant, *cells: str) -> str:
    doc = _escaped(" ".join(line.strip() for line in declared.doc if line))
    return " | ".join((f"| `{declared.name}`", _type(declared.type), *cells, f"{doc} |"))


def _type(type_: Type) -> str:
    spelled = type_text(type_, "")
    link = f"[{spelled.word}]({spelled.name.package}.md#{spelled.name})" if spelled.name else None
    return (link or _escaped(spelled.word)) + _escaped(spelled.suffix)


def _value(value: Value | None) -> str:
    text = "" if value is None else json.dumps(value, ensure_ascii=False)
    return _escaped(BIDI_CONTROLS.sub(lambda sign: f"\\u{ord(sign[0]):04x}", text))


def _escaped(text: str) -> str:
    return _MARKUP.sub(r"\\\1", _UNSEEN.sub(" ", text))
