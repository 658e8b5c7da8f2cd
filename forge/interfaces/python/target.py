"""The Python target: modules with the names and behaviour of rosidl_generator_py, stubs and serializers.

There is a module per interface. Code shared by all messages is in the run-time package forge_rosidl.
Generated names that are not from a definition start with '_', so that they cannot conflict with the name of
a field.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from types import SimpleNamespace

from forge.base.errors import InterfaceError, Problem, raise_if_any
from forge.base.names import snake_case
from forge.base.templating import render
from forge.interfaces.model import (
    Action,
    Catalog,
    Constant,
    Field,
    File,
    Interface,
    Message,
    Primitive,
    TypeName,
    element_of,
    messages_of,
    nested_types,
    sections_of,
    services_of,
)
from forge.interfaces.python import cdr
from forge.interfaces.python.fields import BUILTINS, Scope, view_field
from forge.interfaces.python.stubs import BUILTINS as STUB_BUILTINS
from forge.interfaces.python.stubs import StubNames, stub_imports, view_stub
from forge.interfaces.python.types import literal, module_name

_CANCEL = TypeName("action_msgs", "srv", "CancelGoal")
_STATUS = TypeName("action_msgs", "msg", "GoalStatusArray")


def files(catalog: Catalog, root: str = "") -> Iterator[File]:
    """Yield the files of the Python package; paths are relative to a folder on the Python path.

    For `root`, see interface_files().
    """
    yield from package_files(catalog)
    files_of = interface_files(catalog, root)
    for interface in catalog.interfaces.values():
        yield from files_of(interface)


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


def interface_files(catalog: Catalog, root: str = "") -> Callable[[Interface], Iterator[File]]:
    """Return a function that yields the module of one interface, its stub and its serializers.

    `root` precedes the names of imported packages; with "..." the folder of all packages is a package itself.
    Raises InterfaceError for members without a type in Python.
    """
    problems = []
    for message in (message for each in catalog.interfaces.values() for message in sections_of(each)):
        members: tuple[Field | Constant, ...] = (*message.fields, *message.constants)
        for member in members:
            if element_of(member.type) == Primitive("long double"):
                text = f"Python has no type for the long double '{member.name}'"
                problems.append(Problem(text, member.place, "use double, or leave out --lang python"))
    raise_if_any(problems, InterfaceError)
    serializers_of = cdr.interface_files(catalog, root)

    def files_of(interface: Interface) -> Iterator[File]:
        yield from _modules(interface, root)
        yield from serializers_of(interface)

    return files_of


def _modules(interface: Interface, root: str) -> Iterator[File]:
    messages, services = tuple(messages_of(interface)), services_of(interface)
    own = {message.name for message in messages}
    imported_names = nested_types(messages) - own
    if isinstance(interface, Action):
        imported_names |= {_CANCEL, _STATUS} - own
    field_names = {field.name for message in messages for field in message.fields}
    # A field shadows a class in constructors.
    defined = {name.name for name in (interface.name, *own, *(service.name for service in services))}
    taken = [*(name.name for name in imported_names), *(field_names | defined)]
    imported = {
        name: name.name if taken.count(name.name) == 1 else f"_{name.package}_{name.kind}_{name.name}"
        for name in sorted(imported_names)
    }
    classes = imported | {message.name: message.name.name for message in messages}
    path = module_name(interface.name).replace(".", "/")
    shared = {
        "title": str(interface.name),
        "imported": [(f"{root}{module_name(name)}", name.name, local) for name, local in imported.items()],
        "decorator": "_property" if "property" in field_names else "property",
        "services": [
            {
                "name": service.name.name,
                "request": service.request.name.name,
                "response": service.response.name.name,
                "event": service.event.name.name if service.has_events else None,
            }
            for service in services
        ],
        "action": isinstance(interface, Action)
        and {"name": interface.name.name, "cancel": classes[_CANCEL], "status": classes[_STATUS]},
    }
    views = [_message(message, classes) for message in messages]
    lines = _imports(views, shadows_property="property" in field_names)
    yield File(f"{path}.py", render("python/interface.py.j2", **shared, messages=views, imports=lines))
    names = StubNames(classes, STUB_BUILTINS & field_names)
    stubs = [view_stub(message, names) for message in messages]
    lines = stub_imports(messages, names.shadowed, aliases=bool(services))
    yield File(f"{path}.pyi", render("python/interface.pyi.j2", **shared, messages=stubs, imports=lines))


def _imports(views: Sequence[SimpleNamespace], *, shadows_property: bool) -> list[str]:
    needs = {need for view in views for field in view.fields for need in field.needs}
    lines = ["from array import array as _array"] if "array" in needs else []
    if shadows_property:
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


def _message(message: Message, classes: Mapping[TypeName, str]) -> SimpleNamespace:
    names = {field.name for field in message.fields}
    own = "_self" if "self" in names else "self"
    scope = Scope(classes, own, direct=not names & BUILTINS)
    fields = [view_field(field, scope) for field in message.fields]
    changeable = {field.name for field in message.fields if isinstance(field.default, tuple)}
    return SimpleNamespace(
        name=message.name.name,
        doc_end="" if message.constants else '"""',
        constants=[(c.name, literal(c.type, c.value)) for c in message.constants],
        defaults=[(field.default_name, field.default) for field in fields if field.default is not None],
        fresh=[field.default_name for field in fields if field.name in changeable],
        fields=fields,
        own=own,
    )
