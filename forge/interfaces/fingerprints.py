"""Hashes of the inputs of generated code: the definition of an interface and of all nested messages."""

from __future__ import annotations

import hashlib
from graphlib import TopologicalSorter
from typing import TYPE_CHECKING

from forge.interfaces.model import messages_of, nested_types

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from forge.interfaces.model import Catalog, Interface, Source, TypeName


def fingerprints(catalogs: Iterable[Catalog], generator: str) -> dict[TypeName, str]:
    """Return a digest for each interface of the catalogs and for each nested message.

    It covers the texts of all definitions that the code depends on, whether it describes types, and
    `generator`, which identifies the version of the generator.
    """
    interfaces: dict[TypeName, Interface] = {}
    sources: dict[TypeName, Source] = {}
    described = False
    for catalog in catalogs:
        sources.update(catalog.sources)
        interfaces.update({name: catalog.known[name] for name in catalog.sources if name in catalog.known})
        interfaces.update(catalog.interfaces)
        described |= catalog.has_descriptions
    owners = {message.name: name for name, each in interfaces.items() for message in messages_of(each)}
    needs = {}
    for name, interface in interfaces.items():
        names = nested_types(messages_of(interface))
        needs[name] = {owners.get(need, need) for need in names} - {name}
    digests: dict[TypeName, str] = {}
    for name in TopologicalSorter(needs).static_order():
        below = [digests[need] for need in sorted(needs.get(name, ()))]
        source = sources.get(name)
        text = f"{source.relative}\0{source.text}" if source else ""
        digests[name] = _digest(generator, str(described), text, *below)
    return digests


def fingerprint_of_all(catalog: Catalog, digests: Mapping[TypeName, str]) -> str:
    """Return a digest of a whole catalog, including the names of its interfaces."""
    return _digest(*(f"{name} {digests[name]}" for name in catalog.interfaces))


def _digest(*texts: str) -> str:
    return hashlib.sha256("\0".join(texts).encode("utf-8", "surrogatepass")).hexdigest()[:32]
