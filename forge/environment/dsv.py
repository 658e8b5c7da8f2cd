"""The dsv format of colcon, ament and forge: changes of the environment. Callers read the files."""

from __future__ import annotations

import heapq
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import PurePosixPath
from posixpath import splitext

from forge.base.errors import Location, Problem, WorkspaceError, raise_if_any
from forge.base.frozen import frozen

Read = Callable[[str], str | None]
"""The text of a file below a package's prefix, or None if it does not exist."""

OPERATIONS = (
    *("prepend-non-duplicate", "prepend-non-duplicate-if-exists", "append-non-duplicate"),
    *("set", "set-if-unset"),
)

_VARIABLE = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


@frozen
class DsvChange:
    """A change of an environment variable; `operation` is a dsv operation."""

    operation: str
    variable: str
    value: str


@frozen
class Script:
    """A hook as a shell script, with variants of the same name for one or more shells."""

    paths: tuple[str, ...]
    """Relative to the package's prefix, or absolute."""

    def path(self, shell: str) -> str | None:
        """Return the file to source in `shell`: its own variant, else the one for sh, else None."""
        by_extension = {PurePosixPath(path).suffix: path for path in self.paths}
        return by_extension.get(f".{shell}", by_extension.get(".sh"))


Hook = DsvChange | Script


@frozen
class Edit:
    """A prepend, append, set or default; if `below`, the value is a path below the package's prefix."""

    operation: str
    variable: str
    value: str
    below: bool

    def at(self, prefix: str) -> str:
        if not self.below:
            return self.value
        return f"{prefix}/{self.value}" if self.value else prefix


@frozen
class PackageEdits:
    """A package of an install tree: `folder` is its prefix relative to the root, '' in a merged layout."""

    name: str
    folder: str
    edits: tuple[Edit | Script, ...]


def parse_dsv(text: str, path: str) -> tuple[tuple[DsvChange, ...], tuple[str, ...]]:
    """Return the changes and the sourced paths of a dsv file; raises WorkspaceError for unknown lines."""
    changes: list[DsvChange] = []
    sources: list[str] = []
    problems: list[Problem] = []
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.startswith("#"):
            continue
        operation, _, rest = line.partition(";")
        variable, has_value, values = rest.partition(";")
        parts = {part for part in rest.split("/") if part not in {"", "."}}
        if operation == "source" and parts and ".." not in parts and "\0" not in rest:
            sources.append(rest)
        elif "\0" not in line and operation in OPERATIONS and has_value and _VARIABLE.fullmatch(variable):
            all_values = [values] if operation in {"set", "set-if-unset"} else values.split(";")
            changes += (DsvChange(operation, variable, value) for value in all_values)
        else:
            hint = "the format is 'OPERATION;VARIABLE;VALUE' or 'source;PATH'"
            place = Location(path, number, source=line)
            problems.append(Problem("invalid environment hook", place, hint))
    raise_if_any(problems, WorkspaceError)
    return tuple(changes), tuple(sources)


def read_hooks(name: str, read: Read) -> tuple[Hook, ...]:
    """Return the hooks of package `name`, with those of nested files in place.

    Changes of a file precede the files it sources. Sourced files that differ only in their extension are one
    hook; a dsv variant, even an unlisted one, takes precedence. Raises WorkspaceError for unknown lines.
    """
    return tuple(_read_file(f"share/{name}/package.dsv", read, frozenset()))


def _read_file(path: str, read: Read, opened: frozenset[str]) -> Iterator[Hook]:
    text = read(path)
    if text is None or path in opened:  # recursive references are ignored
        return
    changes, sources = parse_dsv(text, path)
    yield from changes
    groups: dict[str, list[str]] = {}
    for source in sources:
        groups.setdefault(splitext(source)[0], []).append(source)
    for stem, paths in groups.items():
        if read(f"{stem}.dsv") is not None:
            yield from _read_file(f"{stem}.dsv", read, opened | {path})
        elif scripts := tuple(p for p in paths if not p.endswith(".dsv")):
            yield Script(scripts)


def resolve_hooks(hooks: Iterable[Hook], exists: Callable[[str], bool]) -> tuple[Edit | Script, ...]:
    """Resolve conditional hooks and paths; `exists` gets paths below the prefix, or absolute ones."""
    resolved: list[Edit | Script] = []
    for hook in hooks:
        if isinstance(hook, Script):
            resolved.append(hook)
        elif hook.operation in {"set", "set-if-unset"}:
            below = not hook.value or (not hook.value.startswith("/") and exists(hook.value))
            word = "set" if hook.operation == "set" else "default"
            resolved.append(Edit(word, hook.variable, hook.value, below))
        elif not hook.operation.endswith("-if-exists") or exists(hook.value):
            word = hook.operation.partition("-")[0]
            resolved.append(Edit(word, hook.variable, hook.value, not hook.value.startswith("/")))
    return tuple(resolved)


def apply(
    variables: Mapping[str, str], edits: Iterable[tuple[str, Edit]], *, first: bool = False
) -> dict[str, str]:
    """Return `variables` after the edits, each with the prefix of its package.

    Existing entries keep their position, as when sourcing a workspace. With `first`, prepending moves them to
    the front and removes empty entries, as when sourcing a single package.
    """
    result = dict(variables)
    lists: dict[str, _Entries] = {}
    for prefix, edit in edits:
        value = edit.at(prefix)
        entries = lists.get(edit.variable)
        if edit.operation == "set" or (
            edit.operation == "default"
            and not (result.get(edit.variable) if entries is None else entries.text())
        ):
            lists.pop(edit.variable, None)
            result[edit.variable] = value
        elif edit.operation != "default":
            if entries is None:
                entries = lists[edit.variable] = _Entries(result.get(edit.variable, ""), first=first)
            entries.add(value, last=edit.operation == "append")
    result.update((variable, entries.text()) for variable, entries in lists.items())
    return result


class _Entries:
    """The entries of a variable being edited; dicts keep the order and detect duplicates."""

    def __init__(self, text: str, *, first: bool) -> None:
        self.original = text.split(":") if text else []
        self.held = frozenset(self.original)
        self.first = first
        self.front: dict[str, None] = {}  # the last one added comes first
        self.back: dict[str, None] = {}

    def add(self, value: str, *, last: bool) -> None:
        """Add a value at the front or the end; an existing one moves only with `first`."""
        is_present = value in self.front or value in self.back or value in self.held
        if last:
            if not is_present:
                self.back[value] = None
        elif not is_present or self.first:
            self.front.pop(value, None)
            self.back.pop(value, None)
            self.front[value] = None

    def text(self) -> str:
        unmoved: Iterable[str] = self.original
        if self.first and self.front:
            unmoved = (entry for entry in self.original if entry and entry not in self.front)
        return ":".join([*reversed(self.front), *unmoved, *self.back])


def order(needs: Mapping[str, frozenset[str]]) -> tuple[str, ...]:
    """Return the packages of a prefix in the order in which they are sourced.

    As in colcon: the alphabetically smallest package whose dependencies are sourced comes next. Unknown names
    are ignored; in a cycle the smallest remaining name comes next.
    """
    waiting = {name: {need for need in needs[name] if need in needs and need != name} for name in needs}
    users: dict[str, list[str]] = {name: [] for name in needs}
    for name, open_needs in waiting.items():
        for need in open_needs:
            users[need].append(name)
    ready = sorted(name for name, open_needs in waiting.items() if not open_needs)
    ordered: dict[str, None] = {}
    while len(ordered) < len(needs):
        name = heapq.heappop(ready) if ready else min(name for name in needs if name not in ordered)
        if name in ordered:
            continue
        ordered[name] = None
        for user in users[name]:
            waiting[user].discard(name)
            if not waiting[user]:
                heapq.heappush(ready, user)
    return tuple(ordered)
