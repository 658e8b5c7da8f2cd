"""Generate Python from definitions for tests, and make it importable."""

import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from forge.base.distributions import EMBEDDED
from forge.base.files import write_if_changed
from forge.interfaces.model import Catalog, File, Message, Source, sections_of
from forge.interfaces.python import target
from forge.interfaces.python.types import module_name
from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library, read_folder
from forge.interfaces.resolve.resolution import dependency_catalogs, resolve
from forge.interfaces.writing import parts

RUNTIME = EMBEDDED / "rosidl_default_runtime" / "python"
PROBE = Path(__file__).parent / "data" / "probe"
"""A package with a field of every kind, every default and every awkward name."""

INTEGERS = {
    **{f"int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
}
CODES = dict(zip(INTEGERS, "bhiqBHIQ", strict=True)) | {"float32": "f", "float64": "d"}
"""The type code of an array of each numeric type."""


def catalog_of(package: str, definitions: Mapping[str, str]) -> Catalog:
    """Return the catalog of definitions such as {'msg/X.msg': 'int8 a'}; they may use embedded packages."""
    sources = [
        Source(package, path, Path("/src") / package / path, text) for path, text in definitions.items()
    ]
    return resolve(package, parse_all(sources), Library())


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
