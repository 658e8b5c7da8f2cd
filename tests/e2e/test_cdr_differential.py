"""The wire format in Python beside rosbags': every embedded message, random values, the same bytes.

FORGE_CDR_EXAMPLES sets how many messages of each type are drawn, FORGE_CDR_MUTATIONS how many spoilt
buffers are read; `make fuzz` sets both to what takes a while.
"""

import os
import random
import sys
import tracemalloc
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from forge.base.names import snake_case
from forge.interfaces.model import (
    Array,
    Message,
    Named,
    Primitive,
    Sequence,
    String,
    Type,
    TypeName,
    messages_of,
)
from forge.interfaces.read.sources import Library
from tests.generated import embedded_catalog, generate_embedded, importable
from tests.messages import messages, plain

EXAMPLES = int(os.environ.get("FORGE_CDR_EXAMPLES", "5"))
MUTATIONS = int(os.environ.get("FORGE_CDR_MUTATIONS", "5000"))
NO_PEER = {"example_interfaces/msg/WString"}
"""rosbags has no wstring."""

_WORDS = {"boolean": "bool", "octet": "uint8", "float": "float32", "double": "float64"}


@cache
def known() -> dict[str, Message]:
    """Return every message that forge brings along, derived ones included, by its full name."""
    found = {}
    for package in Library().packages():
        for interface in embedded_catalog(package).interfaces.values():
            found.update({str(message.name): message for message in messages_of(interface)})
    return found


NAMES = sorted(known().keys() - NO_PEER)


@pytest.fixture(scope="module", autouse=True)
def generated(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Generate all of it and let it be imported."""
    folder = tmp_path_factory.mktemp("python")
    generate_embedded(folder)
    with importable(folder):
        yield folder


@cache
def store() -> Any:
    """Return rosbags' store with all these types, defined by forge's model."""
    made = get_typestore(Stores.EMPTY)
    made.register({name: ([], _fields(message)) for name, message in known().items() if name not in NO_PEER})
    return made


def _fields(message: Message) -> list[tuple[str, Any]]:
    return [(member.name, _described(member.type)) for member in message.members]


def _described(type_: Type) -> Any:
    match type_:
        case Primitive(name):
            return Nodetype.BASE, (_WORDS.get(name, name), 0)
        case String():
            return Nodetype.BASE, ("string", 0)
        case Named(name):
            return Nodetype.NAME, str(name)
        case Array(of, size):
            return Nodetype.ARRAY, (_described(of), size)
        case Sequence(of, bound):
            return Nodetype.SEQUENCE, (_described(of), bound or 0)


def class_of(name: TypeName) -> Any:
    stem = name.name.partition("_")[0]
    return getattr(import_module(f"{name.package}.{name.kind}._{snake_case(stem)}"), name.name)


def relaxed(examples: int) -> settings:
    """Return settings under which nothing depends on time or on earlier runs."""
    return settings(
        max_examples=examples,
        deadline=None,
        database=None,
        derandomize=True,
        suppress_health_check=list(HealthCheck),
    )


def fast(word: str, class_: Any) -> Any:
    """Return the generated writer or reader of a class, with nothing behind it that would make good."""
    return getattr(sys.modules[f"{class_.__module__}__cdr"], f"{word}_{class_.__name__}")()


@pytest.mark.parametrize("name", NAMES)
def test_forge_and_rosbags_agree_on_bytes_and_values(name: str) -> None:
    forge_cdr: Any = import_module("forge_cdr")
    described: Any = import_module("forge_cdr.described")
    class_ = class_of(known()[name].name)

    @relaxed(EXAMPLES)
    @given(messages(class_))
    def check(message: Any) -> None:
        data = forge_cdr.serialize(message)
        assert fast("writer", class_)(message) == data == described.write(message)
        peer = store().deserialize_cdr(data, name)
        assert bytes(store().serialize_cdr(peer, name)) == data
        assert plain(peer) == plain(message)
        assert fast("reader", class_)(data, sys.maxsize) == message
        assert forge_cdr.deserialize(data, class_, copy=False) == message
        assert described.read(data, class_) == message
        big = bytes(store().serialize_cdr(peer, name, little_endian=False))
        assert forge_cdr.deserialize(big, class_) == message

    check()


def test_truncated_messages_are_rejected() -> None:
    forge_cdr: Any = import_module("forge_cdr")
    for name in NAMES:
        class_ = class_of(known()[name].name)
        data = forge_cdr.serialize(_example(class_))
        for size in range(min(len(data), 600)):
            with pytest.raises(forge_cdr.CdrError) as caught:
                forge_cdr.deserialize(data[:size], class_)
            assert caught.value.offset <= size + 8, name
            with pytest.raises(forge_cdr._REFUSALS):
                fast("reader", class_)(data[:size], sys.maxsize)


def test_corrupt_bytes_are_read_or_rejected_in_bounded_memory() -> None:
    """Each is read by generated code and by the exact one, which must agree."""
    forge_cdr: Any = import_module("forge_cdr")
    described: Any = import_module("forge_cdr.described")
    classes = [class_of(known()[name].name) for name in NAMES]
    good = [(class_, forge_cdr.serialize(_example(class_))) for class_ in classes]
    chance = random.Random(1)
    for _ in range(MUTATIONS):
        class_, data = chance.choice(good)
        spoilt = _spoil(data, chance)
        results = [_outcome(reader, spoilt, class_) for reader in (forge_cdr.deserialize, described.read)]
        assert results[0] == results[1], (class_, spoilt.hex())


def test_reading_uses_memory_proportional_to_the_input() -> None:
    forge_cdr: Any = import_module("forge_cdr")
    classes = [class_of(known()[name].name) for name in NAMES]
    good = [(class_, forge_cdr.serialize(_example(class_))) for class_ in classes]
    chance = random.Random(2)
    tracemalloc.start()
    try:
        for _ in range(MUTATIONS // 10):
            class_, data = chance.choice(good)
            spoilt = _spoil(data, chance)
            before = tracemalloc.get_traced_memory()[0]
            tracemalloc.reset_peak()
            _outcome(forge_cdr.deserialize, spoilt, class_)
            # An empty message is one byte on the wire and an object of some fifty in Python.
            assert tracemalloc.get_traced_memory()[1] - before < 300_000 + 200 * len(spoilt)
    finally:
        tracemalloc.stop()


@cache
def _example(class_: Any) -> Any:
    """Return one random message that is worth spoiling: the largest of some."""
    found: list[Any] = []
    forge_cdr: Any = import_module("forge_cdr")

    def gather(message: Any) -> None:
        found.append(message)

    relaxed(8)(given(messages(class_))(gather))()
    return max(found, key=lambda message: len(forge_cdr.serialize(message)))


def _spoil(data: bytes, chance: random.Random) -> bytes:
    """Return the data with some bytes changed, some of them to what a huge count would be, or cut."""
    spoilt = bytearray(data)
    for _ in range(chance.randint(1, 4)):
        position = chance.randrange(len(spoilt))
        match chance.randrange(4):
            case 0:
                spoilt[position] = chance.randrange(256)
            case 1:
                spoilt[position : position + 4] = chance.choice(
                    (b"\xff\xff\xff\xff", b"\0\0\0\0", b"\1\0\0\0")
                )
            case 2:
                del spoilt[position:]
                spoilt += bytes(4)
            case _:
                spoilt[position:position] = chance.randbytes(chance.randint(1, 9))
    return bytes(spoilt)


def _outcome(read: Any, data: bytes, class_: Any) -> Any:
    """Return what reading gives: the message's representation, nan included, or that it was refused."""
    forge_cdr: Any = import_module("forge_cdr")
    try:
        return repr(read(data, class_))
    except forge_cdr.CdrError:
        return "refused"
