"""Compare two versions of interfaces: which changes preserve the serialized bytes, the type hash and the API.

Pure. The *wire* is kept if both versions write the same bytes and read the same values from them, and each
value reaches the field of its name if that still exists: two nodes of different versions, or readers of a
recorded bag, rely on this. The *hash* (REP 2011) also depends on names, but not on default values and
constants. The *API* is kept if code written for the old version still compiles and means the same.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import field
from difflib import SequenceMatcher

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
    element_of,
    nested_types,
    sections_of,
)
from forge.interfaces.notation import type_text, value_text

WIRE, HASH, API = "wire", "hash", "api"
ASPECTS = (WIRE, HASH, API)

_SAME_BYTES = {"octet": "uint8", "char": "uint8"}
_SECTIONS = {1: ("",), 2: ("request", "response"), 3: ("goal", "result", "feedback")}


@frozen
class Version:
    """The interfaces of one version, by name, with all messages that they contain."""

    interfaces: Mapping[TypeName, Interface]
    messages: Mapping[TypeName, Message]
    hashers: Mapping[str, Hasher]
    """By package."""
    invalid: frozenset[TypeName] = frozenset()
    """The interfaces that cannot be compared."""
    layouts: dict[TypeName, _Layout] = field(default_factory=dict)
    """A cache."""

    @property
    def names(self) -> frozenset[TypeName]:
        return self.invalid.union(self.interfaces)

    def hash(self, name: TypeName) -> str:
        return self.hashers[name.package].hash(name)


@frozen
class Change:
    """A difference of an interface in words. Breakage of the wire and the hash is determined as a whole."""

    text: str
    api: bool = False


@frozen
class Difference:
    """How an interface differs; `breaks` is the set of broken guarantees. A new interface breaks nothing."""

    name: TypeName
    breaks: frozenset[str]
    changes: tuple[Change, ...] = ()
    hashes: tuple[str, str] = ("", "")
    """The old and the new hash; '' if the interface does not exist in that version."""
    invalid_in: tuple[str, ...] = ()
    """The versions, 'old' or 'new', in which the interface is invalid: then it is not compared."""


def version_of(catalogs: Iterable[Catalog], invalid: Iterable[TypeName]) -> Version:
    """Return the version that consists of the catalogs of packages, and of invalid interfaces."""
    interfaces: dict[TypeName, Interface] = {}
    messages: dict[TypeName, Message] = {}
    hashers = {}
    for catalog in catalogs:
        interfaces |= catalog.interfaces
        messages |= catalog.known
        hashers[catalog.package] = Hasher(catalog)
    return Version(interfaces, messages, hashers, frozenset(invalid))


def compare(old: Version, new: Version) -> list[Difference]:
    """Return the interfaces that differ or cannot be compared, sorted by name."""
    differences, wires = [], _Wires(old, new)
    for name in sorted(old.names | new.names):
        if invalid := tuple(
            each for each, version in (("old", old), ("new", new)) if name in version.invalid
        ):
            differences.append(Difference(name, frozenset(), invalid_in=invalid))
        elif name not in new.interfaces:
            differences.append(
                Difference(name, frozenset(ASPECTS), (Change("removed"),), (old.hash(name), ""))
            )
        elif name not in old.interfaces:
            differences.append(Difference(name, frozenset(), (Change("new"),), ("", new.hash(name))))
        elif difference := _compared(name, old, new, wires):
            differences.append(difference)
    return differences


def _compared(name: TypeName, old: Version, new: Version, wires: _Wires) -> Difference | None:
    hashes = old.hash(name), new.hash(name)
    sections = sections_of(old.interfaces[name]), sections_of(new.interfaces[name])
    titles = _SECTIONS[len(sections[0])]
    moves = _moves(titles, *sections)
    changes: list[Change] = []
    for title, before, after in zip(titles, *sections, strict=True):
        changes += _section_changes(title, before, after, moves)
    broken = {
        WIRE: moves or not all(wires.kept(*pair) for pair in zip(*sections, strict=True)),
        HASH: hashes[0] != hashes[1],
        API: any(change.api for change in changes),
    }
    breaks = frozenset(aspect for aspect, is_broken in broken.items() if is_broken)
    inner = sorted(nested_types(sections[0]) & nested_types(sections[1]))
    hashers = old.hashers[name.package], new.hashers[name.package]
    changed = [each for each in inner if hashers[0].hash(each) != hashers[1].hash(each)]
    changes += (Change(f"contains {each}, which has changed") for each in changed)
    return Difference(name, breaks, tuple(changes), hashes) if changes or breaks else None


def _moves(
    titles: tuple[str, ...], old: tuple[Message, ...], new: tuple[Message, ...]
) -> dict[str, tuple[str, str]]:
    """Return the old and the new section of each field that has moved to another one."""

    def homes(sections: tuple[Message, ...]) -> dict[str, list[str]]:
        titles_by_name = defaultdict(list)
        for title, section in zip(titles, sections, strict=True):
            for each in section.fields:
                titles_by_name[each.name].append(title)
        return titles_by_name

    before, after = homes(old), homes(new)
    common = (name for name in before if len(before[name]) == len(after.get(name, ())) == 1)
    return {name: (before[name][0], after[name][0]) for name in common if before[name] != after[name]}


class _Wires:
    """Decides whether messages of two versions are compatible; the results are cached."""

    def __init__(self, old: Version, new: Version) -> None:
        self._versions = old, new
        self._kept: dict[tuple[TypeName, TypeName], bool] = {}

    def kept(self, old: Message, new: Message) -> bool:
        """Return whether the bytes are the same, and belong to the same fields if both versions have them."""
        names = old.name, new.name
        if names not in self._kept:
            before, after = map(_places, (old, new), self._versions)
            types = [{each.name: each.type for each in message.fields} for message in (old, new)]
            layouts = [*map(_layout, map(Named, names), self._versions)]
            self._kept[names] = layouts[0] == layouts[1] and all(
                before[each] == after[each] and self._inside(types[0][each], types[1][each])
                for each in before.keys() & after.keys()
            )
        return self._kept[names]

    def _inside(self, old: Type, new: Type) -> bool:
        """Return whether the values inside a field, whose layout is kept, reach the fields of their names."""
        versions = self._versions
        match element_of(old), element_of(new):
            case (Named(one) as before, Named(other) as after):
                if type(old) is not type(new) and _layout(before, versions[0]) != _layout(after, versions[1]):
                    return True  # a sequence, and a message that contains it, have no fields in common
                return self.kept(versions[0].messages[one], versions[1].messages[other])
            case _:
                return True


def _places(message: Message, version: Version) -> dict[str, tuple[_Layout, _Layout]]:
    """Return the layout of the preceding fields, and that of the field itself, for each field."""
    offset, layouts = _Layout(), {}
    for each in message.fields:
        own = _layout(each.type, version)
        layouts[each.name] = offset, own
        offset += own
    return layouts


def _section_changes(
    title: str, old: Message, new: Message, moves: Mapping[str, tuple[str, str]]
) -> Iterator[Change]:
    where = f" of the {title}" if title else ""
    yield from _field_changes(where, old, new, moves.keys())
    for name, (source, target) in moves.items():
        if source == title:
            yield Change(f"field '{name}'{where} has moved to the {target}", api=True)
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
        elif removed := sorted(before[name].keys() - after[name].keys()):
            yield Change(f"enumeration '{name}'{where} no longer has {' and '.join(removed)}", api=True)


def _constant(constant: Constant) -> str:
    return f"{_type(constant.type, '')} {value_text(constant.value)}"


def _field_changes(where: str, old: Message, new: Message, moved: Collection[str]) -> Iterator[Change]:
    """Yield the changes of the fields; a field whose name alone has changed is renamed.

    Changes of fields that have `moved` to or from another section are left out.
    """
    before, after = ([each for each in message.fields if each.name not in moved] for message in (old, new))
    names = [[each.name for each in fields] for fields in (before, after)]
    removed, added = list[Field](), list[Field]()
    matcher = SequenceMatcher(a=names[0], b=names[1], autojunk=False)
    for _, i1, i2, j1, j2 in (each for each in matcher.get_opcodes() if each[0] != "equal"):
        old_fields, new_fields = before[i1:i2], after[j1:j2]
        if len(old_fields) != len(new_fields):
            removed += old_fields
            added += new_fields
            continue
        for one, other in zip(old_fields, new_fields, strict=True):
            if one.type == other.type and one.name not in names[1] and other.name not in names[0]:
                yield Change(f"field '{one.name}'{where} is now called '{other.name}'", api=True)
            else:
                removed.append(one)
                added.append(other)
    for one in removed:
        if one.name in names[1]:
            yield Change(f"field '{one.name}'{where} has moved")
        else:
            yield Change(f"field '{one.name}'{where} was removed", api=True)
    added_names = [other.name for other in added if other.name not in names[0]]
    yield from (Change(f"field '{name}'{where} is new") for name in added_names)
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


@frozen
class _Layout:
    """Everything that determines the bytes and the range of values, without names.

    A polynomial hash of a list of primitives, strings and sequences: arrays and nested messages, of which
    there may be millions, can be compared with expanded ones without being expanded. XCDR1 aligns
    primitives only, so that the members of a nested message can be treated as its owner's.
    """

    value: int = 0
    factor: int = 1

    def __add__(self, other: _Layout) -> _Layout:
        value = self.value * other.factor + other.value
        return _Layout(value % _MODULUS, self.factor * other.factor % _MODULUS)

    def times(self, number: int) -> _Layout:
        doubled, total = self, _Layout()
        while number:
            total = total + doubled if number % 2 else total
            doubled, number = doubled + doubled, number // 2
        return total


_MODULUS = 2**521 - 1
_BASE = int(digest("base", size=64), 16)


def _layout(type_: Type, version: Version) -> _Layout:
    match type_:
        case Array(of, size):
            return _layout(of, version).times(size)
        case Sequence(of, bound):
            part = f"{_layout(of, version)}[<={bound}]"
        case Named(name):
            if name not in version.layouts:
                fields = version.messages[name].fields
                layouts = (_layout(each.type, version) for each in fields)
                version.layouts[name] = sum(layouts, start=_Layout()) if fields else _part("nothing")
            return version.layouts[name]
        case Primitive(name):
            part = _SAME_BYTES.get(name, name)
        case String(wide, bound):
            part = f"{'wstring' if wide else 'string'}<={bound}"
    return _part(part)


def _part(text: str) -> _Layout:
    return _Layout(int(digest(text, size=64), 16) % _MODULUS, _BASE)
