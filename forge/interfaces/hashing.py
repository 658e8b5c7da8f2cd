"""RIHS01 type hashes and the target 'json': type descriptions with hashes, as since ROS 2 Iron (REP 2011)."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from typing import Any

from forge.interfaces.model import (
    Action,
    Array,
    Catalog,
    Field,
    File,
    Interface,
    Message,
    Named,
    Primitive,
    Sequence,
    Service,
    String,
    Type,
    TypeName,
    element_of,
    messages_of,
    services_of,
)

Description = dict[str, Any]
"""The JSON object that is hashed: the name and the fields of a type."""

_PRIMITIVE_IDS = {
    "int8": 2, "uint8": 3, "int16": 4, "uint16": 5, "int32": 6, "uint32": 7, "int64": 8, "uint64": 9,
    "float": 10, "double": 11, "long double": 12, "char": 13, "wchar": 14, "boolean": 15, "octet": 16,
}  # fmt: skip
_ARRAY, _BOUNDED_SEQUENCE, _SEQUENCE = 48, 96, 144

_TIME = TypeName("builtin_interfaces", "msg", "Time")
_EVENT_INFO = TypeName("service_msgs", "msg", "ServiceEventInfo")
_IMPLIED = {
    _TIME: (Field("sec", Primitive("int32")), Field("nanosec", Primitive("uint32"))),
    _EVENT_INFO: (
        Field("event_type", Primitive("uint8")),
        Field("stamp", Named(_TIME)),
        Field("client_gid", Array(Primitive("uint8"), 16)),
        Field("sequence_number", Primitive("int64")),
    ),
}
"""The types in the event message of every service; Humble does not install them."""


class Hasher:
    """Describes and hashes the types of one catalog; descriptions are cached."""

    def __init__(self, catalog: Catalog) -> None:
        self._structures: dict[TypeName, tuple[Field, ...]] = dict(_IMPLIED)
        self._structures.update((name, message.members) for name, message in catalog.known.items())
        for interface in catalog.interfaces.values():
            self._structures.update(structures_of(interface))
        self._texts: dict[TypeName, str] = {}
        self._hashes: dict[TypeName, str] = {}

    def hash(self, name: TypeName) -> str:
        """Return the hash: 'RIHS01_' and 64 hexadecimal digits."""
        if name not in self._hashes:
            texts = ", ".join(map(self._text, self.referenced(name)))
            text = f'{{"type_description": {self._text(name)}, "referenced_type_descriptions": [{texts}]}}'
            self._hashes[name] = f"RIHS01_{hashlib.sha256(text.encode()).hexdigest()}"
        return self._hashes[name]

    def referenced(self, name: TypeName) -> list[TypeName]:
        """Return all types that `name` refers to, directly or indirectly, sorted by name."""
        types: set[TypeName] = set()
        waiting = [name]
        while waiting:
            members = self._structures[waiting.pop()]
            inner = {of.name for each in members if isinstance(of := element_of(each.type), Named)} - types
            types |= inner
            waiting += inner
        return sorted(types, key=str)

    def fields(self, name: TypeName) -> tuple[Field, ...]:
        return self._structures[name]

    def _text(self, name: TypeName) -> str:
        if name not in self._texts:
            fields = [{"name": each.name, "type": _type(each.type)} for each in self.fields(name)]
            self._texts[name] = json.dumps({"type_name": str(name), "fields": fields})
        return self._texts[name]


def hashes(catalog: Catalog) -> dict[TypeName, str]:
    """Return the hash of each interface of a catalog and of each type derived from it, by name."""
    hasher = Hasher(catalog)
    names = {name for interface in catalog.interfaces.values() for name, _ in structures_of(interface)}
    return {name: hasher.hash(name) for name in sorted(names)}


def structures_of(interface: Interface) -> Iterator[tuple[TypeName, tuple[Field, ...]]]:
    """Yield each type that an interface defines or implies, with its fields; services have three."""
    for message in messages_of(interface):
        yield message.name, message.members
    for service in services_of(interface):
        yield service.event.name, service.event.members
        yield (
            service.name,
            _fields_of(
                request_message=service.request,
                response_message=service.response,
                event_message=service.event,
            ),
        )
    if isinstance(interface, Action):
        yield (
            interface.name,
            _fields_of(
                goal=interface.goal,
                result=interface.result,
                feedback=interface.feedback,
                send_goal_service=interface.send_goal,
                get_result_service=interface.get_result,
                feedback_message=interface.feedback_message,
            ),
        )


def _fields_of(**parts: Message | Service) -> tuple[Field, ...]:
    return tuple(Field(name, Named(part.name)) for name, part in parts.items())


def _type(type_: Type) -> Description:
    capacity, string_capacity, nested = 0, 0, ""
    match element_of(type_):
        case Named(name):
            type_id, nested = 1, str(name)
        case String(wide, None):
            type_id = 18 if wide else 17
        case String(wide, int(string_capacity)):
            type_id = 22 if wide else 21
        case Primitive(name):
            type_id = _PRIMITIVE_IDS[name]
    match type_:
        case Array(_, capacity):
            type_id += _ARRAY
        case Sequence(_, None):
            type_id += _SEQUENCE
        case Sequence(_, int(capacity)):
            type_id += _BOUNDED_SEQUENCE
    return {
        "type_id": type_id,
        "capacity": capacity,
        "string_capacity": string_capacity,
        "nested_type_name": nested,
    }


def interface_files(catalog: Catalog) -> Callable[[Interface], Iterator[File]]:
    hasher = Hasher(catalog)

    def files_of(interface: Interface) -> Iterator[File]:
        name = interface.name
        text = json.dumps(describe(hasher, name), indent=2)
        yield File(f"{name.package}/{name.kind}/{name.name}.json", f"{text}\n")

    return files_of


def describe(hasher: Hasher, name: TypeName) -> Description:
    """Return the description of a type and all referenced types, with the hash of each."""
    referenced = hasher.referenced(name)
    return {
        "type_description_msg": {
            "type_description": described_type(hasher, name),
            "referenced_type_descriptions": [described_type(hasher, each) for each in referenced],
        },
        "type_hashes": [
            {"type_name": str(each), "hash_string": hasher.hash(each)} for each in (name, *referenced)
        ],
    }


def described_type(hasher: Hasher, name: TypeName) -> Description:
    """Return the description of a type with default values, which are not part of the hash."""
    fields = [
        {
            "name": member.name,
            "type": _type(member.type),
            "default_value": "" if member.default is None else str(member.default),
        }
        for member in hasher.fields(name)
    ]
    return {"type_name": str(name), "fields": fields}
