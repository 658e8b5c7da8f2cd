"""The C target: C99 headers with the paths and names of rosidl_generator_c, which C++ can also include.

Functions are inline, so there is no library to link. Unlike rosidl, it supports wstring constants.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import PurePosixPath
from typing import Any

from forge.base.templating import render
from forge.interfaces.cpp.headers import detail_path, guard, handles, main_path, needed, symbol
from forge.interfaces.cpp.text import comment, literal, nearest_single, quoted
from forge.interfaces.hashing import Hasher, described_type, structures_of
from forge.interfaces.model import (
    Action,
    Array,
    Catalog,
    Constant,
    Field,
    File,
    Interface,
    Message,
    Named,
    Primitive,
    Sequence,
    Service,
    Source,
    String,
    Type,
    TypeName,
    Value,
    element_of,
    messages_of,
)

_TEMPLATES = "c_target/templates"
_MAX_LITERAL = 4095
"""The length of string literals that C99 compilers must support; they may warn about longer ones."""
_NEVER_ENUMERATED = frozenset({"boolean", "float", "double", "long double"})
_BYTES_PER_LINE = 8
_IMPLICIT = "implicit"
"""The encoding of types that no file defines, such as the request of a service."""

_ARITHMETIC = {
    "boolean": "bool",
    "octet": "uint8_t",
    "char": "signed char",
    "wchar": "uint16_t",
    "float": "float",
    "double": "double",
    "long double": "long double",
    **{f"{sign}int{bits}": f"{sign}int{bits}_t" for sign in ("", "u") for bits in (8, 16, 32, 64)},
}
_REALS = frozenset({"float", "double", "long double"})
_INFINITIES = {"float": "HUGE_VALF", "double": "HUGE_VAL", "long double": "HUGE_VALL"}
_INT = range(-(1 << 31), 1 << 31)
_SIGNED_CHAR = range(-128, 128)


def files(catalog: Catalog) -> Iterator[File]:
    """Yield the headers of all interfaces; paths are relative to the include folder."""
    yield from package_files(catalog)
    headers_of = interface_files(catalog)
    for interface in catalog.interfaces.values():
        yield from headers_of(interface)


def package_files(catalog: Catalog) -> Iterator[File]:
    """Yield the header that all interfaces of a package share."""
    path = _visibility_path(catalog.package)
    text = render(f"{_TEMPLATES}/visibility_control.h.j2", guard=guard(path), package=catalog.package)
    yield File(path, text)


def interface_files(catalog: Catalog) -> Callable[[Interface], Iterator[File]]:
    """Return a function that yields the headers of one interface."""
    hasher = Hasher(catalog) if catalog.has_descriptions else None
    parts = ("struct", "functions", "type_support", *(("description",) if hasher else ()))

    def headers_of(interface: Interface) -> Iterator[File]:
        name, messages, interface_handles = interface.name, tuple(messages_of(interface)), handles(interface)

        def file(path: str, template: str, headers: list[str], **names: object) -> File:
            names |= {"source": str(name), "guard": guard(path), "headers": headers}
            return File(path, render(f"{_TEMPLATES}/{template}.h.j2", **names))

        def part(template: str, headers: Iterable[str], first: tuple[str, ...] = (), **names: object) -> File:
            """Return a part of an interface, which includes the same parts of the types that it needs."""
            nested = [detail_path(other, template, "h") for other in needed(interface)]
            path = detail_path(name, template, "h")
            return file(path, template, [*first, *sorted([*nested, *headers])], **names)

        yield file(main_path(name, "h"), "interface", [detail_path(name, each, "h") for each in parts])
        yield part(
            "struct",
            _runtime(messages, ""),
            math=any(
                needs_math(constant.value, constant.type)
                for message in messages
                for constant in message.constants
            ),
            messages=[_struct_view(message) for message in messages],
        )
        yield part(
            "functions",
            {"rosidl_runtime_c/sequence_functions.h", *_runtime(messages, "_functions")},
            (detail_path(name, "struct", "h"),),
            math=any(
                needs_math(field.default, field.type) for message in messages for field in message.fields
            ),
            messages=[functions_view(message) for message in messages],
        )
        runtime = {f"rosidl_runtime_c/{handle.kind}_type_support_struct.h" for handle in interface_handles}
        headers = sorted([_visibility_path(name.package), *runtime])
        path = detail_path(name, "type_support", "h")
        yield file(path, "type_support", headers, package=name.package, handles=interface_handles)
        if hasher:
            types = list(_description_views(interface, hasher, catalog.sources))
            yield part(
                "description",
                ["rosidl_runtime_c/detail/static_description.h"],
                types=types,
                has_long_literals=any(len("".join(each["source"])) > _MAX_LITERAL for each in types),
            )

    return headers_of


def _visibility_path(package: str) -> str:
    return f"{package}/msg/rosidl_generator_c__visibility_control.h"


def _runtime(messages: tuple[Message, ...], suffix: str) -> set[str]:
    """Return the run-time headers for the types of members."""
    headers = set()
    for field in (field for message in messages for field in message.members):
        match field.type:
            case String(wide) | Array(String(wide)) | Sequence(String(wide)):
                headers.add(f"rosidl_runtime_c/{'u16string' if wide else 'string'}{suffix}.h")
            case Sequence(Primitive()):
                headers.add(f"rosidl_runtime_c/primitives_sequence{suffix}.h")
    return headers


def _struct_view(message: Message) -> dict[str, Any]:
    return {
        "symbol": symbol(message.name),
        "doc": comment(message.doc),
        "constants": [_constant(message, constant) for constant in message.constants],
        "bounds": [line for field in message.fields for line in _bounds(message, field)],
        "members": [
            {"doc": comment(field.doc, field.unit), "text": f"{declare(field.type, field.name)};"}
            for field in message.members
        ],
    }


def _constant(message: Message, constant: Constant) -> dict[str, Any]:
    """Return the definition of a constant; numbers become enumerators if C allows it."""
    name = f"{symbol(message.name)}__{constant.name}"
    match constant.type:
        case String(wide=True):
            text = f"static const uint_least16_t {name}[] = {units(str(constant.value))};"
        case String():
            text = f"static const char * const {name} = {quoted(str(constant.value))};"
        case Primitive() as type_:
            value = number(constant.value, type_)
            # Unlike a variable, an enumerator is a constant expression.
            if type_.name not in _NEVER_ENUMERATED and fits_int(constant.value):
                text = f"enum {{ {name} = {value} }};"
            else:
                text = f"static const {spell(type_)} {name} = {value};"
    return {"doc": comment(constant.doc), "text": text}


def _bounds(message: Message, field: Field) -> Iterator[str]:
    """Yield the definitions of the upper bounds of sequences and strings."""
    of = element_of(field.type)
    bounds = {
        "MAX_SIZE": field.type.bound if isinstance(field.type, Sequence) else None,
        "MAX_STRING_SIZE": of.bound if isinstance(of, String) else None,
    }
    for suffix, bound in bounds.items():
        name = f"{symbol(message.name)}__{field.name}__{suffix}"
        if bound is not None and fits_int(bound):
            yield f"enum {{ {name} = {bound} }};"
        elif bound is not None:
            yield f"static const size_t {name} = {bound}u;"


def _description_views(
    interface: Interface, hasher: Hasher, sources: Mapping[TypeName, Source]
) -> Iterator[dict[str, Any]]:
    """Yield the description of each type of an interface, after those that it refers to.

    The format is that of rosidl since Iron (REP 2011, REP 2016). Texts of fields and lines of the source are
    C literals.
    """
    kinds: dict[TypeName, str] = {}
    match interface:
        case Service():
            kinds = {interface.name: "service"}
        case Action():
            services = (interface.send_goal.name, interface.get_result.name)
            kinds = {interface.name: "action", **dict.fromkeys(services, "service")}
    for name in dict(structures_of(interface)):
        source = sources.get(name)  # no source for derived types
        text = source.text if source else ""
        digits = hasher.hash(name).partition("_")[2]
        values = [f"0x{digits[at : at + 2]}" for at in range(0, len(digits), 2)]
        starts = range(0, len(values), _BYTES_PER_LINE)
        yield {
            "name": str(name),
            "symbol": symbol(name),
            "kind": kinds.get(name, "message"),
            "hash_lines": [", ".join(values[at : at + _BYTES_PER_LINE]) for at in starts],
            "fields": [
                {
                    "name": quoted(field["name"]),
                    "default": quoted(field["default_value"]),
                    "nested": quoted(field["type"]["nested_type_name"]),
                    **{key: field["type"][key] for key in ("type_id", "capacity", "string_capacity")},
                }
                for field in described_type(hasher, name)["fields"]
            ],
            "referenced": [(str(other), symbol(other)) for other in hasher.referenced(name)],
            "encoding": PurePosixPath(source.relative).suffix.removeprefix(".") if source else _IMPLICIT,
            "source": [quoted(line) for line in text.splitlines(keepends=True) or [""]],
        }


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
    """Yield the call of a function for a member or for array elements, unless an earlier call failed."""
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
    return tuple(map(str, field.default)) if isinstance(field.default, tuple) else ()


def spell(type_: Primitive | String | Named | Sequence) -> str:
    """Return the type of a member, or of the elements of an array."""
    match type_:
        case Primitive(name):
            return _ARITHMETIC[name]
        case String(wide):
            return "rosidl_runtime_c__U16String" if wide else "rosidl_runtime_c__String"
        case Named(name):
            return symbol(name)
        case Sequence(Primitive(name)):
            return f"rosidl_runtime_c__{name.replace(' ', '_')}__Sequence"
        case Sequence(of):
            return f"{spell(of)}__Sequence"


def declare(type_: Type, name: str) -> str:
    if isinstance(type_, Array):
        return f"{spell(type_.of)} {name}[{type_.size}]"
    return f"{spell(type_)} {name}"


def number(value: Value, type_: Primitive) -> str:
    """Return an expression of exactly this value, for a member or constant of this type."""
    if type_.name in _REALS and isinstance(value, int | float):
        return _real(float(value), type_)
    text = literal(value, type_)
    return f"(signed char){text}" if type_.name == "char" and int(text) not in _SIGNED_CHAR else text


def numbers(value: Value, of: Primitive) -> str:
    items = value if isinstance(value, tuple) else (value,)
    return "{" + ", ".join(number(item, of) for item in items) + "}"


def units(value: str) -> str:
    """Return the initializer of a zero-terminated array of UTF-16 code units, as C99 has no u"..." literals.

    Printable ASCII characters are character literals.
    """
    data = value.encode("utf-16-le", "surrogatepass")
    codes = [int.from_bytes(data[at : at + 2], "little") for at in range(0, len(data), 2)]
    signs = (
        f"'{chr(code)}'" if " " <= chr(code) <= "~" and chr(code) not in "'\\" else f"0x{code:04x}"
        for code in codes
    )
    return "{" + ", ".join([*signs, "0"]) + "}"


def fits_int(value: Value) -> bool:
    """Return True if an enumerator of C99 can have the value; its type is int."""
    return isinstance(value, int) and value in _INT


def is_plain(type_: Type) -> bool:
    """Return True if values of the type own no memory."""
    return isinstance(type_, Primitive) or (isinstance(type_, Array) and isinstance(type_.of, Primitive))


def needs_math(value: Value | None, type_: Type) -> bool:
    """Return True if the value needs a macro of <math.h>."""
    of = element_of(type_)
    if not isinstance(of, Primitive) or of.name not in _REALS or value is None:
        return False
    return any(text in numbers(value, of) for text in ("NAN", "HUGE_VAL"))


def _real(value: float, type_: Primitive) -> str:
    if type_.name == "float":
        value = nearest_single(value)
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return ("-" if value < 0 else "") + _INFINITIES[type_.name]
    return literal(value, type_)
