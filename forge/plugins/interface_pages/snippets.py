"""Example code in Python and C++ that creates the messages of an interface."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from forge.base.frozen import frozen
from forge.base.names import snake_case
from forge.interfaces.model import (
    Action,
    Array,
    Interface,
    Message,
    Named,
    Primitive,
    Sequence,
    Service,
    String,
    Type,
    TypeName,
)

_ASSIGNMENTS = 2
_DEPTH = 3
_PYTHON = {"boolean": "True", "octet": 'b"\\x01"', "char": "1", "float": "1.0", "double": "1.0"}
_CPP = {"boolean": "true", "float": "1.0F", "double": "1.0"}
_WORD = "text"


@frozen
class _Leaf:
    """A member to assign: its path, and a value in each language."""

    path: str
    python: str
    cpp: str


def snippets(interface: Interface, known: Mapping[TypeName, Message]) -> dict[str, str]:
    """Return the example for an interface in both languages; `known` contains all nested messages."""
    name = interface.name
    python = [f"from {name.package}.{name.kind} import {name.name}", ""]
    cpp = [f'#include "{name.package}/{name.kind}/{snake_case(name.name)}.hpp"', ""]
    for variable, part, message in _variables(interface):
        leaves = _leaves(message, known)
        python += [
            f"{variable} = {name.name}{part}()",
            *(f"{variable}.{e.path} = {e.python}" for e in leaves),
        ]
        type_ = f"{name.package}::{name.kind}::{name.name}{part.replace('.', '::')}"
        cpp += [f"{type_} {variable};", *(f"{variable}.{each.path} = {each.cpp};" for each in leaves)]
    return {"python": "\n".join(python) + "\n", "cpp": "\n".join(cpp) + "\n"}


def _variables(interface: Interface) -> Iterator[tuple[str, str, Message]]:
    """Yield each message to create: the variable's name, the suffix of the class name, the message."""
    match interface:
        case Message():
            yield "message", "", interface
        case Service(_, request, response):
            yield "request", ".Request", request
            yield "response", ".Response", response
        case Action(_, goal, result, feedback):
            yield "goal", ".Goal", goal
            yield "feedback", ".Feedback", feedback
            yield "result", ".Result", result


def _leaves(message: Message, known: Mapping[TypeName, Message]) -> list[_Leaf]:
    """Return a few members that one statement can assign, direct members before nested ones."""
    found = (_leaf(member.name, member.type, known, _DEPTH) for member in message.fields)
    leaves = [leaf for leaf in found if leaf]
    return sorted(leaves, key=lambda leaf: leaf.path.count("."))[:_ASSIGNMENTS]


def _leaf(path: str, type_: Type, known: Mapping[TypeName, Message], depth: int) -> _Leaf | None:
    match type_:
        case Primitive(name) if name != "wchar":
            return _Leaf(path, _PYTHON.get(name, "1"), _CPP.get(name, "1"))
        case String(wide, bound):
            word = _WORD[:bound]
            return _Leaf(path, f'"{word}"', f'{"u" if wide else ""}"{word}"')
        case Named(name) if depth:
            below = (_leaf(f"{path}.{m.name}", m.type, known, depth - 1) for m in known[name].fields)
            return next((leaf for leaf in below if leaf), None)
        case Array(Primitive(name)) if name not in {"wchar", "octet"}:
            return _Leaf(f"{path}[0]", _PYTHON.get(name, "1"), _CPP.get(name, "1"))
        case Sequence(Primitive(name)) if name not in {"wchar", "octet"}:
            return _Leaf(path, f"[{_PYTHON.get(name, '1')}]", f"{{{_CPP.get(name, '1')}}}")
        case _:
            return None
