"""Write interfaces as .idl files, in the form that rosidl_adapter generates."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from types import SimpleNamespace

from forge.base.templating import render
from forge.interfaces.model import (
    Action,
    Array,
    Catalog,
    Element,
    File,
    Interface,
    Message,
    Named,
    Primitive,
    Sequence,
    String,
    Type,
    Value,
    nested_types,
    sections_of,
)
from forge.interfaces.notation import BIDI_CONTROLS

_ESCAPES = str.maketrans(
    {sign: f"\\{word}" for sign, word in zip('\\"\n\t\r\v\b\f\a', '\\"ntrvbfa', strict=True)}
)
_HALVED = re.compile(r'\\{2,}|\\(?=")')
_ACTION_INCLUDES = {"builtin_interfaces/msg/Time.idl", "unique_identifier_msgs/msg/UUID.idl"}


def interface_files(catalog: Catalog) -> Callable[[Interface], Iterator[File]]:
    def files_of(interface: Interface) -> Iterator[File]:
        name = interface.name
        text = idl_text(interface, f"{name.package}/{catalog.sources[name].relative}")
        yield File(f"{name.package}/{name.kind}/{name.name}.idl", text)

    return files_of


def idl_text(interface: Interface, origin: str) -> str:
    """Return an interface as IDL; `origin` is the path of its definition, for the comment."""
    messages = sections_of(interface)
    includes = {f"{name.package}/{name.kind}/{name.name}.idl" for name in nested_types(messages)}
    if isinstance(interface, Action):
        includes |= _ACTION_INCLUDES
    return render(
        "idl/interface.idl.j2",
        origin=origin,
        includes=sorted(includes),
        package=interface.name.package,
        kind=interface.name.kind,
        structures=[_structure(message) for message in messages],
    )


def _structure(message: Message) -> SimpleNamespace:
    members = []
    for member in message.members:
        annotations = []
        if member.default is not None:
            annotations.append(f"@default (value={_literal(member.default, member.type)})")
        if member.unit is not None:
            annotations.append(f"@unit (value={_quoted(member.unit)})")
        members.append((_comment(member.doc, 8), annotations, f"{_type(member.type)} {member.name}"))
    return SimpleNamespace(
        name=message.name.name,
        comment=_comment(message.doc, 6),
        typedefs=dict.fromkeys(line for member in message.members for line in _typedefs(member.type)),
        constants=[
            (_comment(each.doc, 8), f"{_type(each.type)} {each.name} = {_literal(each.value, each.type)}")
            for each in message.constants
        ],
        members=members,
    )


def _comment(lines: tuple[str, ...], indent: int) -> str:
    return (' "\\n"\n' + " " * indent).join(_quoted(BIDI_CONTROLS.sub(" ", line)) for line in lines)


def _type(type_: Type) -> str:
    match type_:
        case Array(of, size):
            return f"{_identifier(of)}__{size}"
        case Sequence(of, None):
            return f"sequence<{_type(of)}>"
        case Sequence(of, bound):
            return f"sequence<{_type(of)}, {bound}>"
        case Named(name):
            return f"{name.package}::{name.kind}::{name.name}"
        case String(wide, bound):
            return ("wstring" if wide else "string") + (f"<{bound}>" if bound else "")
        case Primitive(name):
            return name


def _typedefs(type_: Type) -> Iterator[str]:
    """Yield the typedefs for a member of this type: rosidl declares arrays as typedefs."""
    if isinstance(type_, Array):
        identifier = _identifier(type_.of)
        if isinstance(type_.of, Named):
            yield f"{_type(type_.of)} {identifier}"
            yield f"{identifier} {identifier}__{type_.size}[{type_.size}]"
        else:
            yield f"{_type(type_.of)} {identifier}__{type_.size}[{type_.size}]"


def _identifier(element: Element) -> str:
    return _type(element).replace("::", "__").replace("<", "__").replace(">", "")


def _literal(value: Value, type_: Type) -> str:
    if isinstance(value, tuple):
        return _quoted(repr(value))
    if isinstance(type_, String):
        return _quoted(str(value))
    return str(value).upper() if isinstance(value, bool) else repr(value)


def _quoted(text: str) -> str:
    """Return a string literal; control characters without a named escape are written in octal.

    Backslashes before another one or before a quote are doubled twice, because rosidl unescapes them twice.
    """
    named = _HALVED.sub(lambda run: run[0] * 2, text).translate(_ESCAPES)
    return '"' + "".join(c if c >= " " else f"\\{ord(c):03o}" for c in named) + '"'
