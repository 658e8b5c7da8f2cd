"""Base classes and metaclasses of generated messages, services and actions.

The interface is that of rosidl: read-only constants, `__slots__`, `SLOT_TYPES`, and a metaclass through which
client libraries find the C type support.
"""

from __future__ import annotations

import sys
from array import array
from contextlib import suppress
from copy import copy
from types import FunctionType
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, cast

if TYPE_CHECKING:
    from enum import IntEnum

_M = TypeVar("_M")
_NOT_CONSTANT = (property, FunctionType, classmethod, type, tuple)


class InterfaceType(type):
    """The metaclass of all interface classes: constants are read-only, C type support is loaded on demand."""

    _TYPE_SUPPORT: ClassVar[Any] = None
    _CONSTANTS: ClassVar[dict[str, Any]]

    @classmethod
    def __prepare__(cls, name: str, bases: tuple[type, ...], /, **_: Any) -> dict[str, Any]:
        """Return the constants and defaults of the generated class, which derived classes begin with."""
        return {name: copy(value) for name, value in cls.__dict__.get("_CONSTANTS", {}).items()}

    def __init__(cls, name: str, bases: tuple[type, ...], namespace: dict[str, Any]) -> None:
        """Store the constants of the generated class; derived classes share them."""
        super().__init__(name, bases, namespace)
        if "_CONSTANTS" not in type(cls).__dict__:
            type(cls)._CONSTANTS = {
                name: value
                for name, value in namespace.items()
                if not (name.startswith("_") or isinstance(value, _NOT_CONSTANT))
            }

    def __setattr__(cls, name: str, value: object) -> None:
        """Set a class attribute; raises AttributeError for a constant or a default."""
        _refuse_constant(cls, name)
        super().__setattr__(name, value)

    def __delattr__(cls, name: str) -> None:
        """Delete a class attribute; raises AttributeError for a constant or a default."""
        _refuse_constant(cls, name)
        super().__delattr__(name)

    @classmethod
    def __import_type_support__(cls) -> None:
        """Load the type support of this class from the package's C extension, if there is one."""
        extension = None if cls._TYPE_SUPPORT else _extension(cls.__module__)
        if extension is not None:
            cls._load(extension)

    @classmethod
    def _load(cls, extension: Any) -> None:
        """Set the entries of this class from the extension."""
        raise NotImplementedError


class MessageType(InterfaceType):
    """The metaclass of messages."""

    _CREATE_ROS_MESSAGE: ClassVar[Any] = None
    _CONVERT_FROM_PY: ClassVar[Any] = None
    _CONVERT_TO_PY: ClassVar[Any] = None
    _DESTROY_ROS_MESSAGE: ClassVar[Any] = None

    @classmethod
    def _load(cls, extension: Any) -> None:
        suffix = _symbol_suffix(cls, "msg")
        cls._CREATE_ROS_MESSAGE = getattr(extension, f"create_ros_message_{suffix}")
        cls._CONVERT_FROM_PY = getattr(extension, f"convert_from_py_{suffix}")
        cls._CONVERT_TO_PY = getattr(extension, f"convert_to_py_{suffix}")
        cls._DESTROY_ROS_MESSAGE = getattr(extension, f"destroy_ros_message_{suffix}")
        cls._TYPE_SUPPORT = getattr(extension, f"type_support_{suffix}")
        for message in _nested_messages(_instance_of(cls)):
            type(message).__import_type_support__()


class ServiceType(InterfaceType):
    """The metaclass of services."""

    @classmethod
    def _load(cls, extension: Any) -> None:
        cls._TYPE_SUPPORT = getattr(extension, f"type_support_{_symbol_suffix(cls, 'srv')}")
        service = _instance_of(cls)
        type(service.Request).__import_type_support__()
        type(service.Response).__import_type_support__()


class ActionType(InterfaceType):
    """The metaclass of actions."""

    @classmethod
    def _load(cls, extension: Any) -> None:
        cls._TYPE_SUPPORT = getattr(extension, f"type_support_{_symbol_suffix(cls, 'action')}")
        action = _instance_of(cls)
        for part in (*vars(action).values(), *vars(action.Impl).values()):
            if isinstance(part, InterfaceType):
                type(part).__import_type_support__()


class Interface:
    """The base class of messages, services and actions."""

    __slots__: tuple[str, ...] = ()
    _DEFINITION: ClassVar[str] = ""

    @classmethod
    def get_definition(cls) -> str:
        """Return the text of the .msg, .srv, .action or .idl file in which this class is defined."""
        return cls._DEFINITION


class Message(Interface):
    """The base class of all message classes."""

    __slots__: tuple[str, ...] = ()
    _fields_and_field_types: ClassVar[dict[str, str]] = {}
    SLOT_TYPES: ClassVar[tuple[Any, ...]] = ()
    _UNITS: ClassVar[dict[str, str]] = {}
    _ENUMERATIONS: ClassVar[dict[str, type[IntEnum]]] = {}

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        """Return the name of each field with its type as text, in the order of declaration."""
        return dict(cls._fields_and_field_types)

    @classmethod
    def get_constants(cls) -> dict[str, Any]:
        """Return the constants of the definition by their names, without the defaults of fields."""
        metaclass = cast("type[MessageType]", type(cls))
        constants = metaclass._CONSTANTS.items()
        return {name: value for name, value in constants if not name.endswith("__DEFAULT")}

    @classmethod
    def get_units(cls) -> dict[str, str]:
        """Return the units of fields whose comments have one, such as 'speed [m/s]', by their names."""
        return dict(cls._UNITS)

    def __eq__(self, other: object) -> bool:
        """Return True if the other is a message of this class with equal fields."""
        if not isinstance(other, self.__class__):
            return False
        for slot in self.__slots__:
            mine, theirs = getattr(self, slot), getattr(other, slot)
            shape = getattr(mine, "shape", ())  # of a numpy array, which compares element by element
            if shape and isinstance(shape, tuple):  # a message can have a field of that name
                mine, theirs = mine.tolist(), theirs.tolist()
            if mine != theirs:
                return False
        return True

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        """Return the message as a constructor call, with arrays as lists."""
        names = [*self.__class__.__module__.split(".")[-3:-1], self.__class__.__name__]
        values = ", ".join(f"{slot[1:]}={_shown(self, slot)}" for slot in self.__slots__)
        return f"{'.'.join(names)}({values})"


class Service(Interface):
    """The base class of all service classes, which cannot be instantiated."""

    def __init__(self) -> None:
        """Raise NotImplementedError."""
        raise NotImplementedError("Service classes can not be instantiated")


class Action(Interface):
    """The base class of all action classes, which cannot be instantiated."""

    def __init__(self) -> None:
        """Raise NotImplementedError."""
        raise NotImplementedError("Action classes can not be instantiated")


def fresh(name: str) -> property:
    """Return a property of the metaclass for a mutable default; each access returns a copy."""
    return property(lambda cls: copy(cls.__dict__[name]), doc="A copy of the default.")


def several(class_: type[_M], count: int) -> list[_M]:
    """Return a list of new messages."""
    return [class_() for _ in range(count)]


def _refuse_constant(cls: InterfaceType, name: str) -> None:
    if name in cls._CONSTANTS:
        raise AttributeError(f"can't set attribute '{name}' of '{cls.__name__}': it is a constant")


def _extension(module: str) -> Any:
    """Return the C extension of the module's package, or None when it cannot be imported."""
    import importlib
    import logging

    package = module.partition(".")[0]
    try:
        return importlib.import_module(f"{package}.{package}_s__rosidl_typesupport_c")
    except ImportError:
        logging.getLogger("forge_rosidl").debug("no C type support for '%s'", package, exc_info=True)
        return None


def _symbol_suffix(cls: type, kind: str) -> str:
    """Return the suffix of names in the C extension, such as 'msg__srv__set_bool__request'."""
    import re

    name = cls.__name__.partition("_")[2]
    name = re.sub(r"(.)([A-Z][a-z]+)", r"\1_\2", name)
    name = re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", name).lower()
    return f"{kind}__{cls.__module__.split('.')[1]}__{name}"


def _instance_of(cls: type) -> Any:
    """Return the class with this metaclass."""
    return getattr(sys.modules[cls.__module__], cls.__name__.partition("_")[2])


def _nested_messages(message: type[Message]) -> list[Any]:
    """Return the classes of the message's fields and of elements of collections."""
    import importlib

    found = []
    for slot_type in message.SLOT_TYPES:
        element = getattr(slot_type, "value_type", slot_type)
        if hasattr(element, "namespaces"):
            # The parts of an action are in its module, which may also import a class of the same name.
            namespace = ".".join(element.namespaces)
            cls: Any = getattr(sys.modules[message.__module__], element.name, None)
            if cls is None or cls.__module__.rpartition(".")[0] != namespace:
                cls = getattr(importlib.import_module(namespace), element.name)
            found.append(cls)
    return found


def _shown(message: Message, slot: str) -> str:
    """Return the text of a field; values of an enumeration have their names."""
    value = getattr(message, slot)
    enumeration = message._ENUMERATIONS.get(slot[1:])
    if enumeration:
        with suppress(ValueError):
            return repr(enumeration(value))
    return repr(value.tolist() if isinstance(value, array) else value)
