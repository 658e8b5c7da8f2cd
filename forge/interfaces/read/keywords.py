"""Names that are keywords of the languages for which code is generated."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable, Iterator
from dataclasses import replace

from forge.base.errors import Problem
from forge.base.names import python_attribute
from forge.interfaces.model import Interface, sections_of
from forge.interfaces.read.errors import ParseError

_CPP_KEYWORDS = """
    alignas alignof and and_eq asm auto bitand bitor bool break case catch char char16_t
    char32_t class compl const const_cast constexpr continue decltype default delete do double
    dynamic_cast else enum explicit export extern false float for friend goto if inline int long
    mutable namespace new noexcept not not_eq nullptr operator or or_eq private protected public
    register reinterpret_cast return short signed sizeof static static_assert static_cast struct
    switch template this thread_local throw true try typedef typeid typename union unsigned
    using virtual void volatile wchar_t while xor xor_eq
"""
_KEYWORDS = {
    "Python": frozenset(keyword.kwlist),
    "C++": frozenset(_CPP_KEYWORDS.split()),
    "C": frozenset({"restrict"}),  # the only keyword that is in neither of the others
}


def check_keyword(name: str, offset: int, what: str) -> None:
    """Raise ParseError if the name is a keyword of a target language; `what` is the kind of the name.

    A field may be named like a keyword of Python alone, as with rosidl; `python_keywords` warns about it.
    """
    languages = [language for language, words in _KEYWORDS.items() if name in words]
    if languages and not (what == "field" and languages == ["Python"]):
        raise ParseError(
            f"{what} name '{name}' is a keyword of {' and '.join(languages)}",
            offset=offset,
            hint=f"rename it, for example to '{name}_value'",
        )


def python_keywords(interfaces: Iterable[Interface]) -> Iterator[Problem]:
    """Yield a warning for each field that is named like a keyword of Python."""
    for interface in interfaces:
        for field in (field for message in sections_of(interface) for field in message.fields):
            attribute = python_attribute(field.name)
            if attribute != field.name:
                text = f"field name '{field.name}' is a keyword of Python, where it becomes '{attribute}'"
                place = field.place
                match = re.search(rf"\b{field.name}\b", place.source) if place and place.source else None
                if place and match:
                    place = replace(place, column=match.start() + 1)
                yield Problem(text, place, f"rename it, for example to '{field.name}_value'")
