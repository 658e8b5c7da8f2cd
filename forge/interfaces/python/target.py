"""The Python target: modules with the names and behaviour of rosidl_generator_py, and stubs.

There is a module per interface; a plugin adds serializers. Code shared by all messages is in the run-time
package forge_rosidl.
Generated names that are not from a definition start with '_', so that they cannot conflict with the name of
a field.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from math import inf
from types import SimpleNamespace
from typing import Final

from forge.base.errors import InterfaceError, Location, Problem, raise_if_any
from forge.base.extensions import SERIALIZERS, find, is_installed
from forge.base.frozen import frozen
from forge.base.names import python_attribute, snake_case
from forge.base.templating import render
from forge.interfaces.enumerations import enumerations
from forge.interfaces.model import (
    Action,
    Array,
    Catalog,
    Constant,
    Element,
    Field,
    File,
    Interface,
    Message,
    Named,
    Primitive,
    Sequence,
    String,
    Type,
    TypeName,
    element_of,
    messages_of,
    nested_types,
    sections_of,
    services_of,
)
from forge.interfaces.python.types import (
    DTYPES,
    INTEGERS,
    LARGEST,
    TYPE_CODES,
    imports,
    literal,
    module_name,
    names_in,
    numeric,
    scalar,
    slot_type,
    type_text,
    zero,
)

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
    Raises InterfaceError for members without a type in Python, and for types named like its keywords.
    """
    problems = [
        Problem(
            f"a Python class cannot be called '{name.name}'",
            Location(source.path) if (source := catalog.sources.get(name)) else None,
            "rename it, or leave out --lang python",
        )
        for name in catalog.interfaces
        if name.name in {"False", "None", "True"}
    ]
    for message in (message for each in catalog.interfaces.values() for message in sections_of(each)):
        members: tuple[Field | Constant, ...] = (*message.fields, *message.constants)
        for member in members:
            if element_of(member.type) == Primitive("long double"):
                text = f"Python has no type for the long double '{member.name}'"
                problems.append(Problem(text, member.place, "use double, or leave out --lang python"))
    raise_if_any(problems, InterfaceError)
    serializers_of = None
    if is_installed(SERIALIZERS, "python"):
        serializers_of = find(SERIALIZERS, "python", "serializers of").interface_files(catalog, root)

    def files_of(interface: Interface) -> Iterator[File]:
        source = catalog.sources.get(interface.name)
        yield from _modules(interface, root, source.text if source else "")
        if serializers_of:
            yield from serializers_of(interface)

    return files_of


def _modules(interface: Interface, root: str, definition: str) -> Iterator[File]:
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
    names = _Names(classes, _STUB_BUILTINS & field_names)
    views = [_message(message, names) for message in messages]
    decorator = names.builtin("property")
    shared = {
        "title": str(interface.name),
        "definition": [repr(line) for line in definition.splitlines(keepends=True)],
        "imported": [(f"{root}{module_name(name)}", name.name, local) for name, local in imported.items()],
        "decorator": decorator,
        "messages": views,
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
    fields = [field for view in views for field in view.fields]
    both = [decorator, *("_IntEnum" for view in views if view.enumerations)]
    code = ["_checks", "_messages", *both]
    for field in fields:
        code += (*field.build, *field.accept, field.slot_type, field.default or "")
    path = module_name(interface.name).replace(".", "/")
    import_lines = imports(_MODULE_IMPORTS, names_in(code))
    yield File(f"{path}.py", render("python/interface.py.j2", **shared, imports=import_lines))
    code = [*both, *("_TypeAlias" for _ in services), *(view.check_fields or "" for view in views)]
    code += (text for field in fields for text in (field.getter_type, field.setter_type))
    constants = [constant for view in views for constant in view.constants]
    code += (constant.type for constant in constants)
    if constants or any(field.default for field in fields):
        code.append("_Final")
    import_lines = imports(_STUB_IMPORTS, names_in(code))
    yield File(f"{path}.pyi", render("python/interface.pyi.j2", **shared, imports=import_lines))


_STUB_BUILTINS: Final = frozenset(
    {"bool", "bytearray", "bytes", "float", "int", "list", "object", "property", "str"}
)
"""Builtins used in stubs; a field of such a name shadows one inside its class."""

_BUILTINS: Final = frozenset({"bool", "bytes", "float", "int", "len", "str"})
"""Builtins used in the fast paths of constructors; a field of such a name shadows one."""

_MODULE_IMPORTS: Final = (
    "from array import array as _array",
    "from builtins import property as _property",
    "from enum import IntEnum as _IntEnum",
    "",
    "import numpy as _numpy",
    "from numpy import zeros as _zeros",
    "from forge_rosidl import arrays as _arrays",
    "from forge_rosidl import checks as _checks",
    "from forge_rosidl import messages as _messages",
    "from rosidl_parser import definition as _definition",
    *(f"from forge_rosidl.empty import no_{name} as _no_{name}" for name in sorted(TYPE_CODES)),
)
_STUB_IMPORTS: Final = (
    "from array import array as _array",
    *(f"from builtins import {name} as _{name}" for name in sorted(_STUB_BUILTINS)),
    "from enum import IntEnum as _IntEnum",
    "from collections.abc import Sequence as _Sequence",
    "from collections.abc import Set as _Set",
    "from typing import Final as _Final",
    "from typing import TypeAlias as _TypeAlias",
    "",
    "import numpy as _numpy",
    "from numpy.typing import NDArray as _NDArray",
)


@frozen
class _Names:
    """The local names of classes and builtins in a module and its stub."""

    classes: Mapping[TypeName, str]
    shadowed: AbstractSet[str]
    """The builtins whose names fields have."""

    def builtin(self, name: str) -> str:
        return f"_{name}" if name in self.shadowed else name

    def element(self, element: Element) -> str:
        """Return the type of a single value, or of an element of a collection."""
        match element:
            case Named(name):
                return self.classes[name]
            case String() | Primitive("char" | "wchar"):
                return self.builtin("str")
            case Primitive("boolean"):
                return self.builtin("bool")
            case Primitive("octet"):
                return self.builtin("bytes")
            case Primitive(name):
                return self.builtin("int" if name in INTEGERS else "float")

    def getter_type(self, type_: Type) -> str:
        element, number = self.element(element_of(type_)), numeric(type_)
        match type_:
            case Array() if number:
                return f"_NDArray[_numpy.{DTYPES[number]}]"
            case Sequence() if number:
                return f"_array[{element}]"
            case Array() | Sequence():
                return f"{self.builtin('list')}[{element}]"
            case _:
                return element

    def setter_type(self, type_: Type) -> str:
        read, element = self.getter_type(type_), self.element(element_of(type_))
        match type_:
            case Array() if numeric(type_):
                return f"{read} | _Sequence[{element}] | _Set[{element}]"
            case Array() | Sequence():
                return f"_Sequence[{element}] | _Set[{element}]"
            case Primitive("octet"):
                return f"{read} | {self.builtin('bytearray')}"
            case _:
                return read


def _message(message: Message, names: _Names) -> SimpleNamespace:
    """Return the variables of a message class for the templates of modules and stubs.

    `attribute` is the name of a field in Python code, which differs from `name` if that is a keyword.
    """
    field_names = {field.name for field in message.fields}
    own = "_self" if "self" in field_names else "self"
    direct = not field_names & _BUILTINS
    by_field = enumerations(message)
    single = {field.name for field in message.fields if isinstance(field.type, Primitive)}
    return SimpleNamespace(
        name=message.name.name,
        own=own,
        doc=docstring(message.doc or (f"Message class '{message.name.name}'.",)),
        doc_end="" if message.constants else '"""',
        constants=[
            SimpleNamespace(
                name=constant.name,
                value=literal(constant.type, constant.value),
                type=names.getter_type(constant.type),
                doc=docstring(constant.doc),
            )
            for constant in message.constants
        ],
        units={field.name: repr(field.unit) for field in message.fields if field.unit},
        fresh=[_default_name(field) for field in message.fields if isinstance(field.default, tuple)],
        fields=[
            SimpleNamespace(
                name=field.name,
                attribute=python_attribute(field.name),
                type_text=repr(type_text(field.type)),
                slot_type=slot_type(field.type),
                build=_build(field, names.classes, own, direct=direct),
                accept=_accept(field, names.classes),
                default=None if field.default is None else literal(field.type, field.default),
                default_name=_default_name(field),
                getter_type=names.getter_type(field.type),
                setter_type=names.setter_type(field.type),
                doc=docstring((*field.doc, *([f"[{field.unit}]"] if field.unit else []))),
            )
            for field in message.fields
        ],
        enumerations={each.name: each.members for each in by_field.values()},
        enumerated={field: each.name for field, each in by_field.items() if field in single},
        # The type of the constructor's argument of this name, unless a field has it.
        # Not bool: an unpacked dict[str, float] could not be passed then.
        check_fields=None if "check_fields" in field_names else names.builtin("object"),
    )


def docstring(lines: Iterable[str]) -> tuple[str, ...]:
    """Return the lines of a docstring, quoted and escaped. Blank lines become empty."""
    safe = [_safe_line(line) for line in lines]
    if not any(safe):
        return ()
    if len(safe) == 1:
        return (f'"""{safe[0]}"""',)
    return (f'"""{safe[0]}', *safe[1:], '"""')


def _safe_line(line: str) -> str:
    escaped = line.rstrip().replace("\\", "\\\\")
    if '"""' in escaped or escaped.endswith('"'):
        escaped = escaped.replace('"', '\\"')
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode()
        for character in escaped
    )


_HIGHEST: Final = {"char": 127, "wchar": 65535}


def _default_name(field: Field) -> str:
    return f"{field.name.upper()}__DEFAULT"


def _build(field: Field, classes: Mapping[TypeName, str], own: str, *, direct: bool) -> tuple[str, ...]:
    """Return the lines of the constructor about a field; `own` is the name of its first parameter.

    With `direct`, it can call builtins, because no field shadows one.
    """
    name, slot = python_attribute(field.name), f"{own}._{field.name}"
    # The property setter reports a default that is out of range, as one of float32 may be.
    size = abs(field.default) if isinstance(field.default, float) and field.type == Primitive("float") else 0
    target = f"{own}.{name}" if LARGEST < size < inf else slot
    lines = [f"if {name} is ...:", f"    {target} = {_own_value(field, classes, own)}"]
    if numeric(field.type) and field.default is None:
        return (*lines, "else:", f"    {slot} = {_numbers(field, name, 'new_')}")
    if direct and not isinstance(field.type, Array | Sequence):
        # The condition under which a value is valid without further checks.
        class_, limits, *_ = _rule(field.type, name, classes)
        tests = " and ".join((f"{name}.__class__ is {class_}", *limits))
        lines += [f"elif {tests}:", f"    {slot} = {name}"]
    return (*lines, "else:", f"    {own}.{name} = {name}")


def _own_value(field: Field, classes: Mapping[TypeName, str], own: str) -> str:
    """Return the expression for the default of a field; messages do not share mutable values."""
    if isinstance(field.type, Array | Sequence) and field.default is not None:
        copied = ".copy()" if numeric(field.type) and isinstance(field.type, Array) else "[:]"
        return f"{own}.{_default_name(field)}{copied}"
    match field.type:
        case Array(of, size):
            number = numeric(field.type)
            if number:  # double is numpy's default, which is the fastest
                return f"_zeros({size})" if number == "double" else f"_zeros({size}, _numpy.{DTYPES[number]})"
            if isinstance(of, Named):
                return f"_messages.several({classes[of.name]}, {size})"
            return f"[{zero(of)}] * {size}"
        case Sequence():
            return f"_no_{numeric(field.type)}[:]" if numeric(field.type) else "[]"
        case Named(name):
            return f"{classes[name]}()"
        case single:
            return zero(single) if field.default is None else scalar(single, field.default)


def _accept(field: Field, classes: Mapping[TypeName, str]) -> tuple[str, ...]:
    """Return the lines of a property's setter."""
    if isinstance(field.type, Array | Sequence):
        return (f"self._{field.name} = {_collection(field, classes)}",)
    class_, limits, check, argument = _rule(field.type, "value", classes)
    test = f"value.__class__ is not {class_}"
    if limits:
        test = f"not ({' and '.join((f'value.__class__ is {class_}', *limits))})"
    call = f"_checks.{check}({field.name!r}, value{argument})"
    return (f"if {test}:", f"    value = {call}", f"self._{field.name} = value")


def _rule(type_: Type, value: str, classes: Mapping[TypeName, str]) -> tuple[str, list[str], str, str]:
    """Return when a single value is valid: its class, and conditions for the variable `value`.

    The last two are the function of the run time that checks any other value, and its last argument.
    """
    match type_:
        case Primitive("boolean"):
            return "bool", [], "boolean", ""
        case Primitive("octet"):
            return "bytes", [f"len({value}) == 1"], "octet", ""
        case Primitive("char" | "wchar" as name):
            highest = _HIGHEST[name]
            limits = [f"len({value}) == 1", f"{value} <= {chr(highest)!r}"]
            return "str", limits, "character", f", {highest}"
        case Primitive("float"):
            return "float", [f"-{LARGEST} <= {value} <= {LARGEST}"], "number", ", 'float'"
        case Primitive(name) if name in INTEGERS:
            low, high = INTEGERS[name]
            return "int", [f"{low} <= {value} <= {high}"], "number", f", {name!r}"
        case Primitive(name):
            return "float", [], "number", f", {name!r}"
        case String(_, None):
            return "str", [], "text", ""
        case String(_, bound):
            return "str", [f"len({value}) <= {bound}"], "bounded_text", f", {bound}"
        case Named(name):
            return classes[name], [], "message", f", {classes[name]}"
        case _:
            raise AssertionError(type_)


def _collection(field: Field, classes: Mapping[TypeName, str]) -> str:
    """Return the expression that checks and converts the value of an array or a sequence."""
    type_ = field.type
    if numeric(type_):
        return _numbers(field, "value")
    call = "collection"
    match element_of(type_):
        case String(_, int(bound)):
            call, what = "texts", str(bound)
        case Primitive("char" | "wchar" as name):
            call, what = "characters", str(_HIGHEST[name])
        case element:
            what, *_ = _rule(element, "value", classes)
    size = f", size={type_.size}" if isinstance(type_, Array) else _bound(type_, "bound=")
    return f"_checks.{call}({field.name!r}, value, {what}{size})"


def _numbers(field: Field, variable: str, prefix: str = "") -> str:
    arguments = f"{field.name!r}, {variable}, {numeric(field.type)!r}"
    if isinstance(field.type, Array):
        return f"_arrays.{prefix}array({arguments}, {field.type.size})"
    return f"_checks.{prefix}numbers({arguments}{_bound(field.type)})"


def _bound(type_: Type, prefix: str = "") -> str:
    return f", {prefix}{type_.bound}" if isinstance(type_, Sequence) and type_.bound is not None else ""
