"""The C target: C99 headers with the paths and names of rosidl_generator_c, which C++ can also include.

Functions are inline, so there is no library to link. Unlike with rosidl, wstring constants are supported.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.base.templating import render
from forge.interfaces.cpp.headers import detail_path, guard, handles, main_path, needed, symbol
from forge.interfaces.cpp.text import comment, quoted
from forge.interfaces.hashing import Hasher
from forge.interfaces.model import Array, File, Primitive, Sequence, String, element_of, messages_of
from forge.plugins.c_target.descriptions import description_views
from forge.plugins.c_target.functions import functions_view
from forge.plugins.c_target.text import declare, fits_int, needs_math, number, spell, units

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from forge.interfaces.model import Catalog, Constant, Field, Interface, Message
    from forge.plugins.c_target.descriptions import DescriptionView

_TEMPLATES = "c_target/templates"
_PARTS = ("struct", "functions", "type_support")
_MAX_LITERAL = 4095
"""The length of string literals that C99 compilers must support; they may warn about longer ones."""
_NEVER_ENUMERATED = frozenset({"boolean", "float", "double", "long double"})


@frozen
class CommentedLine:
    """A declaration with a comment."""

    doc: tuple[str, ...]
    text: str


@frozen
class StructView:
    """The variables of the struct template."""

    symbol: str
    doc: tuple[str, ...]
    constants: tuple[CommentedLine, ...]
    bounds: tuple[str, ...]
    members: tuple[CommentedLine, ...]


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

    def headers_of(interface: Interface) -> Iterator[File]:
        yield _main(interface, (*_PARTS, "description") if hasher else _PARTS)
        yield _struct(interface)
        yield _functions(interface)
        yield _type_support(interface)
        if hasher:
            yield _description(interface, tuple(description_views(interface, hasher, catalog.sources)))

    return headers_of


def _main(interface: Interface, parts: tuple[str, ...]) -> File:
    """Return the header that users include."""
    headers = [detail_path(interface.name, part, "h") for part in parts]
    return _file(interface, main_path(interface.name, "h"), "interface", headers=headers)


def _struct(interface: Interface) -> File:
    """Return the header of structs and constants."""
    messages = tuple(messages_of(interface))
    detail = [detail_path(name, "struct", "h") for name in needed(interface)]
    return _file(
        interface,
        detail_path(interface.name, "struct", "h"),
        "struct",
        headers=sorted([*detail, *_runtime(messages, "")]),
        math=any(needs_math(c.value, c.type) for message in messages for c in message.constants),
        messages=[_struct_view(message) for message in messages],
    )


def _functions(interface: Interface) -> File:
    """Return the header of functions."""
    messages = tuple(messages_of(interface))
    detail = [detail_path(name, "functions", "h") for name in needed(interface)]
    runtime = ["rosidl_runtime_c/sequence_functions.h", *_runtime(messages, "_functions")]
    return _file(
        interface,
        detail_path(interface.name, "functions", "h"),
        "functions",
        headers=[detail_path(interface.name, "struct", "h"), *sorted([*detail, *runtime])],
        math=any(needs_math(f.default, f.type) for message in messages for f in message.fields),
        messages=[functions_view(message) for message in messages],
    )


def _type_support(interface: Interface) -> File:
    """Return the header that declares type support."""
    found = handles(interface)
    runtime = {f"rosidl_runtime_c/{handle.kind}_type_support_struct.h" for handle in found}
    return _file(
        interface,
        detail_path(interface.name, "type_support", "h"),
        "type_support",
        headers=sorted([_visibility_path(interface.name.package), *runtime]),
        package=interface.name.package,
        handles=found,
    )


def _description(interface: Interface, types: tuple[DescriptionView, ...]) -> File:
    """Return the header of type hashes and descriptions."""
    detail = [detail_path(name, "description", "h") for name in needed(interface)]
    return _file(
        interface,
        detail_path(interface.name, "description", "h"),
        "description",
        headers=sorted([*detail, "rosidl_runtime_c/detail/static_description.h"]),
        types=types,
        has_long_literals=any(len("".join(each.source)) > _MAX_LITERAL for each in types),
    )


def _file(interface: Interface, path: str, template: str, **names: object) -> File:
    template = f"{_TEMPLATES}/{template}.h.j2"
    return File(path, render(template, source=str(interface.name), guard=guard(path), **names))


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


def _struct_view(message: Message) -> StructView:
    return StructView(
        symbol=symbol(message.name),
        doc=comment(message.doc),
        constants=tuple(_constant(message, constant) for constant in message.constants),
        bounds=tuple(line for field in message.fields for line in _bounds(message, field)),
        members=tuple(
            CommentedLine(comment(f.doc, f.unit), f"{declare(f.type, f.name)};") for f in message.members
        ),
    )


def _constant(message: Message, constant: Constant) -> CommentedLine:
    """Return the definition of a constant."""
    name = f"{symbol(message.name)}__{constant.name}"
    match constant.type:
        case String(wide=True):
            text = f"static const uint_least16_t {name}[] = {units(str(constant.value))};"
        case String():
            text = f"static const char * const {name} = {quoted(str(constant.value))};"
        case Primitive() as type_:
            text = _numeric(name, type_, constant)
    return CommentedLine(comment(constant.doc), text)


def _numeric(name: str, type_: Primitive, constant: Constant) -> str:
    """Return the definition of a number: an enumerator if possible, which is a constant expression in C."""
    value = number(constant.value, type_)
    if type_.name not in _NEVER_ENUMERATED and fits_int(constant.value):
        return f"enum {{ {name} = {value} }};"
    return f"static const {spell(type_)} {name} = {value};"


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
