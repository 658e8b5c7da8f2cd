"""The Python target: message modules, their stubs and serializers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.errors import InterfaceError, Problem, raise_if_any
from forge.interfaces.model import Primitive, element_of, sections_of
from forge.interfaces.python import cdr, modules
from forge.interfaces.python.modules import package_files

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from forge.interfaces.model import Catalog, Constant, Field, File, Interface

__all__ = ["files", "interface_files", "package_files"]


def files(catalog: Catalog, root: str = "") -> Iterator[File]:
    """Yield the files of the Python package; paths are relative to a folder on the Python path.

    For `root`, see modules.interface_files().
    """
    yield from package_files(catalog)
    files_of = interface_files(catalog, root)
    for interface in catalog.interfaces.values():
        yield from files_of(interface)


def interface_files(catalog: Catalog, root: str = "") -> Callable[[Interface], Iterator[File]]:
    """Return a function that yields the modules of one interface.

    Raises InterfaceError for members without a type in Python.
    """
    raise_if_any(_unsupported(catalog), InterfaceError)
    generators = (modules.interface_files(catalog, root), cdr.interface_files(catalog, root))

    def files_of(interface: Interface) -> Iterator[File]:
        for generate in generators:
            yield from generate(interface)

    return files_of


def _unsupported(catalog: Catalog) -> Iterator[Problem]:
    for interface in catalog.interfaces.values():
        for message in sections_of(interface):
            members: tuple[Field | Constant, ...] = (*message.fields, *message.constants)
            for member in members:
                if element_of(member.type) == Primitive("long double"):
                    text = f"Python has no type for the long double '{member.name}'"
                    yield Problem(text, member.place, "use double, or leave out --lang python")
