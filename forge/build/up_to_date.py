"""Decide whether a package is up to date, and why not; pure.

A package is up to date if its installed files are intact and none of its inputs changed: its sources, its
options, the tools, the environment, forge itself, the files outside the workspace that its build read, and
the installed files of its dependencies. If a dependency is rebuilt and installs identical files, its
dependents remain up to date.
"""

from __future__ import annotations

import enum
import hashlib
from typing import TYPE_CHECKING

from forge.base.extensions import OPTIONS, own_plugin
from forge.base.frozen import Pairs, frozen

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from forge.build.model import BuildInputs, BuildRecord, Snapshot

UNKNOWN = "unknown"
"""The digest of a package without a record, for example one built by another tool."""


class DependencyHashes:
    """The hash of each package for its dependents; owned by the build loop.

    It covers the installed files of the package and the hashes of its dependencies. While a package is being
    built, its hash and those of its dependents are pending.
    """

    def __init__(self, needs: Mapping[str, frozenset[str]], installed: Mapping[str, str]) -> None:
        """Start with the digests of the installed files; nothing is pending."""
        self._needs = needs
        self._installed = dict(installed)
        self._pending: set[str] = set()
        self._hashes: dict[str, str] = {}

    def expect(self, name: str) -> None:
        """Mark the package as pending: it will or may be built in this run."""
        self._pending.add(name)
        self._hashes.pop(name, None)

    def finish(self, name: str, installed: str | None = None) -> None:
        """Mark the package as finished, with the digest of its files if they changed."""
        self._pending.discard(name)
        if installed is not None:
            self._installed[name] = installed

    def needs_of(self, name: str, below: Iterable[str]) -> Pairs | None:
        """Return the hashes of the direct dependencies of `name`, or None while one is pending.

        `below` are all its transitive dependencies in topological order.
        """
        for other in below:
            if self._hashes.get(other) is None and other not in self._pending:
                parts = [self._hashes.get(need) for need in sorted(self._needs[other])]
                if None not in parts:
                    text = "\0".join((self._installed.get(other, UNKNOWN), *filter(None, parts)))
                    self._hashes[other] = hashlib.blake2b(text.encode(), digest_size=16).hexdigest()
        hashes = [(need, self._hashes.get(need)) for need in sorted(self._needs[name])]
        return None if any(hash_ is None for _, hash_ in hashes) else tuple((n, h or "") for n, h in hashes)


UNKNOWN_SOURCES = "its sources changed"
UNKNOWN_INSTALLED = "an installed file was changed or removed"
UNKNOWN_EXTERNAL = "a file outside of the package that its last build read has changed"
"""The reasons if the changed files are unknown."""


class InputKind(enum.Enum):
    """The kind of a changed input."""

    OWN = "own"
    """The package itself, its dependencies or its results: changes within the workspace."""
    FORGE = "forge"
    TOOL = "tool"
    VARIABLE = "variable"
    OPTION = "option"
    OUTSIDE = "outside"
    """A file outside the workspace."""
    OTHER = "other"
    """Other shared inputs: folders, interpreter, underlays."""


@frozen
class InputChange:
    """The most significant change of a package's inputs: a sentence, and the names of all of its kind.

    `added` are the names that are new since the last build.
    """

    kind: InputKind
    text: str
    names: tuple[str, ...] = ()
    added: frozenset[str] = frozenset()


def reason_to_build(
    name: str, now: BuildInputs, record: BuildRecord | None, snapshot: Snapshot
) -> InputChange | None:
    if record is None:
        return InputChange(InputKind.OWN, "not built yet")
    if not record.complete:
        return InputChange(InputKind.OWN, "the last build did not finish successfully")
    # Check the folders first: otherwise, files in the previous ones would seem to be removed.
    for option, old, new in zip(COMMON_OPTIONS, record.inputs.options, now.options, strict=False):
        if old != new:
            # The paths of folders differ between packages, their name does not.
            return InputChange(InputKind.OTHER, f"the {option} changed from '{old}' to '{new}'", (option,))
    if name not in snapshot.present or snapshot.installed[name].digest != record.installed.digest:
        return InputChange(InputKind.OWN, snapshot.installed_changes.get(name, UNKNOWN_INSTALLED))
    if name in snapshot.changed_externals:
        return snapshot.changed_externals[name]
    if record.saved:
        return InputChange(InputKind.OWN, f"'{record.saved[0]}' was modified during the last build")
    return changed_input(now, record.inputs, snapshot.source_changes.get(name, UNKNOWN_SOURCES))


def changed_input(
    now: BuildInputs, then: BuildInputs, source_changes: str = UNKNOWN_SOURCES
) -> InputChange | None:
    """Return the most significant difference between current and recorded inputs, or None."""
    if now.forge != then.forge:
        naming = own_plugin(OPTIONS, "changes")
        text = naming.forge_change(now.forge, then.forge) if naming else "forge itself changed"
        return InputChange(InputKind.FORGE, text)
    change = _changed_pairs(InputKind.TOOL, now.tools, then.tools)
    if change := change or _changed_pairs(InputKind.VARIABLE, now.environment, then.environment):
        return change
    if now.options != then.options:
        naming = own_plugin(OPTIONS, "changes")
        unknown = InputChange(InputKind.OPTION, "the options changed")
        return naming.changed_options(now.options, then.options) if naming else unknown
    text = None
    if now.sources != then.sources:
        text = source_changes
    elif need := _differences(now.needs, then.needs):
        before, after = (need[0] in dict(inputs.needs) for inputs in (then, now))
        verb = "changed" if before and after else "was added" if after else "is no longer used"
        text = f"the dependency '{need[0]}' {verb}"
    elif now.underlays != then.underlays:
        return InputChange(InputKind.OTHER, "packages were added to or removed from an underlay")
    return InputChange(InputKind.OWN, text) if text else None


def _differences(now: Pairs, then: Pairs) -> tuple[str, ...]:
    before, after = dict(then), dict(now)
    return tuple(name for name in sorted(before | after) if before.get(name) != after.get(name))


def _changed_pairs(kind: InputKind, now: Pairs, then: Pairs) -> InputChange | None:
    names = _differences(now, then)
    if not names:
        return None
    text = f"the {'tool' if kind is InputKind.TOOL else 'environment variable'} '{names[0]}' changed"
    return InputChange(kind, text, names, frozenset(names) - dict(then).keys())


COMMON_OPTIONS = (
    *("install layout", "source folder", "build folder", "install folder"),
    *("Python interpreter", "folder of Python modules"),
)
"""The meaning of the first recorded options of every package; the others change only with the layout."""

ROSDISTRO = "--rosdistro="
TARGET, UMASK = "--cmake-target=", "umask="
FAST_ROSIDL = "fast rosidl"

MANIFEST, BUILD_TYPE = "the evaluated package.xml", "the build type "
RECIPE = "the recipe "
