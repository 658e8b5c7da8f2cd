"""The Python target: the modules of a catalog's interfaces, and their serializers beside them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.interfaces import python, python_cdr
from forge.interfaces.python import package_files

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from forge.interfaces.model import Catalog, File, Interface

__all__ = ["files", "interface_files", "package_files"]


def files(catalog: Catalog) -> Iterator[File]:
    """Yield the Python package of the catalog's interfaces, to be put where Python finds packages."""
    yield from package_files(catalog)
    make = interface_files(catalog)
    for interface in catalog.interfaces.values():
        yield from make(interface)


def interface_files(catalog: Catalog) -> Callable[[Interface], Iterator[File]]:
    """Return what yields the modules of one interface."""
    makers = (python.interface_files(catalog), python_cdr.interface_files(catalog))

    def both(interface: Interface) -> Iterator[File]:
        for make in makers:
            yield from make(interface)

    return both
