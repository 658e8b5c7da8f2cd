"""Path-independent keys of packages for the cache keys of their dependents.

The key covers a package's own tree and the keys of its dependencies. If a rebuilt package has an identical
tree, the keys of its dependents do not change.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from forge.cache.trees import Uncacheable, scan_tree

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from forge.base.layout import Layout
    from forge.build.model import BuildRecord
    from forge.cache.relocation import Relocator


class DependencyKeys:
    """The keys of packages, computed on demand after a package is installed."""

    def __init__(
        self,
        needs: Mapping[str, frozenset[str]],
        records: Mapping[str, BuildRecord],
        layout: Layout,
        relocator: Relocator,
    ) -> None:
        """Store the direct dependencies of each package and the records of installed packages."""
        self._needs = needs
        self._records = records
        self._layout = layout
        self._relocator = relocator
        self._keys: dict[str, str] = {}
        self.computed_trees: dict[str, str] = {}
        """Tree digests computed for packages whose records had none."""

    def needs_of(self, name: str, below: Iterable[str]) -> tuple[tuple[str, str], ...]:
        """Return the keys of direct dependencies; `below` are the transitive ones in topological order."""
        for other in below:
            if other not in self._keys:
                tree = self._records[other].tree or self._compute_tree(other)
                parts = (tree, *(self._keys[need] for need in sorted(self._needs[other])))
                self._keys[other] = hashlib.sha256("\0".join(parts).encode()).hexdigest()
        return tuple((need, self._keys[need]) for need in sorted(self._needs[name]))

    def _compute_tree(self, name: str) -> str:
        record = self._records[name]
        try:
            tree = scan_tree(name, self._layout, record, self._relocator).digest
        except (Uncacheable, OSError):
            tree = uncacheable_tree(record)
        self.computed_trees[name] = tree
        return tree


def uncacheable_tree(record: BuildRecord) -> str:
    """Return a substitute tree digest for a package that cannot be cached; it is valid at one path only."""
    return f"unfit {record.installed.digest}"
