"""Generate the files of a catalog for each target, and hash what they are generated from."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from graphlib import TopologicalSorter
from importlib import import_module

from forge.base.errors import ForgeError, InterfaceError, Problem, raise_if_any
from forge.base.extensions import OWN, entry_points, find
from forge.base.extensions import TARGETS as PLUGINS
from forge.base.frozen import frozen
from forge.base.names import did_you_mean
from forge.interfaces.model import Catalog, File, Interface, Source, TypeName, messages_of, nested_types
from forge.interfaces.resolve.resolution import nesting_problems

TARGETS = {
    "python": "forge.interfaces.python.target",
    "cpp": "forge.interfaces.cpp.target",
    "idl": "forge.interfaces.idl.target",
    "json": "forge.interfaces.hashing",
}
"""The module of each target. Those of other distributions are entry points of 'forge.interfaces.targets'.

A module defines `files(catalog) -> Iterator[File]`, with paths relative to a folder; or
`interface_files(catalog) -> Callable[[Interface], Iterator[File]]`, and `package_files(catalog)` if there are
files for the package as a whole. Then an interface is only rendered if its definition, or that of a nested
message, has changed.
"""

_NESTING = frozenset({"python", "cpp", "c"})
"""The targets whose files import or include the files of nested messages."""


@frozen
class Part:
    """The files of one interface, or of a whole package, in one language; rendered on demand.

    `digest` is a hash of their inputs, or None if the inputs are unknown.
    """

    language: str
    subject: str
    digest: str | None
    make: Callable[[], Iterable[File]]

    @property
    def key(self) -> str:
        return f"{self.language} {self.subject}"

    def files(self) -> Iterator[File]:
        """Yield the files, below a folder of the language's name."""
        for file in self.make():
            yield File(f"{self.language}/{file.path}", file.text)


def parts(catalog: Catalog, target: str, digests: Mapping[TypeName, str]) -> Iterator[Part]:
    """Yield the parts that a target generates for a catalog; `digests` are the known ones of its interfaces.

    Raises ForgeError if the target does not exist or cannot be loaded, or if messages are nested too deeply.
    """
    if target in _NESTING:
        raise_if_any(nesting_problems(catalog.known), InterfaceError)
    # Import targets by name, so that only the requested one is loaded.
    is_core = target in TARGETS
    module = import_module(TARGETS[target]) if is_core else find(PLUGINS, target, "target", ("files",))
    if module is None:
        names = sorted({*TARGETS, *OWN[PLUGINS], *entry_points(PLUGINS)})
        hint = " ".join(filter(None, (did_you_mean(target, names), f"available targets: {', '.join(names)}")))
        raise ForgeError(Problem(f"unknown target '{target}'", hint=hint))
    # The inputs of another distribution's target are unknown.
    is_own = is_core or target in OWN[PLUGINS]
    names_and_digests = (f"{name} {digests[name]}" for name in catalog.interfaces)
    catalog_digest = _digest(*names_and_digests) if digests and is_own else None
    interface_files = getattr(module, "interface_files", None)
    package_files = getattr(module, "package_files", lambda _: ()) if interface_files else module.files
    yield Part(target, catalog.package, catalog_digest, partial(package_files, catalog))
    if interface_files:
        files_of = interface_files(catalog)
        for name, interface in catalog.interfaces.items():
            yield Part(target, str(name), digests.get(name), partial(files_of, interface))


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


def _digest(*texts: str) -> str:
    return hashlib.sha256("\0".join(texts).encode("utf-8", "surrogatepass")).hexdigest()[:32]
