"""The wire format of C++ against that of Python: the same bytes and the same values.

Of embedded messages with the same fields, one is compared, and none that is nested in another one.

One program is compiled per run. FORGE_CDR_EXAMPLES sets how many messages of each type are drawn,
FORGE_CDR_MUTATIONS how many spoilt buffers are read; `make fuzz` sets both to what takes a while, and has
the program watched for every access and every overflow.
"""

import os
import struct
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from importlib import import_module
from itertools import count
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import HealthCheck, given, settings

from forge.base.distributions import EMBEDDED
from forge.base.files import write_if_changed
from forge.base.names import snake_case
from forge.interfaces.cpp import target as cpp
from forge.interfaces.cpp.headers import main_path
from forge.interfaces.cpp.text import qualified
from forge.interfaces.model import Catalog, Message, Named, TypeName, messages_of
from forge.interfaces.python import target as python
from forge.interfaces.read.sources import Library
from tests import fastcdr
from tests.generated import embedded_catalog, importable, probe_catalog
from tests.messages import class_of, messages, plain

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent
RUNTIME = EMBEDDED / "rosidl_default_runtime" / "include"
CHECKS = HERE.parent / "integration" / "interfaces" / "cpp"
EXAMPLES = int(os.environ.get("FORGE_CDR_EXAMPLES", "5"))
MUTATIONS = int(os.environ.get("FORGE_CDR_MUTATIONS", "5000"))
SANITIZED = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all") if MUTATIONS > 100_000 else ()
NOT_INLINED = () if SANITIZED else ("-Dalways_inline=unused",)
"""Compiles in half the time; the programs of tests/integration/interfaces/cpp have everything inlined."""


@cache
def catalogs() -> tuple[Catalog, ...]:
    """Return all packages that forge brings along, and one with fields of every kind."""
    return (*map(embedded_catalog, Library().packages()), probe_catalog())


@cache
def known() -> dict[TypeName, Message]:
    """Return every message of these packages, derived ones included."""
    return {
        message.name: message
        for catalog in catalogs()
        for interface in catalog.interfaces.values()
        for message in messages_of(interface)
    }


@cache
def compared() -> tuple[TypeName, ...]:
    """Return the messages to compare: all, or one per sequence of fields without the nested ones."""
    if SANITIZED:
        return tuple(known())
    nested = {
        of.name
        for message in known().values()
        for of in (getattr(field.type, "of", field.type) for field in message.fields)
        if isinstance(of, Named)
    }
    by_fields = {fields(name): name for name in reversed(known())}
    return tuple(name for name in by_fields.values() if name not in nested)


@cache
def fields(name: TypeName) -> tuple[object, ...]:
    """Return types and bounds of all fields, with those of nested messages in their place."""
    found: list[object] = []
    for type_ in (field.type for field in known()[name].fields):
        of = getattr(type_, "of", type_)
        inner = fields(of.name) if isinstance(of, Named) else of
        found.append((type(type_), getattr(type_, "size", None), getattr(type_, "bound", None), inner))
    return tuple(found)


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Generate C++ and Python, and let the latter be imported."""
    made = tmp_path_factory.mktemp("both")
    for catalog in catalogs():
        for file in cpp.files(catalog):
            write_if_changed(made / "cpp" / file.path, file.text)
        for file in python.files(catalog):
            write_if_changed(made / "python" / file.path, file.text)
    with importable(made / "python"):
        yield made


@pytest.fixture(scope="module")
def program(folder: Path) -> Path:
    """Compile the program that knows the messages."""
    headers = [
        main_path(name, "hpp")
        for catalog in catalogs()
        for name, interface in catalog.interfaces.items()
        if any(message.name in compared() for message in messages_of(interface))
    ]
    includes = "".join(f'#include "{header}"\n' for header in headers)
    types = " \\\n".join(f"  DO({qualified(name)})" for name in compared())
    write_if_changed(folder / "cpp" / "types.hpp", f"{includes}\n#define EACH(DO) \\\n{types}\n")
    compiled(folder, (*SANITIZED, HERE / "cpp" / "again.cpp", "-o", folder / "again"))
    return folder / "again"


def compiled(folder: Path, arguments: Sequence[str | Path]) -> None:
    """Run the compiler without a warning."""
    warnings = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")
    folders = ("-I", folder / "cpp", "-I", RUNTIME, "-I", CHECKS)
    argv: list[str | Path] = ["g++", "-std=c++17", *NOT_INLINED, *warnings, *folders, *arguments]
    done = subprocess.run(argv, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:4000]


def answers(program: Path, records: Iterable[tuple[TypeName, bytes]]) -> list[bytes]:
    """Return what the program says about messages: their bytes, their text, and so on."""
    numbers = {name: number for number, name in enumerate(compared())}
    asked = b"".join(struct.pack("=II", numbers[name], len(data)) + data for name, data in records)
    said = subprocess.run([program], input=asked, capture_output=True, check=True).stdout
    found, offset = [], 0
    while offset < len(said):
        (size,) = struct.unpack_from("=I", said, offset)
        found.append(said[offset + 4 : offset + 4 + size])
        offset += 4 + size
    return found


def python_class(name: TypeName) -> Any:
    stem = name.name.partition("_")[0]
    return getattr(import_module(f"{name.package}.{name.kind}._{snake_case(stem)}"), name.name)


def drawn(name: TypeName) -> list[bytes]:
    """Return the bytes of random messages as Python writes them."""
    forge_cdr: Any = import_module("forge_cdr")
    class_ = python_class(name)
    found: list[bytes] = []

    @settings(
        max_examples=EXAMPLES,
        deadline=None,
        database=None,
        derandomize=True,
        suppress_health_check=list(HealthCheck),
    )
    @given(messages(class_))
    def draw(message: Any) -> None:
        found.append(forge_cdr.serialize(message))

    draw()
    return found


@pytest.mark.needs("g++")
def test_cpp_round_trips_messages_written_by_python(program: Path) -> None:
    records = [(name, data) for name in compared() for data in drawn(name)]
    said = answers(program, records)[::2]
    different = [str(name) for (name, data), again in zip(records, said, strict=True) if data != again]
    assert different == []


@pytest.mark.needs("g++")
def test_values_are_read_into_the_right_fields(program: Path) -> None:
    """Every value of a message differs from the others; C++ shows it as YAML."""
    forge_cdr: Any = import_module("forge_cdr")
    sent = {name: numbered(python_class(name), count(1)) for name in compared()}
    said = answers(program, [(name, forge_cdr.serialize(message)) for name, message in sent.items()])
    texts = [text.replace(b"off: ", b"'off': ") for text in said[1::2]]  # a field that YAML takes for false
    shown = [yaml.load(text, yaml.CSafeLoader) for text in texts]
    for message, values in zip(sent.values(), shown, strict=True):
        assert values == without_empty(plain(message)), type(message)


def numbered(class_: Any, numbers: Iterator[int]) -> Any:
    """Return a message whose values are those numbers, as far as their types can tell."""
    slots = zip(class_.__slots__, class_.SLOT_TYPES, strict=True)
    return class_(**{slot[1:]: _numbered(type_, class_, numbers) for slot, type_ in slots})


def _numbered(type_: Any, owner: Any, numbers: Iterator[int]) -> Any:
    word = type(type_).__name__
    if word == "NamespacedType":
        return numbered(class_of(owner, type_), numbers)
    if hasattr(type_, "value_type"):
        size = getattr(type_, "size", min(getattr(type_, "maximum_size", 2), 2))
        return [_numbered(type_.value_type, owner, numbers) for _ in range(size)]
    number = next(numbers)
    if "String" in word:
        return f"a{number}"[: getattr(type_, "maximum_size", None)]
    if type_.typename == "boolean":
        return number % 2 == 0
    if type_.typename == "octet":
        return bytes([number % 256])
    return number % 1000 + 0.5 if type_.typename in {"float", "double"} else number % 128


def without_empty(values: Any) -> Any:
    """Return values as YAML in C++ shows them: nothing where a message has no fields."""
    if isinstance(values, dict):
        return {name: without_empty(value) for name, value in values.items()} or None
    return [without_empty(value) for value in values] if isinstance(values, list) else values


@pytest.mark.needs("g++")
def test_corrupt_bytes_are_read_safely(program: Path) -> None:
    """They give a message or an error, with memory in proportion, whatever the type."""
    times = max(1, MUTATIONS // len(compared()))
    ran = subprocess.run([program, str(times), "1"], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "", "")


@pytest.mark.needs("g++", fastcdr.HEADER)
def test_fast_cdr_writes_the_same_bytes(folder: Path) -> None:
    """It is driven as ROS drives it; both read what the other wrote."""
    names = compared()
    write_if_changed(folder / "cpp" / "peer.hpp", fastcdr.declarations(names, known()))
    write_if_changed(folder / "cpp" / "peer.cpp", fastcdr.definitions(names, known(), "peer.hpp"))
    types = " \\\n".join(f"  DO({qualified(name)})" for name in names)
    write_if_changed(
        folder / "cpp" / "peer_types.hpp", f'#include "peer.cpp"\n#define EACH(DO) \\\n{types}\n'
    )
    source = HERE / "cpp" / "fastcdr.cpp"
    compiled(folder, ("-Wno-error", source, "-o", folder / "fastcdr", "-lfastcdr"))
    ran = subprocess.run([folder / "fastcdr", "7"], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout) == (0, "")
