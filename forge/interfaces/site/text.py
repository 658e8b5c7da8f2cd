"""What HTML pages say of types, values and comments: finished words; templates escape them."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.interfaces.model import Array, Named, Primitive, Sequence, String, TypeName

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from forge.interfaces.model import Element, Type, Value

KINDS = {"msg": ("message", "messages"), "srv": ("service", "services"), "action": ("action", "actions")}
"""What interfaces of a kind are called, one and several."""

_IN_FILES = {"boolean": "bool", "octet": "byte", "float": "float32", "double": "float64"}
_DRAWN = re.compile(r"^\s|\S {2,}\S|\t", re.MULTILINE)
_SENTENCE = re.compile(r"(.+?[.!?])(?:\s|$)")
_LONGEST_SUMMARY = 160
_PICTURES = {
    **{code: chr(0x2400 + code) for code in range(0x20) if chr(code) not in "\n\t"},
    **dict.fromkeys(
        (*range(0x7F, 0xA0), *range(0x202A, 0x202F), *range(0x2066, 0x206A)), "\N{REPLACEMENT CHARACTER}"
    ),
}
"""Control characters, and those that change the direction of writing."""


@frozen
class TypeText:
    """A type as definitions have it: a word, perhaps with the interface that it names, and what follows."""

    word: str
    name: TypeName | None = None
    suffix: str = ""


@frozen
class Paragraph:
    """A part of a comment; one that is drawn keeps its columns."""

    text: str
    drawn: bool = False


def kind_of(name: TypeName) -> str:
    """Return what an interface is called; what is in another folder of .idl files is a message."""
    return KINDS.get(name.kind, KINDS["msg"])[0]


def type_text(type_: Type, package: str) -> TypeText:
    """Return a type as a definition of `package` has it."""
    match type_:
        case Array(of, size):
            return _spell(of, package, f"[{size}]")
        case Sequence(of, bound):
            return _spell(of, package, "[]" if bound is None else f"[<={bound}]")
        case _:
            return _spell(type_, package, "")


def value_text(value: Value | None) -> str:
    """Return a value much as definitions have it; nothing for none."""
    return "" if value is None else visible(json.dumps(value, ensure_ascii=False))


def paragraphs(doc: Iterable[str]) -> tuple[Paragraph, ...]:
    """Return a comment, cut at its empty lines."""
    blocks = re.split(r"\n(?:[ \t]*\n)+", visible("\n".join(doc)).strip("\n"))
    return tuple(Paragraph(block, drawn=bool(_DRAWN.search(block))) for block in blocks if block.strip())


def summary(doc: Iterable[str]) -> str:
    """Return the first sentence of a comment, on one line; nothing where there is no comment."""
    first = " ".join(" ".join(_first_block(doc)).split())
    sentence = _SENTENCE.match(first)
    text = sentence[1] if sentence else first
    return visible(text if len(text) <= _LONGEST_SUMMARY else f"{text[:_LONGEST_SUMMARY].rstrip()} …")


def visible(text: str) -> str:
    """Return a text without what hides or turns the rest: control characters stand as pictures."""
    return text if text.isascii() and text.isprintable() else text.translate(_PICTURES)


def _first_block(doc: Iterable[str]) -> Iterator[str]:
    """Yield the lines up to the first empty one."""
    begun = False
    for line in doc:
        if line.strip():
            begun = True
            yield line
        elif begun:
            return


def _spell(of: Element, package: str, suffix: str) -> TypeText:
    match of:
        case Primitive(name):
            return TypeText(_IN_FILES.get(name, name), None, suffix)
        case String(wide, bound):
            limit = "" if bound is None else f"<={bound}"
            return TypeText(("wstring" if wide else "string") + limit, None, suffix)
        case Named(name):
            word = name.name if name.package == package else f"{name.package}/{name.name}"
            return TypeText(word, name, suffix)
