"""C++ that serializes generated messages with Fast-CDR as ROS's type support does, for comparisons.

Each message has `serialized_size`, `serialize_members` and `deserialize_members`. They are not inlined,
because in ROS each is in a library of its own. The size is computed first, for a buffer of that size.
"""

from collections.abc import Iterable, Iterator, Mapping

from forge.interfaces.cpp.headers import main_path
from forge.interfaces.cpp.text import qualified
from forge.interfaces.model import (
    Array,
    Element,
    Field,
    Message,
    Named,
    Primitive,
    Sequence,
    String,
    TypeName,
)
from forge.interfaces.wire.layout import SIZES

HEADER = "/usr/include/fastcdr/Cdr.h"
"""The header in Debian's libfastcdr-dev."""

_START = """\
#pragma once
#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>
#include <string>
#include <vector>
"""
_DECLARED = """\
std::size_t serialized_size(const {type} & message, std::size_t offset);
void serialize_members(const {type} & message, eprosima::fastcdr::Cdr & cdr);
void deserialize_members(eprosima::fastcdr::Cdr & cdr, {type} & message);
"""
_DEFINED = """\
[[gnu::noinline]] std::size_t serialized_size(const {type} & message, std::size_t offset)
{{
  const std::size_t start = offset;
  {sizes}
  return offset - start;
}}

[[gnu::noinline]] void serialize_members(const {type} & message, eprosima::fastcdr::Cdr & cdr)
{{
  {writes}
}}

[[gnu::noinline]] void deserialize_members(eprosima::fastcdr::Cdr & cdr, {type} & message)
{{
  {reads}
}}
"""
_DRIVEN = """\
template<typename Message>
std::size_t peer_size(const Message & message)
{
  return 4 + serialized_size(message, 0);
}

template<typename Message>
void peer_serialize(const Message & message, char * data, std::size_t size)
{
  using eprosima::fastcdr::Cdr;
  eprosima::fastcdr::FastBuffer buffer(data, size);
  Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
  cdr.serialize_encapsulation();
  serialize_members(message, cdr);
}

template<typename Message>
void peer_deserialize(const char * data, std::size_t size, Message & message)
{
  using eprosima::fastcdr::Cdr;
  eprosima::fastcdr::FastBuffer buffer(const_cast<char *>(data), size);
  Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
  cdr.read_encapsulation();
  deserialize_members(cdr, message);
}
"""


def declarations(names: Iterable[TypeName], known: Mapping[TypeName, Message]) -> str:
    """Return a header that declares the functions of the named messages and all nested ones."""
    below = _below(names, known)
    headers = sorted({main_path(_owner(name), "hpp") for name in below})
    includes = "".join(f'#include "{header}"\n' for header in headers)
    declared = "".join(_DECLARED.format(type=qualified(name)) for name in below)
    return f"{_START}{includes}\n{declared}\n{_DRIVEN}"


def definitions(names: Iterable[TypeName], known: Mapping[TypeName, Message], header: str) -> str:
    """Return the source of the functions in the header."""
    defined = "\n".join(_defined(known[name]) for name in _below(names, known))
    return f'#include "{header}"\n\nusing eprosima::fastcdr::Cdr;\n\n{defined}'


def _owner(name: TypeName) -> TypeName:
    """Return the interface that defines a message."""
    return name if name.kind == "msg" else TypeName(name.package, name.kind, name.name.partition("_")[0])


def _below(names: Iterable[TypeName], known: Mapping[TypeName, Message]) -> list[TypeName]:
    """Return the messages and all nested ones, each after those that it contains."""
    found: dict[TypeName, None] = {}
    for name in names:
        inner = (getattr(field.type, "of", field.type) for field in known[name].members)
        needs = [of.name for of in inner if isinstance(of, Named)]
        found.update(dict.fromkeys([*_below(needs, known), name]))
    return list(found)


def _defined(message: Message) -> str:
    lines: dict[str, list[str]] = {"sizes": [], "writes": [], "reads": []}
    for field in message.members:
        lines["sizes"] += _sizes(field)
        lines["writes"] += _moves(field, "<<")
        lines["reads"] += _moves(field, ">>")
    joined = {word: "\n  ".join(statements) for word, statements in lines.items()}
    return _DEFINED.format(type=qualified(message.name), **joined)


def _sizes(field: Field) -> Iterator[str]:
    path = f"message.{field.name}"
    match field.type:
        case Primitive(name):
            yield f"offset += {SIZES[name]} + Cdr::alignment(offset, {SIZES[name]});"
        case Array(of) | Sequence(of):
            if isinstance(field.type, Sequence):
                yield "offset += 4 + Cdr::alignment(offset, 4);"
            if isinstance(of, Primitive):
                size = SIZES[of.name]
                counted = f"offset += {path}.size() * {size} + Cdr::alignment(offset, {size});"
                yield f"if ({path}.size() > 0) {{{counted}}}"
            else:
                yield f"for (const auto & item : {path}) {{{_size('item', of)}}}"
        case _:
            yield _size(path, field.type)


def _size(path: str, type_: Element) -> str:
    match type_:
        case String(wide):
            counted = f"4 * {path}.size()" if wide else f"{path}.size() + 1"
            return f"offset += 4 + Cdr::alignment(offset, 4) + {counted};"
        case _:
            return f"offset += serialized_size({path}, offset);"


def _moves(field: Field, arrow: str) -> Iterator[str]:
    """Yield the statements that write (<<) or read (>>) a member."""
    path, type_ = f"message.{field.name}", field.type
    of = getattr(type_, "of", None)
    plain = isinstance(of, Primitive) or (isinstance(of, String) and not of.wide)
    if of is None:
        yield _move(path, type_, arrow)  # type: ignore[arg-type]  # no collection
    elif plain and (isinstance(type_, Array) or getattr(type_, "bound", 0) is None):
        yield f"cdr {arrow} {path};"
    else:
        if isinstance(type_, Sequence):
            yield from _counted(path, arrow)
        yield from _each(path, of, arrow)


def _counted(path: str, arrow: str) -> Iterator[str]:
    if arrow == "<<":
        yield f"cdr << static_cast<uint32_t>({path}.size());"
    else:
        yield f"{{uint32_t size; cdr >> size; {path}.resize(size);}}"


def _each(path: str, of: Element, arrow: str) -> Iterator[str]:
    if isinstance(of, Primitive) and of.name == "boolean" and arrow == ">>":
        yield f"for (std::size_t at = 0; at < {path}.size(); ++at) {{bool b; cdr >> b; {path}[at] = b;}}"
    else:
        item = "const auto & item" if arrow == "<<" else "auto & item"
        yield f"for ({item} : {path}) {{{_move('item', of, arrow)}}}"


def _move(path: str, type_: Element, arrow: str) -> str:
    match type_:
        case Named():
            call = f"serialize_members({path}, cdr)" if arrow == "<<" else f"deserialize_members(cdr, {path})"
            return f"{call};"
        case String(wide=True) if arrow == "<<":
            return f"cdr << std::wstring({path}.begin(), {path}.end());"
        case String(wide=True):
            return f"{{std::wstring wide; cdr >> wide; {path}.assign(wide.begin(), wide.end());}}"
        case Primitive("boolean") if arrow == "<<":
            return f"cdr << (bool) {path};"
        case Primitive("boolean"):
            return f"{{bool flag; cdr >> flag; {path} = flag;}}"
        case _:
            return f"cdr {arrow} {path};"
