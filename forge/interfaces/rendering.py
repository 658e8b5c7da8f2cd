"""Generate the files of a catalog for each target."""

from __future__ import annotations

from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING

from forge.base.errors import InterfaceError, raise_if_any
from forge.base.extensions import OWN
from forge.base.extensions import TARGETS as PLUGINS
from forge.base.frozen import frozen
from forge.interfaces.fingerprints import fingerprint_of_all
from forge.interfaces.model import File
from forge.interfaces.resolve.resolution import nesting_problems
from forge.interfaces.targets import find_target

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from forge.interfaces.model import Catalog, TypeName

TARGETS = {
    "python": "forge.interfaces.python.target",
    "cpp": "forge.interfaces.cpp.target",
    "idl": "forge.interfaces.idl.target",
    "json": "forge.interfaces.type_description",
}
"""The module of each target; it defines `files(catalog) -> Iterator[File]`, with paths relative to a folder.

If it also defines `package_files(catalog)` and
`interface_files(catalog) -> Callable[[Interface], Iterator[File]]`, an interface is only rendered if its
definition, or that of a nested message, has changed.
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
        """Return a key of this part that is unique in a run."""
        return f"{self.language} {self.subject}"

    def files(self) -> Iterator[File]:
        """Yield the files, below a folder of the language's name."""
        for file in self.make():
            yield File(f"{self.language}/{file.path}", file.text)


def render(catalog: Catalog, target: str) -> tuple[File, ...]:
    """Return all files of a target, below a folder of its name: 'python/std_msgs/msg/_string.py'.

    Other distributions can provide further targets (forge.interfaces.targets).
    Raises ForgeError if the target does not exist or cannot be loaded.
    """
    return tuple(file for part in parts(catalog, target, {}) for file in part.files())


def parts(catalog: Catalog, target: str, digests: Mapping[TypeName, str]) -> Iterator[Part]:
    """Yield the parts that a target generates for a catalog; `digests` are the known ones of its interfaces.

    Raises ForgeError as `render` does, or if messages are nested too deeply.
    """
    if target in _NESTING:
        raise_if_any(nesting_problems(catalog.known), InterfaceError)
    # Import targets by name, so that only the requested one is loaded.
    module = import_module(TARGETS[target]) if target in TARGETS else find_target(target, TARGETS)
    # The inputs of another distribution's target are unknown.
    is_own = target in TARGETS or target in OWN[PLUGINS]
    catalog_digest = fingerprint_of_all(catalog, digests) if digests and is_own else None
    package_files = getattr(module, "package_files", None)
    interface_files = getattr(module, "interface_files", None)
    yield Part(target, catalog.package, catalog_digest, partial(package_files or module.files, catalog))
    if package_files and interface_files:
        files_of = interface_files(catalog)
        for name, interface in catalog.interfaces.items():
            yield Part(target, str(name), digests.get(name), partial(files_of, interface))
