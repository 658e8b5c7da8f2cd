"""Generate a Python module per interface file, with the names and behaviour of rosidl_generator_py.

Code shared by all messages is in the run-time package forge_rosidl. Generated names that are not from a
definition start with '_', so that they cannot conflict with the name of a field.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.base.names import snake_case
from forge.base.templating import render
from forge.interfaces.model import Action, File, TypeName, messages_of, nested_types, services_of
from forge.interfaces.python.fields import BUILTINS, FieldView, Scope, view_field
from forge.interfaces.python.stubs import StubNames, shadowed_builtins, stub_imports, view_stub
from forge.interfaces.python.types import literal

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from forge.interfaces.model import Catalog, Interface, Message

_CANCEL = TypeName("action_msgs", "srv", "CancelGoal")
_STATUS = TypeName("action_msgs", "msg", "GoalStatusArray")


@frozen
class _MessageView:
    """A message class, for the template."""

    name: str
    doc_end: str
    constants: tuple[tuple[str, str], ...]
    defaults: tuple[tuple[str, str], ...]
    fresh: tuple[str, ...]
    fields: tuple[FieldView, ...]
    own: str


def files(catalog: Catalog) -> Iterator[File]:
    """Yield the files of the Python package; paths are relative to a folder on the Python path."""
    yield from package_files(catalog)
    for interface in catalog.interfaces.values():
        yield from _interface(interface)


def package_files(catalog: Catalog) -> Iterator[File]:
    """Yield the __init__ modules and the py.typed marker of a package."""
    yield File(f"{catalog.package}/__init__.py", "")
    yield File(f"{catalog.package}/py.typed", "")
    for kind in sorted({name.kind for name in catalog.interfaces}):
        names = [name.name for name in catalog.interfaces if name.kind == kind]
        members = sorted((f"_{snake_case(name)}", name) for name in names)
        for ending in ("py", "pyi"):
            template = f"python/namespace.{ending}.j2"
            text = render(template, package=catalog.package, kind=kind, members=members)
            yield File(f"{catalog.package}/{kind}/__init__.{ending}", text)


def interface_files(_: Catalog, root: str = "") -> Callable[[Interface], Iterator[File]]:
    """Return a function that yields the module of one interface and its stub.

    `root` precedes the names of imported packages; with "..." the folder of all packages is a package itself.
    """
    return partial(_interface, root=root)


def _interface(interface: Interface, root: str = "") -> Iterator[File]:
    messages = tuple(messages_of(interface))
    imported = _imported(interface, messages)
    classes = imported | {message.name: message.name.name for message in messages}
    path = module_name(interface.name).replace(".", "/")
    services = services_of(interface)
    is_action = isinstance(interface, Action)
    shared = {
        "title": str(interface.name),
        "imported": [(f"{root}{module_name(name)}", name.name, local) for name, local in imported.items()],
        "decorator": _decorator(messages),
        "services": [
            {
                "name": service.name.name,
                "request": service.request.name.name,
                "response": service.response.name.name,
                "event": service.event.name.name if service.has_events else None,
            }
            for service in services
        ],
        "action": is_action
        and {"name": interface.name.name, "cancel": classes[_CANCEL], "status": classes[_STATUS]},
    }
    views = [_message(message, classes) for message in messages]
    text = render("python/interface.py.j2", **shared, messages=views, imports=_imports(views, messages))
    yield File(f"{path}.py", text)
    stub_names = StubNames(classes, shadowed_builtins(messages))
    stubs = [view_stub(message, stub_names) for message in messages]
    lines = stub_imports(messages, stub_names.shadowed, aliases=bool(services))
    yield File(f"{path}.pyi", render("python/interface.pyi.j2", **shared, messages=stubs, imports=lines))


def module_name(name: TypeName) -> str:
    """Return the full name of the module of an interface."""
    return f"{name.package}.{name.kind}._{snake_case(name.name)}"


def _imported(interface: Interface, messages: Sequence[Message]) -> dict[TypeName, str]:
    imported_names = nested_types(messages)
    if isinstance(interface, Action):
        imported_names |= {_CANCEL, _STATUS}
    own = {message.name for message in messages}
    imported_names -= own
    defined = {interface.name, *own, *(service.name for service in services_of(interface))}
    # A field shadows a class in constructors.
    shadowed = {field.name for message in messages for field in message.fields}
    taken = [*(name.name for name in imported_names), *shadowed.union(name.name for name in defined)]
    return {
        name: name.name if taken.count(name.name) == 1 else f"_{name.package}_{name.kind}_{name.name}"
        for name in sorted(imported_names)
    }


def _imports(views: Sequence[_MessageView], messages: Sequence[Message]) -> list[str]:
    needs = {need for view in views for field in view.fields for need in field.needs}
    lines = ["from array import array as _array"] if "array" in needs else []
    if _decorator(messages) != "property":
        lines.append("from builtins import property as _property")
    if lines:
        lines.append("")
    lines += ["import numpy as _numpy"] * ("numpy" in needs)
    lines += ["from numpy import zeros as _zeros"] * ("zeros" in needs)
    lines += ["from forge_rosidl import arrays as _arrays"] * ("arrays" in needs)
    lines += ["from forge_rosidl import checks as _checks", "from forge_rosidl import messages as _messages"]
    if any(view.fields for view in views):
        lines.append("from rosidl_parser import definition as _definition")
    empty = sorted(need for need in needs if need.startswith("no_"))
    return lines + [f"from forge_rosidl.empty import {word} as _{word}" for word in empty]


def _decorator(messages: Sequence[Message]) -> str:
    """Return the local name of `property`, which a field of that name shadows."""
    shadowed = any(field.name == "property" for message in messages for field in message.fields)
    return "_property" if shadowed else "property"


def _message(message: Message, classes: Mapping[TypeName, str]) -> _MessageView:
    names = {field.name for field in message.fields}
    own = "_self" if "self" in names else "self"
    scope = Scope(classes, own, direct=not names & BUILTINS)
    fields = tuple(view_field(field, scope) for field in message.fields)
    constants = tuple((c.name, literal(c.type, c.value)) for c in message.constants)
    defaults = tuple((field.default_name, field.default) for field in fields if field.default is not None)
    changeable = {field.name for field in message.fields if isinstance(field.default, tuple)}
    return _MessageView(
        name=message.name.name,
        doc_end="" if constants else '"""',
        constants=constants,
        defaults=defaults,
        fresh=tuple(field.default_name for field in fields if field.name in changeable),
        fields=fields,
        own=own,
    )
