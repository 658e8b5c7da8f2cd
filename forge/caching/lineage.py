"""What each package gives to others, in digests that are the same at every path.

A package gives its own tree and what its needs give; so a package that was built again and came out the
same leaves the keys of those above it as they were.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from forge.caching.trees import Unfit, survey

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from forge.caching.relocation import Places
    from forge.layout import Layout
    from forge.model import Record


class Lineage:
    """Digests of what packages give, found out when they are asked for: by then they do not change."""

    def __init__(
        self,
        needs: Mapping[str, frozenset[str]],
        records: Mapping[str, Record],
        layout: Layout,
        places: Places,
    ) -> None:
        """Remember the direct needs of each package, and where the records of installed ones are."""
        self._needs = needs
        self._records = records
        self._layout = layout
        self._places = places
        self._gives: dict[str, str] = {}
        self.looked: dict[str, str] = {}
        """The trees of installed packages of which no record had said what they come to."""

    def needs_of(self, name: str, below: Iterable[str]) -> tuple[tuple[str, str], ...]:
        """Return what each direct need of a package gives; `below` is all it needs, the lowest first."""
        for other in below:
            if other not in self._gives:
                said = (self._tree(other), *(self._gives[need] for need in sorted(self._needs[other])))
                self._gives[other] = hashlib.sha256("\0".join(said).encode()).hexdigest()
        return tuple((need, self._gives[need]) for need in sorted(self._needs[name]))

    def _tree(self, name: str) -> str:
        record = self._records[name]
        if not record.tree:
            self.looked[name] = record_tree = self._look(name, record)
            return record_tree
        return record.tree

    def _look(self, name: str, record: Record) -> str:
        try:
            return survey(name, self._layout, record, self._places).digest
        except (Unfit, OSError):
            return unfit(record)


def unfit(record: Record) -> str:
    """Return what stands for the tree of a package that cannot be kept: it is equal at one path alone."""
    return f"unfit {record.installed.digest}"
