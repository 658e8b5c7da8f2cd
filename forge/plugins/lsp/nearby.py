"""The part of a workspace that decides on the types of one file: large workspaces need no more time."""

from __future__ import annotations

from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING

from forge.base.names import nearest
from forge.interfaces.model import Message
from forge.interfaces.read.parsing import Parsed
from forge.interfaces.resolve.resolution import MAX_EXPLAINED

if TYPE_CHECKING:
    from collections.abc import Iterable

    from forge.interfaces.model import TypeName
    from forge.interfaces.read.occurrences import Reading
    from forge.plugins.lsp.index import Index


class NearbyTypes:
    """The types that a file refers to, and those that contain it; all others are as good as empty.

    Only a message that contains the file's own can be part of a cycle with it.
    """

    def __init__(self, index: Index, reading: Reading) -> None:
        """Find the messages that contain the one of the file, directly or indirectly."""
        self._index = index
        self._reading = reading
        self._containers = {reading.name}
        waiting = [reading.name]
        while waiting:
            users = filter(None, (index.reading(user) for user, _ in index.uses(waiting.pop())))
            found = {user.name for user in users} - self._containers
            self._containers |= found
            waiting += found

    def find(self, name: TypeName) -> Parsed | None:
        """Return an interface; the contents of a message that cannot lead to a cycle are left out."""
        parsed = self._index.find(name)
        if parsed is None or name in self._containers or not isinstance(parsed.interface, Message):
            return parsed
        return Parsed(parsed.source, Message(name))

    def names(self) -> Iterable[TypeName]:
        """Return the names that are similar to an unknown one in the file: of its package, or in another."""
        return self._names

    @cached_property
    def _names(self) -> tuple[TypeName, ...]:
        missing = (
            each.type
            for each in self._reading.occurrences
            if each.type and self._index.find_or_none(each.type) is None
        )
        unknown = set(islice(missing, MAX_EXPLAINED))
        known = list(self._index.names())
        packages = {name.package for name in known}
        wanted = {name.package for name in unknown}
        near = wanted | {nearest(package, packages) for package in wanted}
        stems = {name.name for name in unknown}
        return tuple(name for name in known if name.package in near or name.name in stems)

    def distribution_hint(self, name: TypeName) -> str | None:
        """Return which ROS distributions have an interface that this one lacks, or None."""
        return self._index.distribution_hint(name)

    def declares(self, package: str) -> bool:
        """Tell whether the manifest of the file's package declares a package."""
        manifest = self._index.manifest_of(self._reading.source.path)
        return manifest is not None and package in manifest.dependencies
