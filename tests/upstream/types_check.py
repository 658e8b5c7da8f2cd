"""`python -m tests.upstream.types_check PACKAGE...`: import every type and compare its bytes with rosbags'.

It runs in the environment of a built workspace. rosbags reads the installed definitions with its own parser,
so that neither the order nor the types of fields come from forge. It prints JSON: the number of types of each
package, the faults of those that have one, and which ones rosbags cannot read. Those are only read back.
"""

import json
import os
import random
import re
import string
import sys
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from tests.generated import INTEGERS
from tests.messages import class_of, plain

EXAMPLES = 5
_SECTIONS = {"msg": ("",), "srv": ("_Request", "_Response"), "action": ("_Goal", "_Result", "_Feedback")}
_WSTRING = re.compile(r"^\s*wstring\b", re.MULTILINE)
_INCLUDE = re.compile(r"^\s*#include.*", re.MULTILINE)


def main(packages: Sequence[str]) -> int:
    """Check the packages and print what was found."""
    prefixes = [Path(entry) for entry in os.environ["AMENT_PREFIX_PATH"].split(os.pathsep)]
    shares = {path.name: path for prefix in prefixes for path in prefix.glob("share/*") if path.is_dir()}
    definitions = {name: list(_definitions(share)) for name, share in shares.items()}
    peer, unread = _peer([path for paths in definitions.values() for path in paths])
    types: dict[str, int] = {}
    faults: dict[str, str] = {}
    for package in packages:
        types[package] = len(definitions.get(package, ()))
        for path in definitions.get(package, ()):
            for name, class_ in _classes(path, faults):
                fault = _fault(peer, name, class_)
                if fault:
                    faults[name] = fault
    mine = {name: why for name, why in unread.items() if name.partition("/")[0] in packages}
    print(json.dumps({"types": types, "faults": faults, "unread": mine}))
    return 0


def _definitions(share: Path) -> Iterator[Path]:
    """Yield the installed definitions of a package: its own text where there is one, else the .idl file."""
    for kind in _SECTIONS:
        stems = {path.stem: path for ending in ("idl", kind) for path in (share / kind).glob(f"*.{ending}")}
        yield from (stems[stem] for stem in sorted(stems))


def _peer(paths: Sequence[Path]) -> tuple[Any, dict[str, str]]:
    """Return rosbags' store of all these types, and why it lacks those that it cannot read."""
    store = get_typestore(Stores.EMPTY)
    types: dict[str, Any] = {}
    unread: dict[str, str] = {}
    for path in paths:
        types.update(_read_by_peer(path, unread))
    store.register(types)
    return store, unread


def _read_by_peer(path: Path, unread: dict[str, str]) -> dict[str, Any]:
    """Return the fields of a definition's messages as rosbags describes them; none if it cannot read it."""
    try:
        return {name: ([], _unsigned(fields)) for name, (_, fields) in _described_by_peer(path).items()}
    except Exception as error:
        unread[_name(path)] = str(error)[:200]
        return {}


def _unsigned(described: Any) -> Any:
    """Return a description with bytes as forge and ROS 2 have them: rosbags' are signed."""
    if isinstance(described, list | tuple):
        return type(described)(_unsigned(item) for item in described)
    return "uint8" if described == "byte" else described


def _described_by_peer(path: Path) -> dict[str, Any]:
    text = path.read_text(encoding="utf-8-sig")
    if path.suffix == ".idl":
        # rosbags reads no #include and needs none: names in .idl files are complete.
        return _flat_names(get_types_from_idl(_INCLUDE.sub("", text)))
    texts = re.split(r"^---.*$", text, flags=re.MULTILINE)
    types: dict[str, Any] = {}
    for suffix, part in zip(_SECTIONS[path.suffix[1:]], texts, strict=True):
        if not _WSTRING.search(part):  # rosbags has no wstring
            types.update(get_types_from_msg(part, f"{_flat(path)}{suffix}"))
    return types


def _flat_names(types: Mapping[str, Any]) -> dict[str, Any]:
    """Return the types of an .idl file as if all were messages, see `_flat`."""
    return {re.sub(r"/(srv|action)/", "/msg/", name): fields for name, fields in types.items()}


def _name(path: Path) -> str:
    return f"{path.parents[1].name}/{path.parent.name}/{path.stem}"


def _flat(path: Path) -> str:
    """Return the name of a definition as if it were a message: so rosbags finds the types it refers to."""
    return f"{path.parents[1].name}/msg/{path.stem}"


def _classes(path: Path, faults: dict[str, str]) -> Iterator[tuple[str, Any]]:
    """Yield rosbags' name and forge's class of each message of a definition."""
    name = _name(path)
    package, kind, stem = name.split("/")
    try:
        class_ = getattr(import_module(f"{package}.{kind}"), stem)
        for suffix in _SECTIONS[kind]:
            yield _flat(path) + suffix, getattr(class_, suffix[1:]) if suffix else class_
    except (ImportError, AttributeError, SyntaxError) as error:
        faults[name] = f"cannot be imported: {error}"


def _fault(peer: Any, name: str, class_: Any) -> str | None:
    """Return what is wrong with a type, None if both libraries agree on every example."""
    chance = random.Random(name)
    try:
        for _ in range(EXAMPLES):
            message = _message(chance, class_, 0)
            fault = _difference(peer, name, message)
            if fault:
                return fault
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return None


def _difference(peer: Any, name: str, message: Any) -> str | None:
    forge_cdr: Any = import_module("forge_cdr")
    data = forge_cdr.serialize(message)
    if forge_cdr.deserialize(data, type(message)) != message:
        return "reads other values than it wrote"
    if name not in peer.types:
        return None
    other = peer.deserialize_cdr(data, name)
    if plain(other) != plain(message):
        return "rosbags reads other values"
    if bytes(peer.serialize_cdr(other, name)) != data:
        return "rosbags writes other bytes"
    big = bytes(peer.serialize_cdr(other, name, little_endian=False))
    if forge_cdr.deserialize(big, type(message)) != message:
        return "reads other values from rosbags' big-endian bytes"
    return None


def _message(chance: random.Random, class_: Any, depth: int) -> Any:
    slots = zip(class_.__slots__, class_.SLOT_TYPES, strict=True)
    return class_(**{slot[1:]: _value(chance, type_, class_, depth) for slot, type_ in slots})


def _value(chance: random.Random, type_: Any, owner: Any, depth: int) -> Any:
    word = type(type_).__name__
    if word == "BasicType":
        return _number(chance, type_.typename)
    if "String" in word:
        size = min(chance.randrange(9), getattr(type_, "maximum_size", 9))
        return "".join(chance.choices(string.printable + "äß☃", k=size))
    if word == "NamespacedType":
        return _message(chance, class_of(owner, type_), depth + 1)
    few = 3 if depth < 2 else 1
    if word == "Array":
        values = [_value(chance, type_.value_type, owner, depth) for _ in range(min(type_.size, few))]
        return [values[index % len(values)] for index in range(type_.size)]
    size = chance.randint(0, min(few, getattr(type_, "maximum_size", few)))
    return [_value(chance, type_.value_type, owner, depth) for _ in range(size)]


def _number(chance: random.Random, name: str) -> Any:
    """Return a number whose bytes differ from those of most others."""
    match name:
        case "boolean":
            return chance.random() < 0.5
        case "octet":
            return chance.randbytes(1)
        case "char" | "wchar":
            return chr(chance.randrange(1, 127))
        case "float" | "double" | "long double":
            return chance.randrange(-(2**20), 2**20) / 64  # the same in both widths
        case _:
            return chance.randint(*INTEGERS[name])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
