"""`forge.lock`: which packages of a ROS distribution a workspace is built on, to the commit."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path

from forge.base.env_vars import own_cache
from forge.base.errors import HostError, Location, Problem, WorkspaceError
from forge.base.files import read_file, replace_file
from forge.base.formats import read_toml
from forge.base.frozen import frozen
from forge.base.names import is_package_name, is_safe_name

LOCK_FILE = "forge.lock"
_FORMAT = 1
_COMMIT = re.compile(r"[0-9a-f]{40}(?:[0-9a-f]{24})?")
_HEADER = (
    "# Written by 'forge fetch': commit it with the workspace, and let 'forge fetch --update' change it.\n"
)


@frozen
class LockedPackage:
    """A package with the commit that its tag names; the root of that tree is the package."""

    name: str
    version: str
    repository: str
    tag: str
    commit: str


@frozen
class Clone:
    """A repository that a package clones while it is built, and the commit that it gets."""

    repository: str
    tag: str
    commit: str
    packages: tuple[str, ...]


@frozen
class Lock:
    distribution: str
    snapshot: str
    """The digest of the index at the time when the lock was made."""
    middleware: str
    requested: tuple[str, ...]
    """The packages named on the command line, besides what the workspace needs."""
    packages: tuple[LockedPackage, ...]
    clones: tuple[Clone, ...] = ()
    keys: tuple[str, ...] = ()
    """Names of rosdep of what the packages need from the system or from Python."""


def cache_folder(variables: Mapping[str, str]) -> Path:
    """Return the folder for indexes, sources and underlays; raises HostError if others can write to it."""
    own = own_cache(variables)
    if own is None:
        hint = "set HOME or XDG_CACHE_HOME to a folder that only you can write to"
        raise HostError(Problem("there is no private cache folder for the sources of ROS", hint=hint))
    return own / "ros"


def read_lock(root: Path) -> Lock | None:
    """Return the lock of a workspace, None if it has none; raises WorkspaceError if it is malformed."""
    path = root / LOCK_FILE
    try:
        content = read_file(path)
    except FileNotFoundError:
        return None
    fields = read_toml(content, path)
    hint = "restore it from version control, or remove it and run 'forge fetch'"
    if (written := fields.get("format")) != _FORMAT:
        if isinstance(written, int) and written > _FORMAT:
            message = f"the lock has format {written}, written by a newer forge; this one knows {_FORMAT}"
            raise WorkspaceError(Problem(message, Location(path), "upgrade forge"))
        raise WorkspaceError(Problem("this is no lock of forge: 'format' is missing", Location(path), hint))
    try:
        lock = Lock(
            fields["distribution"],
            fields["snapshot"],
            fields["middleware"],
            tuple(fields["requested"]),
            tuple(LockedPackage(**each) for each in fields.get("package", ())),
            tuple(Clone(**{**each, "packages": tuple(each["packages"])}) for each in fields.get("clone", ())),
            tuple(fields["system"]),
        )
        texts = [lock.distribution, lock.snapshot, lock.middleware, *lock.requested, *lock.keys]
        texts += (text for each in lock.packages for text in asdict(each).values())
        if not all(isinstance(text, str) for text in texts):
            raise TypeError("a value is not a string")
    except (KeyError, TypeError) as error:
        message = f"malformed lock: {error.args[0] if error.args else error}"
        raise WorkspaceError(Problem(message, Location(path), hint)) from None
    for commit in (*(each.commit for each in lock.packages), *(each.commit for each in lock.clones)):
        if not _COMMIT.fullmatch(commit):
            message = f"malformed lock: '{commit}' is no commit"
            raise WorkspaceError(Problem(message, Location(path), hint))
    for each in lock.packages:
        # Both are names of folders in the cache.
        if not (is_package_name(each.name) and is_safe_name(each.version)):
            message = f"malformed lock: invalid name or version: '{each.name}', '{each.version}'"
            raise WorkspaceError(Problem(message, Location(path), hint))
    return lock


def write_lock(root: Path, lock: Lock) -> bool:
    """Write the lock if it differs; tell whether it did."""
    text = lock_text(lock)
    path = root / LOCK_FILE
    if path.exists() and read_file(path) == text.encode():
        return False
    replace_file(path, text.encode())
    return True


def lock_text(lock: Lock) -> str:
    """Return the file: one line for each fact, sorted, so that a difference is easy to review."""
    head = {
        "format": _FORMAT,
        "distribution": lock.distribution,
        "snapshot": lock.snapshot,
        "middleware": lock.middleware,
        "requested": sorted(lock.requested),
    }
    system = "".join(f"  {_quoted(key)},\n" for key in sorted(lock.keys))
    packages = _tables("package", map(asdict, sorted(lock.packages, key=lambda each: each.name)))
    clones = _tables("clone", map(asdict, sorted(lock.clones, key=lambda each: each.repository)))
    return "".join((_HEADER, *_lines(head), f"system = [\n{system}]\n", *packages, *clones))


def _tables(name: str, entries: Iterable[Mapping[str, object]]) -> Iterator[str]:
    for entry in entries:
        yield f"\n[[{name}]]\n"
        yield from _lines(entry)


def _lines(fields: Mapping[str, object]) -> Iterator[str]:
    for key, value in fields.items():
        text = ", ".join(map(_quoted, value)) if isinstance(value, list | tuple) else None
        yield (
            f"{key} = {value}\n"
            if isinstance(value, int)
            else (f"{key} = {_quoted(str(value))}\n" if text is None else f"{key} = [{text}]\n")
        )


def _quoted(text: str) -> str:
    """Return a basic string of TOML, which JSON's strings are."""
    return json.dumps(text, ensure_ascii=False)
