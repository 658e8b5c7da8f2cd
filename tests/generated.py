"""Generated Python for tests: definitions in, modules on sys.path out."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from forge.files import write_if_changed
from forge.interfaces import python
from forge.interfaces.model import Source
from forge.interfaces.parsing import parse_all
from forge.interfaces.resolution import referred, resolve
from forge.interfaces.sources import EMBEDDED, Library

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from forge.interfaces.model import Catalog

RUNTIME = EMBEDDED / "rosidl_default_runtime" / "python"


def catalog_of(package: str, definitions: Mapping[str, str]) -> Catalog:
    """Return the catalog of definitions such as {'msg/X.msg': 'int8 a'}, embedded packages known."""
    sources = [
        Source(package, path, Path("/src") / package / path, text) for path, text in definitions.items()
    ]
    return resolve(package, parse_all(sources), Library())


def generate(folder: Path, catalog: Catalog) -> None:
    """Write the catalog's Python and that of what it refers to in other packages."""
    for each in (catalog, *referred(catalog, Library())):
        for file in python.files(each):
            write_if_changed(folder / file.path, file.text)


@contextmanager
def importable(folder: Path) -> Iterator[None]:
    """Put generated code and its run time on sys.path; forget the generated modules afterwards."""
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
