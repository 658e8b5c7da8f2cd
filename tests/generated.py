"""Generate Python from definitions for tests, and make it importable."""

import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from forge.base.distributions import EMBEDDED
from forge.base.extensions import FORMATS, is_installed
from forge.base.files import write_if_changed
from forge.interfaces.model import (
    Catalog,
    Constant,
    File,
    Message,
    Primitive,
    Source,
    String,
    TypeName,
    sections_of,
)
from forge.interfaces.python import target
from forge.interfaces.python.types import module_name
from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library, read_folder
from forge.interfaces.resolve.resolution import dependency_catalogs, resolve
from forge.interfaces.writing import parts

reads_idl = pytest.mark.skipif(not is_installed(FORMATS, "idl"), reason="the plugin 'idl' is not installed")

RUNTIME = EMBEDDED / "rosidl_default_runtime" / "python"
PROBE = Path(__file__).parent / "data" / "probe"
"""A package with a field of every kind, every default and every awkward name."""

INTEGERS = {
    **{f"int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
}
CODES = dict(zip(INTEGERS, "bhiqBHIQ", strict=True)) | {"float32": "f", "float64": "d"}
"""The type code of an array of each numeric type."""


def catalog_of(package: str, definitions: Mapping[str, str], *extra: Message) -> Catalog:
    """Return the catalog of definitions such as {'msg/X.msg': 'int8 a'}; they may use embedded packages.

    `extra` are further messages, such as those that only IDL can define.
    """
    sources = [
        Source(package, path, Path("/src") / package / path, text) for path, text in definitions.items()
    ]
    catalog = resolve(package, parse_all(sources), Library())
    more = {message.name: message for message in extra}
    return replace(catalog, interfaces={**catalog.interfaces, **more}, known={**catalog.known, **more})


def difficult_constants() -> Message:
    """Return a message of constants that are difficult to write in C and C++."""
    doc = ("ends in a backslash \\", "", "*/ and /* and ??/")
    values: dict[str, tuple[Primitive | String, bool | float | str]] = {
        "LOWEST": (Primitive("int64"), -(2**63)),
        "HIGHEST": (Primitive("uint64"), 2**64 - 1),
        "LOW": (Primitive("int32"), -(2**31)),
        "YES": (Primitive("boolean"), True),
        "OCTET": (Primitive("octet"), 255),
        "TENTH": (Primitive("float"), 0.1),
        "ENDLESS": (Primitive("double"), float("inf")),
        "NOTHING": (Primitive("float"), float("nan")),
        "TINY": (Primitive("float"), 1e-60),
        "HUGE": (Primitive("float"), 1e60),
        "LEAST": (Primitive("double"), 5e-324),
        "ERROR": (Primitive("int8"), 1),
        "DELETE": (Primitive("int8"), 2),
        "NO_ERROR": (Primitive("int8"), 3),
        "QUOTED": (String(), 'a "b" \\ c\n\tend??/'),
        "NAME": (String(), "café 日"),
        "WIDE": (String(wide=True), "café 日 😀"),
        "ZERO_INSIDE": (String(), "a\x001"),
        "HALF": (String(wide=True), "\ud800f\0"),
    }
    name = TypeName("probe", "msg", "Constants")
    return Message(name, (), tuple(Constant(n, t, v, doc) for n, (t, v) in values.items()), doc)


def render(catalog: Catalog, target: str) -> tuple[File, ...]:
    """Return all files of a target, below a folder of its name: 'python/std_msgs/msg/_string.py'."""
    return tuple(file for part in parts(catalog, target, {}) for file in part.files())


def probe_catalog() -> Catalog:
    """Return the catalog of the package 'probe'."""
    return resolve("probe", parse_all(read_folder("probe", PROBE)), Library())


def embedded_catalog(package: str) -> Catalog:
    """Return the catalog of an embedded package."""
    return resolve(package, parse_all(read_folder(package, EMBEDDED / package)), Library())


def generate(folder: Path, catalog: Catalog) -> None:
    """Generate the Python of a catalog and of the packages that it depends on."""
    for each in (catalog, *dependency_catalogs(catalog, Library())):
        for file in target.files(each):
            write_if_changed(folder / file.path, file.text)


def generate_embedded(folder: Path) -> None:
    """Generate the Python of all embedded interfaces."""
    for package in Library().packages():
        for file in target.files(embedded_catalog(package)):
            write_if_changed(folder / file.path, file.text)


@contextmanager
def importable(folder: Path) -> Iterator[None]:
    """Put generated code and its run time on sys.path; unload the modules afterwards."""
    added = [str(folder), str(RUNTIME)]
    sys.path[:0] = added
    try:
        yield
    finally:
        for path in added:
            sys.path.remove(path)
        for name, module in list(sys.modules.items()):
            if str(getattr(module, "__file__", None) or "").startswith(f"{folder}/"):
                del sys.modules[name]


def run_python(folder: Path, code: str, *options: str) -> str:
    """Return the output of code in a new interpreter that finds the generated modules."""
    variables = {"PYTHONPATH": f"{folder}:{RUNTIME}", "PYTHONDONTWRITEBYTECODE": "1"}
    argv = [sys.executable, *options, "-c", code]
    return subprocess.run(argv, env=variables, check=True, capture_output=True, text=True).stdout.strip()


def classes_of(message: Message) -> dict[str, Any]:
    """Execute the generated module of a message and return its names."""
    catalog = Catalog(message.name.package, {message.name: message}, {message.name: message}, {})
    text = next(file.text for file in target.files(catalog) if "/_" in file.path.replace("__init__", ""))
    names: dict[str, Any] = {"__name__": str(message.name).replace("/", ".")}
    exec(compile(text, str(message.name), "exec"), names)
    return names


def section_classes(catalog: Catalog) -> list[Any]:
    """Import the classes of all messages, and of the parts of services and actions, of a catalog."""
    return [
        getattr(import_module(module_name(interface.name)), part.name.name)
        for interface in catalog.interfaces.values()
        for part in sections_of(interface)
    ]


def refused(words: str) -> pytest.RaisesExc[AssertionError]:
    """Expect an AssertionError with exactly this message."""
    return pytest.raises(AssertionError, match=f"^{re.escape(words)}$")
