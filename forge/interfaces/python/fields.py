"""Python code for a field of a message: its types, its part of the constructor, and its setter."""

from __future__ import annotations

from collections.abc import Mapping
from math import isinf
from types import SimpleNamespace
from typing import Final

from forge.base.frozen import frozen
from forge.base.names import python_attribute
from forge.interfaces.model import (
    Array,
    Field,
    Named,
    Primitive,
    Sequence,
    String,
    Type,
    TypeName,
    element_of,
)
from forge.interfaces.python.types import (
    DTYPES,
    INTEGERS,
    literal,
    numeric,
    scalar,
    slot_type,
    type_text,
    zero,
)

HIGHEST: Final = {"char": 127, "wchar": 65535}
FLOAT_MAX: Final = "3.4028234663852886e+38"

BUILTINS: Final = frozenset({"bool", "bytes", "float", "int", "len", "str"})
"""Builtins used in the fast paths of constructors; a field of such a name shadows one."""


@frozen
class Scope:
    """The names used inside the methods of a message class."""

    classes: Mapping[TypeName, str]
    """The local names of message classes."""
    own: str = "self"
    """The name of the first parameter of the constructor."""
    direct: bool = True
    """Whether the constructor can call builtins, because no field shadows one."""


def view_field(field: Field, scope: Scope) -> SimpleNamespace:
    """Return the variables of a field for the template.

    `attribute` is the name in Python code, which differs from `name` if that is a keyword; `needs` are the
    imports that the code needs: 'array', 'arrays', 'numpy', 'zeros', 'no_double' and so on.
    """
    return SimpleNamespace(
        name=field.name,
        attribute=python_attribute(field.name),
        type_text=repr(type_text(field.type)),
        slot_type=slot_type(field.type),
        build=_build(field, scope),
        accept=_accept(field, scope.classes),
        default=None if field.default is None else literal(field.type, field.default),
        default_name=f"{field.name.upper()}__DEFAULT",
        needs=_needs(field),
    )


def _needs(field: Field) -> frozenset[str]:
    number, own = numeric(field.type), field.default is None
    if number is None:
        return frozenset()
    if isinstance(field.type, Array):
        words = {"arrays": True, "zeros": own, "numpy": number != "double" or not own}
    else:
        words = {"array": not (own and _bound(field.type, "")), f"no_{number}": own}
    return frozenset(word for word, used in words.items() if used)


def _build(field: Field, scope: Scope) -> tuple[str, ...]:
    name, slot = python_attribute(field.name), f"{scope.own}._{field.name}"
    # The property setter reports a default that is out of range, as one of float32 may be.
    size = abs(field.default) if isinstance(field.default, float) and field.type == Primitive("float") else 0
    target = f"{scope.own}.{name}" if size > float(FLOAT_MAX) and not isinf(size) else slot
    lines = [f"if {name} is ...:", f"    {target} = {_own_value(field, scope)}"]
    if numeric(field.type) and field.default is None:
        return (*lines, "else:", f"    {slot} = {_convert(field)}")
    if scope.direct and not isinstance(field.type, Array | Sequence):
        # The condition under which a value is valid without further checks.
        if isinstance(field.type, Named):
            tests = [f"{name}.__class__ is {scope.classes[field.type.name]}"]
        else:
            tests = _tests(field.type, name)
        lines += [f"elif {' and '.join(tests)}:", f"    {slot} = {name}"]
    return (*lines, "else:", f"    {scope.own}.{name} = {name}")


def _own_value(field: Field, scope: Scope) -> str:
    """Return the expression for the default of a field; messages do not share mutable values."""
    if isinstance(field.type, Array | Sequence) and field.default is not None:
        copied = ".copy()" if numeric(field.type) and isinstance(field.type, Array) else "[:]"
        return f"{scope.own}.{field.name.upper()}__DEFAULT{copied}"
    match field.type:
        case Array(of, size):
            number = numeric(field.type)
            if number:  # double is numpy's default, which is the fastest
                return f"_zeros({size})" if number == "double" else f"_zeros({size}, _numpy.{DTYPES[number]})"
            if isinstance(of, Named):
                return f"_messages.several({scope.classes[of.name]}, {size})"
            return f"[{zero(of)}] * {size}"
        case Sequence():
            return f"_no_{numeric(field.type)}[:]" if numeric(field.type) else "[]"
        case Named(name):
            return f"{scope.classes[name]}()"
        case single:
            return zero(single) if field.default is None else scalar(single, field.default)


def _convert(field: Field) -> str:
    number, variable = numeric(field.type) or "", python_attribute(field.name)
    if isinstance(field.type, Array):
        return f"_arrays.new_array({field.name!r}, {variable}, {number!r}, {field.type.size})"
    if isinstance(field.type, Sequence) and field.type.bound is not None:
        return f"_checks.new_numbers({field.name!r}, {variable}, {number!r}, {field.type.bound})"
    return f"_checks.new_numbers({field.name!r}, {variable}, {number!r})"


def _accept(field: Field, classes: Mapping[TypeName, str]) -> tuple[str, ...]:
    store = f"self._{field.name} = value"
    if isinstance(field.type, Array | Sequence):
        return (f"self._{field.name} = {_collection(field, classes)}",)
    call = _scalar_check(field, classes)
    if isinstance(field.type, Named):
        test = f"value.__class__ is not {classes[field.type.name]}"
    else:
        tests = _tests(field.type, "value")
        test = f"not ({' and '.join(tests)})" if tests[1:] else tests[0].replace(" is ", " is not ")
    return (f"if {test}:", f"    value = {call}", store)


def _tests(type_: Type, variable: str) -> list[str]:
    limits = []
    match type_:
        case Primitive("boolean"):
            python = "bool"
        case Primitive("octet"):
            python, limits = "bytes", [f"len({variable}) == 1"]
        case Primitive("char" | "wchar" as name):
            python, limits = "str", [f"len({variable}) == 1", f"{variable} <= {chr(HIGHEST[name])!r}"]
        case Primitive("float"):
            python, limits = "float", [f"-{FLOAT_MAX} <= {variable} <= {FLOAT_MAX}"]
        case Primitive(name) if name in INTEGERS:
            low, high = INTEGERS[name]
            python, limits = "int", [f"{low} <= {variable} <= {high}"]
        case String(_, bound):
            python, limits = "str", [] if bound is None else [f"len({variable}) <= {bound}"]
        case _:
            python = "float"
    return [f"{variable}.__class__ is {python}", *limits]


def _scalar_check(field: Field, classes: Mapping[TypeName, str]) -> str:
    start = f"({field.name!r}, value"
    match field.type:
        case Primitive("boolean" | "octet" as name):
            return f"_checks.{name}{start})"
        case Primitive("char" | "wchar" as name):
            return f"_checks.character{start}, {HIGHEST[name]})"
        case Primitive(name):
            return f"_checks.number{start}, {name!r})"
        case String(_, None):
            return f"_checks.text{start})"
        case String(_, bound):
            return f"_checks.bounded_text{start}, {bound})"
        case Named(name):
            return f"_checks.message{start}, {classes[name]})"
        case _:
            raise AssertionError(field.type)


def _collection(field: Field, classes: Mapping[TypeName, str]) -> str:
    type_, number = field.type, numeric(field.type)
    size = f", {type_.size}" if isinstance(type_, Array) else ""
    if number and size:
        return f"_arrays.array({field.name!r}, value, {number!r}{size})"
    if number:
        return f"_checks.numbers({field.name!r}, value, {number!r}{_bound(type_, '')})"
    match element_of(type_):
        case Named(name):
            call, what = "collection", classes[name]
        case String(_, None):
            call, what = "collection", "str"
        case String(_, bound):
            call, what = "texts", str(bound)
        case Primitive("char" | "wchar" as name):
            call, what = "characters", str(HIGHEST[name])
        case Primitive(name):
            call, what = "collection", "bool" if name == "boolean" else "bytes"
    length = size.replace(" ", " size=") + _bound(type_, "bound=")
    return f"_checks.{call}({field.name!r}, value, {what}{length})"


def _bound(type_: Type, prefix: str) -> str:
    return f", {prefix}{type_.bound}" if isinstance(type_, Sequence) and type_.bound is not None else ""
