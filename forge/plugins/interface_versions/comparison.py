"""Compare two versions of interfaces: which changes keep the serialized bytes, the type hash, the API; pure.

The *wire* is kept if each value of one version is serialized to the same bytes by the other one, is valid
there, and reaches the field of its name if that still exists: what two nodes of different versions, or a
recorded bag, rely on. The *hash* is that of REP 2011, which depends on names too, but not on default values
and constants. The *API* is kept if code written for the old version still compiles and means the same.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field
from difflib import SequenceMatcher
from itertools import zip_longest

from forge.base.frozen import frozen
from forge.base.text import digest
from forge.interfaces.enumerations import enumerations
from forge.interfaces.hashing import Hasher
from forge.interfaces.model import (
    Array,
    Catalog,
    Constant,
    Field,
    Interface,
    Message,
    Named,
    Primitive,
    Sequence,
    String,
    Type,
    TypeName,
    nested_types,
    sections_of,
)
from forge.interfaces.notation import type_text, value_text

WIRE, HASH, API = "wire", "hash", "api"
ASPECTS = (WIRE, HASH, API)

_LONGEST = 4096
"""The length of an encoding, in characters, above which its digest stands for it."""
_SAME_BYTES = {"octet": "uint8", "char": "uint8"}
_SECTIONS = {1: ("",), 2: ("request", "response"), 3: ("goal", "result", "feedback")}


@frozen
class Version:
    """The interfaces of one version, by name, with all messages that they contain."""

    interfaces: Mapping[TypeName, Interface]
    messages: Mapping[TypeName, Message]
    hashers: Mapping[str, Hasher]
    """By package."""
    encodings: dict[TypeName, str] = field(default_factory=dict)
    """A cache."""

    def hash(self, name: TypeName) -> str:
        return self.hashers[name.package].hash(name)


@frozen
class Change:
    """A difference of an interface in words. Other breakage than that of the API is determined as a whole."""

    text: str
    api: bool = False


@frozen
class Difference:
    """How an interface differs; `breaks` is what is not kept. A new interface breaks nothing."""

    name: TypeName
    breaks: frozenset[str]
    changes: tuple[Change, ...] = ()
    hashes: tuple[str, str] = ("", "")
    """The old and the new hash; empty for an interface that does not exist there."""


def version_of(catalogs: Iterable[Catalog]) -> Version:
    """Return the version that consists of the catalogs of packages."""
    interfaces: dict[TypeName, Interface] = {}
    messages: dict[TypeName, Message] = {}
    hashers = {}
    for catalog in catalogs:
        interfaces |= catalog.interfaces
        messages |= catalog.known
        hashers[catalog.package] = Hasher(catalog)
    return Version(interfaces, messages, hashers)


def compare(old: Version, new: Version) -> list[Difference]:
    """Return the interfaces that differ, sorted by name."""
    found = []
    for name in sorted(old.interfaces.keys() | new.interfaces.keys()):
        if name not in new.interfaces:
            found.append(Difference(name, frozenset(ASPECTS), (Change("removed"),), (old.hash(name), "")))
        elif name not in old.interfaces:
            found.append(Difference(name, frozenset(), (Change("new"),), ("", new.hash(name))))
        elif difference := _compared(name, old, new):
            found.append(difference)
    return found


def _compared(name: TypeName, old: Version, new: Version) -> Difference | None:
    hashes = old.hash(name), new.hash(name)
    sections = sections_of(old.interfaces[name]), sections_of(new.interfaces[name])
    changes: list[Change] = []
    for title, before, after in zip_longest(_SECTIONS[len(sections[0])], *sections):
        changes += _section_changes(title, before, after)
    wires = [
        [_encoding(Named(section.name), version.messages, version.encodings) for section in each]
        for each, version in zip(sections, (old, new), strict=True)
    ]
    breaks = {API} if any(change.api for change in changes) else set()
    moved = _contents(sections[0], old.messages) & _contents(sections[1], new.messages) & _moved(old, new)
    breaks |= {WIRE} if wires[0] != wires[1] or moved else set()
    breaks |= {HASH} if hashes[0] != hashes[1] else set()
    inner = sorted(nested_types(sections[0]) & nested_types(sections[1]))
    hashers = old.hashers[name.package], new.hashers[name.package]
    changed = [each for each in inner if hashers[0].hash(each) != hashers[1].hash(each)]
    changes += (Change(f"contains {each}, which has changed") for each in changed)
    return Difference(name, frozenset(breaks), tuple(changes), hashes) if changes or breaks else None


def _moved(old: Version, new: Version) -> frozenset[TypeName]:
    """Return the messages of both versions in which a field stands at the place of another one."""

    def places(name: TypeName, version: Version) -> dict[str, str]:
        """Return what precedes each field."""
        fields = version.messages[name].fields
        texts = [_encoding(each.type, version.messages, version.encodings) for each in fields]
        return {each.name: " ".join(texts[:place]) for place, each in enumerate(fields)}

    found = set()
    for name in old.messages.keys() & new.messages.keys():
        before, after = places(name, old), places(name, new)
        if any(before[each] != after[each] for each in before.keys() & after.keys()):
            found.add(name)
    return frozenset(found)


def _contents(messages: Iterable[Message], known: Mapping[TypeName, Message]) -> set[TypeName]:
    """Return the names of messages and of all that they contain."""
    found, waiting = {message.name for message in messages}, [*messages]
    while waiting:
        below = nested_types([waiting.pop()]) - found
        found |= below
        waiting += [known[name] for name in below]
    return found


def _section_changes(title: str, old: Message, new: Message) -> Iterator[Change]:
    where = f" of the {title}" if title else ""
    yield from _field_changes(where, old, new)
    yield from _enumeration_changes(where, old, new)
    before, after = ({each.name: each for each in message.constants} for message in (old, new))
    for name in sorted(before.keys() | after.keys()):
        if name not in after:
            yield Change(f"constant '{name}'{where} was removed", api=True)
        elif name not in before:
            yield Change(f"constant '{name}'{where} is new")
        elif _constant(before[name]) != _constant(after[name]):
            texts = (f"{_constant(each[name])}" for each in (before, after))
            yield Change(f"constant '{name}'{where}: {' -> '.join(texts)}", api=True)


def _enumeration_changes(where: str, old: Message, new: Message) -> Iterator[Change]:
    before, after = (
        {each.name: dict(each.members) for each in enumerations(message).values()} for message in (old, new)
    )
    for name in sorted(before.keys() | after.keys()):
        if name not in before:
            yield Change(f"enumeration '{name}'{where} is new")
        elif name not in after:
            yield Change(f"enumeration '{name}'{where} was removed", api=True)
        elif gone := sorted(before[name].keys() - after[name].keys()):
            yield Change(f"enumeration '{name}'{where} has no {' and '.join(gone)} any more", api=True)


def _constant(constant: Constant) -> str:
    return f"{_type(constant.type, '')} {value_text(constant.value)}"


def _field_changes(where: str, old: Message, new: Message) -> Iterator[Change]:
    """Yield the changes of the fields; a field whose name alone has changed is renamed."""
    before, after = list(old.fields), list(new.fields)
    names = [[each.name for each in fields] for fields in (before, after)]
    removed, added = list[Field](), list[Field]()
    matcher = SequenceMatcher(a=names[0], b=names[1], autojunk=False)
    for _, i1, i2, j1, j2 in (each for each in matcher.get_opcodes() if each[0] != "equal"):
        gone, come = before[i1:i2], after[j1:j2]
        if len(gone) == len(come):
            elsewhere = {*names[0], *names[1]} - {each.name for each in (*gone, *come)}
            for one, other in zip(gone, come, strict=True):
                is_renamed = one.type == other.type and not {one.name, other.name} & elsewhere
                if is_renamed and one.name not in names[1] and other.name not in names[0]:
                    yield Change(f"field '{one.name}'{where} is now called '{other.name}'", api=True)
                else:
                    removed.append(one)
                    added.append(other)
        else:
            removed += gone
            added += come
    for one in removed:
        if one.name not in names[1]:
            yield Change(f"field '{one.name}'{where} was removed", api=True)
        else:
            yield Change(f"field '{one.name}'{where} has moved")
    for other in added:
        if other.name not in names[0]:
            yield Change(f"field '{other.name}'{where} is new")
    later = {each.name: each for each in after}
    for one in before:
        if one.name in later:
            yield from _changes_of(one, later[one.name], where, old.name.package)


def _changes_of(old: Field, new: Field, where: str, package: str) -> Iterator[Change]:
    if old.type != new.type:
        texts = " -> ".join(_type(each.type, package) for each in (old, new))
        # The code for a string does not depend on its maximum length.
        api = _without_bound(old.type) != _without_bound(new.type)
        yield Change(f"field '{old.name}'{where}: {texts}", api=api)
    if repr(old.default) != repr(new.default):  # NaN is not equal to itself, and -0.0 is to 0.0
        texts = " -> ".join(value_text(each.default) or "none" for each in (old, new))
        yield Change(f"default value of '{old.name}'{where}: {texts}")
    if old.unit != new.unit:
        yield Change(f"unit of '{old.name}'{where}: {old.unit or 'none'} -> {new.unit or 'none'}")


def _without_bound(type_: Type) -> Type:
    match type_:
        case String(wide, _):
            return String(wide)
        case Array(String(wide, _), size):
            return Array(String(wide), size)
        case Sequence(String(wide, _), bound):
            return Sequence(String(wide), bound)
        case _:
            return type_


def _type(type_: Type, package: str) -> str:
    text = type_text(type_, package)
    return f"{text.word}{text.suffix}"


def _encoding(type_: Type, messages: Mapping[TypeName, Message], known: dict[TypeName, str]) -> str:
    """Return everything that determines the bytes and the range of values, without names.

    XCDR1 aligns primitives only, so that the members of a nested message could as well be its owner's.
    """
    match type_:
        case Array(of, size):
            return f"({_encoding(of, messages, known)})[{size}]"
        case Sequence(of, bound):
            return f"({_encoding(of, messages, known)})[<={bound}]"
        case Named(name):
            if name not in known:
                members = messages[name].fields
                text = " ".join(_encoding(member.type, messages, known) for member in members) or "zero"
                # Deeply nested messages could have millions of members.
                known[name] = text if len(text) <= _LONGEST else digest(text, size=32)
            return known[name]
        case Primitive(name):
            return _SAME_BYTES.get(name, name)
        case String(wide, bound):
            return f"{'wstring' if wide else 'string'}<={bound}"
