"""Find error-prone definitions: names that fail to compile, and lines with an unexpected meaning.

forge interprets such lines as rosidl does, for identical results; `--strict` reports them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from math import inf

from forge.base.errors import Location, Problem
from forge.base.names import CPP20_KEYWORDS
from forge.interfaces.enumerations import annotated_prefix, enumerations
from forge.interfaces.model import (
    HIDDEN_MEMBER,
    Array,
    Constant,
    Field,
    Message,
    Primitive,
    Sequence,
    Source,
    String,
    element_of,
    sections_of,
)
from forge.interfaces.read.literals import QUOTES
from forge.interfaces.read.parsing import Parsed, python_keywords, read_idl

_MACROS = "assert errno linux major makedev minor signals slots stderr stdin stdout unix"
_NAMES = {
    **dict.fromkeys(CPP20_KEYWORDS, "it is a keyword of C++20"),
    **dict.fromkeys(_MACROS.split(), "it is a macro in common headers"),
    **dict.fromkeys(
        ("get_constants", "get_fields_and_field_types"), "it shadows a method of the Python class"
    ),
}
_CONSTANT_NAMES = frozenset(
    """
    BUFSIZ DOMAIN EOF FALSE FAR HUGE_VAL IN INFINITY INT_MAX INT_MIN NAN NEAR NULL OUT OVERFLOW
    PLOSS RAND_MAX SING STRICT TLOSS TRUE UNDERFLOW
    """.split()
)
_FLOAT_MAX = 3.4028234663852886e38

_LEADING_ZERO = re.compile(r"[+-]?0+[0-9_]*[1-9][0-9_]*")
_NO_UNIT = re.compile(r"[^A-Za-z%°µμΩ]*|.*://.*|(\S+\s+){3,}\S+")
_BRACKETS = re.compile(r"\s*\[([^,\]]+)\]")
_MISREAD = re.compile(r"\\(?:\\|[nr]|u|U|N|x(?![0-9a-fA-F]{2}))")
_SIDE_BY_SIDE = re.compile(r"""["']\s+["']""")


def lint(parsed: Iterable[Parsed]) -> list[Problem]:
    """Return the problems of all files, in the order of files and lines."""
    all_problems = []
    for each in parsed:
        is_idl = each.source.relative.endswith(".idl")
        problems: list[Problem] = read_idl(each.source).warnings if is_idl else [*_comments(each.source)]
        for message in sections_of(each.interface):
            problems += _names(message) if is_idl else (*_lines(message), *_names(message))
            problems += _unused_annotations(message)
        problems += python_keywords([each.interface])
        all_problems += sorted(problems, key=lambda problem: problem.position)
    return all_problems


def _problem(place: Location | None, message: str, hint: str | None = None, *, at: str) -> Problem:
    """Return a problem in a line; its column is the position of the text `at`."""
    if place and at and place.source and at in place.source:
        place = Location(place.path, place.line, place.source.index(at) + 1, place.source)
    return Problem(message, place, hint)


def _names(message: Message) -> Iterator[Problem]:
    for field in message.fields:
        name, place = field.name, field.place
        if name in _NAMES:
            hint = f"rename it, for example to '{name}_value'"
            yield _problem(place, f"avoid the field name '{name}': {_NAMES[name]}", hint, at=name)
        if name == HIDDEN_MEMBER:
            yield _problem(place, "this name is reserved for empty messages", at=name)
    for constant in message.constants:
        if constant.name in _CONSTANT_NAMES:
            text = f"avoid the constant name '{constant.name}': it is a macro of C or Windows"
            yield _problem(constant.place, text, "use a more specific name", at=constant.name)
    # States with the same number; their names differ in the last word.
    states: dict[tuple[str, str, object], str] = {}
    for constant in message.constants:
        family = constant.name.rpartition("_")[0]
        if not family or not isinstance(constant.type, Primitive) or "int" not in constant.type.name:
            continue
        other = states.setdefault((family, constant.type.name, constant.value), constant.name)
        if other != constant.name:
            text = f"'{constant.name}' and '{other}' have the same value"
            yield _problem(constant.place, text, "use a different value", at=constant.name)


def _lines(message: Message) -> Iterator[Problem]:
    for field in message.fields:
        if field.default is not None:
            yield from _value(field)
        if field.unit is not None and _NO_UNIT.fullmatch(field.unit):
            text = f"'{field.unit}' is parsed as the unit of the field and removed from the comment"
            yield _problem(field.place, text, "remove the brackets", at=f"[{field.unit}]")
    for constant in message.constants:
        yield from _value(constant)


def _value(declared: Field | Constant) -> Iterator[Problem]:
    code, mark, _ = (declared.place.source or "" if declared.place else "").partition("#")
    _, rest = code.strip().split(maxsplit=1)
    text = rest.removeprefix(declared.name).strip().removeprefix("=").strip()
    element = element_of(declared.type)
    if isinstance(element, String):
        yield from _string(declared, text, is_cut=bool(mark))
    elif isinstance(element, Primitive):
        for part in text.strip("[]").split(","):
            yield from _number(declared.place, element, part.strip())


def _string(declared: Field | Constant, text: str, *, is_cut: bool) -> Iterator[Problem]:
    """Yield the problems of strings; a comment follows them if `is_cut`."""
    place = declared.place
    opened = text.lstrip("[ ")[:1]
    if opened and opened in QUOTES and text.replace(f"\\{opened}", "").count(opened) % 2:
        if is_cut:
            hint = "a string cannot contain '#'"
            yield _problem(place, "the string ends at '#', which starts a comment", hint, at="#")
        else:
            yield _problem(place, "this quote is not closed and becomes part of the string", at=opened)
    in_array = isinstance(declared.type, Array | Sequence)
    if in_array and _SIDE_BY_SIDE.search(text):
        yield _problem(place, "two strings without a comma between them become two elements", at=text)
    if "\t" in text:
        yield _problem(place, "a tab in a string becomes a space", "write '\\t'", at="\t")
    if in_array and not text.isascii():
        yield _problem(place, "rosidl fails on non-ASCII characters in string arrays", at=text)
    elif not in_array and (misread := _MISREAD.search(text)):
        message = f"rosidl interprets the escape '{misread[0]}' differently, or fails"
        yield _problem(place, message, "avoid it", at=misread[0])


def _number(place: Location | None, element: Primitive, text: str) -> Iterator[Problem]:
    if element.name not in {"float", "double"}:
        if _LEADING_ZERO.fullmatch(text):
            hint = f"write {int(text)}, or 0o{text.lstrip('+-0')} for the octal number"
            yield _problem(place, f"'{text}' is decimal, though it looks octal", hint, at=text)
    elif text.lstrip("+-").lower() in {"nan", "inf", "infinity"}:
        yield _problem(place, f"rosidl generates code for '{text}' that does not compile", at=text)
    elif text and (abs(float(text)) == inf or (element.name == "float" and abs(float(text)) > _FLOAT_MAX)):
        yield _problem(place, f"'{text}' is too large for the type and becomes infinite", at=text)
    if not text.isascii():
        yield _problem(place, f"'{text}' contains non-ASCII digits", at=text)


def _comments(source: Source) -> Iterator[Problem]:
    lines = source.text.removeprefix("\ufeff").splitlines()
    for number, line in enumerate(lines, 1):
        _, mark, comment = line.partition("#")
        if mark and "\\" in comment:
            column = line.index("\\", len(line) - len(comment)) + 1
            message = "rosidl reads a backslash in a comment as the start of an escape"
            yield Problem(message, Location(source.path, number, column, line), "avoid it")
    # rosidl removes brackets from the comment at the start of a .msg file.
    end = next((n for n, line in enumerate(lines) if not line.startswith("#")), len(lines))
    brackets = [(n, match) for n, line in enumerate(lines[:end], 1) for match in _BRACKETS.finditer(line)]
    if len(brackets) == 1 and source.relative.endswith(".msg"):
        number, match = brackets[0]
        message = f"'[{match[1]}]' is parsed as a unit and removed from the comment"
        place = Location(source.path, number, match.start(1), lines[number - 1])
        yield Problem(message, place, "remove the brackets")


def _unused_annotations(message: Message) -> Iterator[Problem]:
    """Yield a problem for each annotation that does not define an enumeration."""
    by_field = enumerations(message)
    for field in message.fields:
        if (prefix := annotated_prefix(field)) and field.name not in by_field:
            text = f"'enum: {prefix}*' does not define an enumeration for '{field.name}'"
            hint = (
                f"the field and all constants '{prefix}*' of the message must be integers, and fit its type"
            )
            yield Problem(text, field.place, hint)
