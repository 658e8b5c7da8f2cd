"""`forge.lock`: the packages of a ROS distribution that a workspace uses, pinned to commits."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from forge.base.env_vars import own_cache
from forge.base.errors import HostError, Location, Problem, WorkspaceError
from forge.base.files import read_file, replace_file
from forge.base.formats import read_toml
from forge.base.frozen import frozen
from forge.base.names import is_package_name, is_safe_name, is_safe_relative_path

LOCK_FILE = "forge.lock"
_FORMAT = 1
_COMMIT = re.compile(r"[0-9a-f]{40}(?:[0-9a-f]{24})?")
_MODULE_WORD = re.compile(r"[A-Za-z0-9][A-Za-z0-9.!+_:-]*")
_HEADER = (
    "# Written by 'forge fetch': commit it with the workspace, and let 'forge fetch --update' change it.\n"
)


@frozen
class LockedPackage:
    """A package with the commit that its tag names."""

    name: str
    version: str
    repository: str
    tag: str
    """The reference to fetch; for an imported branch, the commit."""
    commit: str
    path: str = ""
    """The folder of the package in the repository, '' for the root."""


@frozen
class Clone:
    """A repository that a package clones during its build, and the locked commit."""

    repository: str
    tag: str
    commit: str
    packages: tuple[str, ...]


@frozen
class Module:
    """A distribution of Python modules, and the hashes of its files, for this machine and others."""

    name: str
    version: str
    hashes: tuple[str, ...]
    ros: bool
    """Whether locked packages need it; other distributions are needed by the workspace's own packages."""


@frozen
class Lock:
    distribution: str
    snapshot: str
    """The digest of the index at the time when the lock was written."""
    middleware: str
    requested: tuple[str, ...]
    """The packages named on the command line, in addition to those that the workspace needs."""
    packages: tuple[LockedPackage, ...]
    clones: tuple[Clone, ...] = ()
    keys: tuple[str, ...] = ()
    """Keys of rosdep for system and Python dependencies of the packages."""
    pip: tuple[tuple[str, str], ...] = ()
    """The PyPI distributions of rosdep keys, by key."""
    python: tuple[str, ...] = ()
    """All requirements of Python modules, which `modules` fulfil."""
    modules: tuple[Module, ...] = ()


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
    hint = "restore it from version control, or remove it and run 'forge fetch'"
    try:
        fields = read_toml(content, path)
    except WorkspaceError as error:
        raise WorkspaceError(*(replace(each, hint=hint) for each in error.problems)) from None
    if (format_version := fields.get("format")) != _FORMAT:
        if isinstance(format_version, int) and format_version > _FORMAT:
            message = (
                f"the lock has format {format_version}, written by a newer forge; this one supports {_FORMAT}"
            )
            raise WorkspaceError(Problem(message, Location(path), "upgrade forge"))
        raise WorkspaceError(Problem("not a lock file of forge: 'format' is missing", Location(path), hint))
    try:
        lock = Lock(
            fields["distribution"],
            fields["snapshot"],
            fields["middleware"],
            tuple(fields["requested"]),
            tuple(LockedPackage(**each) for each in fields.get("package", ())),
            tuple(Clone(**{**each, "packages": tuple(each["packages"])}) for each in fields.get("clone", ())),
            tuple(fields["system"]),
            tuple(fields.get("pip", {}).items()),
            tuple(fields.get("python", ())),
            tuple(Module(**{**each, "hashes": tuple(each["hashes"])}) for each in fields.get("module", ())),
        )
        texts = [lock.distribution, lock.snapshot, lock.middleware, *lock.requested, *lock.keys]
        texts += (*lock.python, *(text for pair in lock.pip for text in pair))
        texts += (text for each in lock.packages for text in asdict(each).values())
        if not all(isinstance(text, str) for text in texts):
            raise TypeError("a value is not a string")
    except (AttributeError, KeyError, TypeError) as error:
        message = f"malformed lock: {error.args[0] if error.args else error}"
        raise WorkspaceError(Problem(message, Location(path), hint)) from None
    if fault := next(_faults(lock), None):
        raise WorkspaceError(Problem(f"malformed lock: {fault}", Location(path), hint))
    return lock


def _faults(lock: Lock) -> Iterator[str]:
    for commit in (*(each.commit for each in lock.packages), *(each.commit for each in lock.clones)):
        if not _COMMIT.fullmatch(commit):
            yield f"'{commit}' is not a commit"
    for module in lock.modules:
        # Lines of a requirements.txt, which also has options.
        words = (module.name, module.version, *module.hashes)
        if not all(isinstance(word, str) and _MODULE_WORD.fullmatch(word) for word in words):
            yield f"invalid version or hash of '{module.name}'"
    for each in lock.packages:
        # Both are names of folders in the cache.
        if not (is_package_name(each.name) and is_safe_name(each.version)):
            yield f"invalid name or version: '{each.name}', '{each.version}'"
        if each.path and not is_safe_relative_path(each.path):
            yield f"invalid path of '{each.name}': '{each.path}'"


def write_lock(root: Path, lock: Lock) -> bool:
    """Write the lock if it differs; return whether it was written."""
    text = lock_text(lock)
    path = root / LOCK_FILE
    if path.exists() and read_file(path) == text.encode():
        return False
    replace_file(path, text.encode())
    return True


def lock_text(lock: Lock) -> str:
    """Return the text of the file: one sorted line per fact, so that differences are easy to review."""
    head = {
        "format": _FORMAT,
        "distribution": lock.distribution,
        "snapshot": lock.snapshot,
        "middleware": lock.middleware,
        "requested": sorted(lock.requested),
    }
    packages = _tables("package", map(asdict, sorted(lock.packages, key=lambda each: each.name)))
    clones = _tables("clone", map(asdict, sorted(lock.clones, key=lambda each: each.repository)))
    python = f"python = [\n{_rows(lock.python)}]\n" if lock.python else ""
    pip = ["\n[pip]\n", *_lines(dict(sorted(lock.pip)))] if lock.pip else ()
    modules = _tables("module", map(asdict, sorted(lock.modules, key=lambda each: each.name)))
    system = f"system = [\n{_rows(lock.keys)}]\n"
    return "".join((_HEADER, *_lines(head), system, python, *pip, *packages, *clones, *modules))


def _rows(values: Iterable[str]) -> str:
    return "".join(f"  {json.dumps(value, ensure_ascii=False)},\n" for value in sorted(values))


def _tables(name: str, entries: Iterable[Mapping[str, object]]) -> Iterator[str]:
    for entry in entries:
        yield f"\n[[{name}]]\n"
        yield from _lines(entry)


def _lines(fields: Mapping[str, Any]) -> Iterator[str]:
    for key, value in fields.items():
        if key == "path" and not value:
            continue
        # Strings, numbers and booleans are the same in JSON and TOML.
        text = json.dumps(value, ensure_ascii=False)
        if key == "hashes":
            text = f"[\n{_rows(value)}]"
        yield f"{key} = {text}\n"
