"""The Python target: the modules of a catalog's interfaces, and their serializers beside them."""

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
    """Yield the Python package of the catalog's interfaces; for `root`, see python.interface_files."""
    yield from package_files(catalog)
    make = interface_files(catalog, root)
    for interface in catalog.interfaces.values():
        yield from make(interface)


def interface_files(catalog: Catalog, root: str = "") -> Callable[[Interface], Iterator[File]]:
    """Return what yields the modules of one interface.

    Raises InterfaceError for members that nothing in Python can hold.
    """
    raise_if_any(_impossible(catalog), InterfaceError)
    makers = (modules.interface_files(catalog, root), cdr.interface_files(catalog, root))

    def both(interface: Interface) -> Iterator[File]:
        for make in makers:
            yield from make(interface)

    return both


def _impossible(catalog: Catalog) -> Iterator[Problem]:
    """Yield what rosidl's Python generator gives up on, too: numbers wider than Python's own."""
    for interface in catalog.interfaces.values():
        for message in sections_of(interface):
            members: tuple[Field | Constant, ...] = (*message.fields, *message.constants)
            for member in members:
                if element_of(member.type) == Primitive("long double"):
                    text = f"Python cannot hold the long double '{member.name}'"
                    yield Problem(text, member.place, "use double, or leave out --lang python")
