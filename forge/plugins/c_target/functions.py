"""The bodies of the C functions of a message: init, fini, are_equal and copy."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from forge.interfaces.cpp.headers import symbol
from forge.interfaces.cpp.text import quoted
from forge.interfaces.model import Array, Field, Message, Primitive, Sequence, String, Value
from forge.plugins.c_target.text import is_plain, number, numbers, spell, units


def functions_view(message: Message) -> dict[str, Any]:
    """Return the lines of each function of a message, and whether init() and copy() can run out of memory."""
    members = message.members
    init = _declare("done", (line for field in members for line in _init(field)))
    copy = _declare("done", (line for field in members for line in _copy(field)))
    return {
        "symbol": symbol(message.name),
        "tables": [line for field in members for line in _tables(field)],
        "init": init,
        "fallible_init": any(map(_uses("done"), init)),
        "fini": [line for field in members for line in _fini(field)],
        "are_equal": _declare("equal", (line for field in members for line in _are_equal(field))),
        "copy": copy,
        "fallible_copy": any(map(_uses("done"), copy)),
    }


def _declare(flag: str, lines: Iterable[str]) -> list[str]:
    """Declare the flag at its first use."""
    declared: list[str] = []
    pending = True
    uses = _uses(flag)
    step = f"{flag} = {flag} && "
    for line in lines:
        if pending and uses(line):
            pending = False
            if line.startswith(step):
                declared.append(f"bool {flag} = {line.removeprefix(step)}")
                continue
            declared.append(f"bool {flag} = true;")
        declared.append(line)
    return declared


def _uses(flag: str) -> Callable[[str], object]:
    """Return a function that finds the flag in a line, ignoring members of that name."""
    return re.compile(rf"(?<![\w>]){flag}\b").search


def _tables(field: Field) -> Iterator[str]:
    """Yield the arrays that defaults are copied from."""
    default = _default(field)
    match field.type:
        case Array(Primitive() as of) | Sequence(Primitive() as of) if default is not None:
            yield f"static const {spell(of)} default_{field.name}[] = {numbers(default, of)};"
        case String(wide=True) if default is not None:
            yield _wide_table(field.name, str(default))
        case Array(String(wide=True)) | Sequence(String(wide=True)):
            for position, item in enumerate(_items(field)):
                yield _wide_table(f"{position}_{field.name}", item)


def _wide_table(name: str, value: str) -> str:
    return f"static const uint_least16_t default_{name}[] = {units(value)};"


def _init(field: Field) -> Iterator[str]:
    """Yield the statements that initialize a zeroed member."""
    target, default = f"message->{field.name}", _default(field)
    if default is None:
        if not is_plain(field.type) and not isinstance(field.type, Sequence):
            yield from _step("done", "init", field, (f"&{target}",))
        return
    match field.type:
        case Primitive():
            yield f"{target} = {number(default, field.type)};"
        case Array(Primitive()):
            yield f"memcpy({target}, default_{field.name}, sizeof(default_{field.name}));"
        case String(wide):
            yield _assign(target, str(default), field.name, wide=wide)
        case Array(String(wide)):
            for position, item in enumerate(_items(field)):
                yield _assign(f"{target}[{position}]", item, f"{position}_{field.name}", wide=wide)
        case Sequence(of):
            yield f"done = done && {spell(field.type)}__init(&{target}, {len(_items(field))});"
            if isinstance(of, String):
                for position, item in enumerate(_items(field)):
                    element = f"{target}.data[{position}]"
                    yield _assign(element, item, f"{position}_{field.name}", wide=of.wide)
            else:
                yield "if (done) {"
                yield f"  memcpy({target}.data, default_{field.name}, sizeof(default_{field.name}));"
                yield "}"


def _assign(target: str, value: str, table: str, *, wide: bool) -> str:
    """Return the statement that assigns a string; one that contains NUL is passed with its length."""
    function = spell(String(wide=wide))
    if wide:
        size = len(value.encode("utf-16-le", "surrogatepass")) // 2
        return f"done = done && {function}__assignn(&{target}, default_{table}, {size});"
    if "\0" in value:
        size = len(value.encode("utf-8", "surrogatepass"))
        return f"done = done && {function}__assignn(&{target}, {quoted(value)}, {size});"
    return f"done = done && {function}__assign(&{target}, {quoted(value)});"


def _fini(field: Field) -> Iterator[str]:
    if is_plain(field.type):
        return
    if isinstance(field.type, Array):
        yield f"for (size_t i = 0; i < {field.type.size}; ++i) {{"
        yield f"  {spell(field.type.of)}__fini(&message->{field.name}[i]);"
        yield "}"
    else:
        yield f"{spell(field.type)}__fini(&message->{field.name});"


def _are_equal(field: Field) -> Iterator[str]:
    name = field.name
    if not is_plain(field.type):
        yield from _step("equal", "are_equal", field, (f"&lhs->{name}", f"&rhs->{name}"))
    elif isinstance(field.type, Array):
        yield f"for (size_t i = 0; equal && i < {field.type.size}; ++i) {{"
        yield f"  equal = lhs->{name}[i] == rhs->{name}[i];"
        yield "}"
    else:
        yield f"equal = equal && lhs->{name} == rhs->{name};"


def _copy(field: Field) -> Iterator[str]:
    name = field.name
    if not is_plain(field.type):
        yield from _step("done", "copy", field, (f"&input->{name}", f"&output->{name}"))
    elif isinstance(field.type, Array):
        yield f"memcpy(output->{name}, input->{name}, sizeof(output->{name}));"
    else:
        yield f"output->{name} = input->{name};"


def _step(flag: str, function: str, field: Field, arguments: tuple[str, ...]) -> Iterator[str]:
    """Yield the call of a function of a member, or of each element of an array, if no call before failed."""
    if isinstance(field.type, Array):
        call = f"{spell(field.type.of)}__{function}({', '.join(f'{each}[i]' for each in arguments)})"
        yield f"for (size_t i = 0; {flag} && i < {field.type.size}; ++i) {{"
        yield f"  {flag} = {call};"
        yield "}"
    else:
        yield f"{flag} = {flag} && {spell(field.type)}__{function}({', '.join(arguments)});"


def _default(field: Field) -> Value | None:
    """Return the default of a field, None if it is empty."""
    return None if field.default in ((), "") else field.default


def _items(field: Field) -> tuple[str, ...]:
    """Return the elements of a default, as text."""
    return tuple(map(str, field.default)) if isinstance(field.default, tuple) else ()
