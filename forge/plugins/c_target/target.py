"""The C target: C99 headers with the paths and names of rosidl_generator_c, which C++ can also include.

Functions are inline, so there is no library to link. Unlike with rosidl, wstring constants are supported.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import PurePosixPath
from typing import Any

from forge.base.templating import render
from forge.interfaces.cpp.headers import detail_path, guard, handles, main_path, needed, symbol
from forge.interfaces.cpp.text import comment, quoted
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
    Primitive,
    Sequence,
    Service,
    Source,
    String,
    TypeName,
    element_of,
    messages_of,
)
from forge.plugins.c_target.functions import functions_view
from forge.plugins.c_target.text import declare, fits_int, needs_math, number, spell, units

_TEMPLATES = "c_target/templates"
_MAX_LITERAL = 4095
"""The length of string literals that C99 compilers must support; they may warn about longer ones."""
_NEVER_ENUMERATED = frozenset({"boolean", "float", "double", "long double"})
_BYTES_PER_LINE = 8
_IMPLICIT = "implicit"
"""The encoding of types that no file defines, such as the request of a service."""


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
        name, messages, found = interface.name, tuple(messages_of(interface)), handles(interface)

        def file(path: str, template: str, headers: list[str], **names: object) -> File:
            names |= {"source": str(name), "guard": guard(path), "headers": headers}
            return File(path, render(f"{_TEMPLATES}/{template}.h.j2", **names))

        def part(template: str, headers: Iterable[str], first: tuple[str, ...] = (), **names: object) -> File:
            """Return a part, which includes the same part of the types that the interface needs."""
            nested = [detail_path(other, template, "h") for other in needed(interface)]
            path = detail_path(name, template, "h")
            return file(path, template, [*first, *sorted([*nested, *headers])], **names)

        yield file(main_path(name, "h"), "interface", [detail_path(name, each, "h") for each in parts])
        yield part(
            "struct",
            _runtime(messages, ""),
            math=any(needs_math(c.value, c.type) for message in messages for c in message.constants),
            messages=[_struct_view(message) for message in messages],
        )
        yield part(
            "functions",
            {"rosidl_runtime_c/sequence_functions.h", *_runtime(messages, "_functions")},
            (detail_path(name, "struct", "h"),),
            math=any(needs_math(f.default, f.type) for message in messages for f in message.fields),
            messages=[functions_view(message) for message in messages],
        )
        runtime = {f"rosidl_runtime_c/{handle.kind}_type_support_struct.h" for handle in found}
        headers = sorted([_visibility_path(name.package), *runtime])
        path = detail_path(name, "type_support", "h")
        yield file(path, "type_support", headers, package=name.package, handles=found)
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
    found = set()
    for field in (field for message in messages for field in message.members):
        match field.type:
            case String(wide) | Array(String(wide)) | Sequence(String(wide)):
                found.add(f"rosidl_runtime_c/{'u16string' if wide else 'string'}{suffix}.h")
            case Sequence(Primitive()):
                found.add(f"rosidl_runtime_c/primitives_sequence{suffix}.h")
    return found


def _struct_view(message: Message) -> dict[str, Any]:
    return {
        "symbol": symbol(message.name),
        "doc": comment(message.doc),
        "constants": [_constant(message, constant) for constant in message.constants],
        "bounds": [line for field in message.fields for line in _bounds(message, field)],
        "members": [
            {"doc": comment(f.doc, f.unit), "text": f"{declare(f.type, f.name)};"} for f in message.members
        ],
    }


def _constant(message: Message, constant: Constant) -> dict[str, Any]:
    """Return the definition of a constant: of a number as an enumerator if it can be one in C."""
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
    prefix = f"{symbol(message.name)}__{field.name}"
    if isinstance(field.type, Sequence) and field.type.bound is not None:
        yield _bound(f"{prefix}__MAX_SIZE", field.type.bound)
    of = element_of(field.type)
    if isinstance(of, String) and of.bound is not None:
        yield _bound(f"{prefix}__MAX_STRING_SIZE", of.bound)


def _bound(name: str, value: int) -> str:
    return f"enum {{ {name} = {value} }};" if fits_int(value) else f"static const size_t {name} = {value}u;"


def _description_views(
    interface: Interface, hasher: Hasher, sources: Mapping[TypeName, Source]
) -> Iterator[dict[str, Any]]:
    """Yield the description of each type of an interface, after those that it refers to.

    As rosidl generates them since Iron (REP 2011, REP 2016). Texts of fields and lines of the source are C
    literals.
    """
    kinds: dict[TypeName, str] = {}
    match interface:
        case Service():
            kinds = {interface.name: "service"}
        case Action():
            services = (interface.send_goal.name, interface.get_result.name)
            kinds = {interface.name: "action", **dict.fromkeys(services, "service")}
    for name in dict(structures_of(interface)):
        source = sources.get(name)  # None for derived types
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
