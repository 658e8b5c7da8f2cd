"""Generate the files of catalogs for each target, and write the changed ones; remove obsolete ones.

The ledger of an output folder contains the files that earlier runs generated, their times, and hashes of
their inputs. A file that has changed since is generated again; without a ledger, all are.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import field
from functools import cache, partial
from graphlib import TopologicalSorter
from importlib import import_module
from pathlib import Path

from forge import __version__
from forge.base.errors import (
    ForgeError,
    HostError,
    InterfaceError,
    Location,
    Problem,
    raise_if_any,
    reason_of,
)
from forge.base.extensions import FORMATS, OWN, SERIALIZERS, entry_points, find
from forge.base.extensions import TARGETS as PLUGINS
from forge.base.files import replace_file, write_if_changed
from forge.base.frozen import frozen
from forge.base.layout import PACKAGE, templates_folder
from forge.base.names import did_you_mean
from forge.interfaces.model import Catalog, File, Interface, Source, TypeName, messages_of, nested_types
from forge.interfaces.resolve.resolution import nesting_problems

TARGETS = {
    "python": "forge.interfaces.python.target",
    "cpp": "forge.interfaces.cpp.target",
    "idl": "forge.interfaces.idl",
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
        """Yield the files, in a folder named after the language."""
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
    catalog_digest = _digest_of_texts(*names_and_digests) if digests and is_own else None
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
        digests[name] = _digest_of_texts(generator, str(described), text, *below)
    return digests


def _digest_of_texts(*texts: str) -> str:
    return hashlib.sha256("\0".join(texts).encode("utf-8", "surrogatepass")).hexdigest()[:32]


STATE_FOLDER = ".forge"
"""The folder with the ledgers, inside the output folder."""

_VERSION = 5
_RACY_NANOSECONDS = 20_000_000
"""A file may be written twice in this time without a change of its times."""


@frozen
class PartState:
    """The digest of the inputs of a part, and the mode of each file, with size and times unless it is new."""

    digest: str | None
    files: Mapping[str, tuple[int, ...]]


@frozen
class OutputState:
    """The state of a package in an output folder: its files by part, and types of other packages it needs."""

    parts: Mapping[str, PartState] = field(default_factory=dict)
    needs: tuple[TypeName, ...] = ()
    folders: Mapping[str, Path] = field(default_factory=dict)
    """The folders with the definitions of needed packages."""

    @property
    def files(self) -> Iterator[str]:
        for part in self.parts.values():
            yield from part.files

    def up_to_date(self, part: Part, out: Path) -> PartState | None:
        """Return the state of a part if its digest matches and all its files exist unchanged, else None."""
        state = self.parts.get(part.key)
        if state is None or part.digest is None or state.digest != part.digest:
            return None
        try:
            unchanged = all(_stat(f"{out}/{path}") == stat for path, stat in state.files.items())
        except OSError:
            return None
        return state if unchanged else None


def _stat(path: str) -> tuple[int, ...]:
    status = os.lstat(path)
    return status.st_mode, status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino


def ledger_of(package: str, out: Path) -> Path:
    return out / STATE_FOLDER / f"{package}.json"


def read_states(out: Path) -> dict[str, OutputState]:
    """Return the state of each package generated into a folder; unreadable ledgers are ignored."""
    return {path.stem: _read(path) for path in sorted((out / STATE_FOLDER).glob("*.json"))}


@cache
def generator_digest() -> str:
    """Return a hash of the generator: the version, and size and time of each module and template."""
    digest = hashlib.sha256(__version__.encode())
    plugins = (module.split(".") for group in (FORMATS, SERIALIZERS) for module in OWN[group].values())
    folders = (PACKAGE.joinpath(*parts[1:-1]) for parts in plugins)
    for root in (Path(__file__).parent, templates_folder(), *folders):
        for folder, below, names in os.walk(root):
            below.sort()
            for name in sorted(names):
                if not name.endswith(".pyc"):
                    status = os.stat(f"{folder}/{name}")  # noqa: PTH116
                    path = os.path.relpath(f"{folder}/{name}", root)
                    digest.update(f"{path} {(status.st_size, status.st_mtime_ns)}".encode())
    return digest.hexdigest()[:32]


def _read(path: Path) -> OutputState:
    try:
        state = json.loads(path.read_text(encoding="utf-8"))
        if state["version"] != _VERSION:
            return OutputState()
        return OutputState(
            {
                key: PartState(digest, {name: tuple(map(int, stat)) for name, stat in files.items()})
                for key, (digest, files) in state["parts"].items()
            },
            tuple(TypeName(*name.split("/")) for name in state["needs"]),
            {name: Path(folder) for name, folder in state["folders"].items()},
        )
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return OutputState()


@frozen
class Written:
    """The result of a run: the new or changed files, the total number, and the content of the ledger."""

    changed: tuple[Path, ...]
    total: int
    ledger: bytes = b""


def write(
    parts: Iterable[Part],
    out: Path,
    package: str,
    state: OutputState | None = None,
    states: Mapping[str, OutputState] | None = None,
) -> Written:
    """Write the parts of a package below `out`; parts that are up to date are skipped.

    `state` contains the needed types to store, `states` the ledgers, if they were read already. Files of an
    earlier run of the same package are removed, unless this run or another package generates them, or this
    run does not include their language. Raises HostError if the folder is not writable.
    """
    states = dict(read_states(out) if states is None else states)
    before = states.pop(package, OutputState())
    ledger = ledger_of(package, out)
    changed: list[Path] = []
    written: dict[str, PartState] = {}
    try:
        for part in parts:
            current = before.up_to_date(part, out)
            if current is None:
                # Until this run ends, the ledger would not list all files.
                ledger.unlink(missing_ok=True)
                files: dict[str, tuple[int, ...]] = {}
                for file in part.files():
                    path = out / file.path
                    old = before.parts.get(part.key, _UNKNOWN).files.get(file.path)
                    if write_if_changed(path, file.text, mode=old[0] & 0o777 if old else None):
                        changed.append(path)
                    files[file.path] = _stat(str(path))
                current = PartState(part.digest, files)
            written[part.key] = current
        languages = {key.partition(" ")[0] for key in written}
        total = sum(len(each.files) for each in written.values())
        others = {k: each for k, each in before.parts.items() if k.partition(" ")[0] not in languages}
        new = OutputState(written | others, *((state.needs, state.folders) if state else ()))
        current_files = {*new.files, *(path for each in states.values() for path in each.files)}
        obsolete = set(before.files) - current_files
        if obsolete:
            ledger.unlink(missing_ok=True)
        for name in obsolete:
            (out / name).unlink(missing_ok=True)
        for folder in sorted({f"{Path(name).parent}" for name in obsolete}, reverse=True):
            with contextlib.suppress(OSError):  # the folder contains other files
                os.removedirs(out / folder)
        content = _text_of(new).encode()
        if not (ledger.is_file() and ledger.read_bytes() == content):
            replace_file(ledger, content)
    except OSError as error:
        raise unwritable(error, out) from error
    return Written(tuple(changed), total, content)


_UNKNOWN = PartState(None, {})


def _text_of(state: OutputState) -> str:
    """Return the text of a ledger. The stats of files that were just written are left out."""
    stable = time.time_ns() - _RACY_NANOSECONDS
    parts = {
        key: [
            part.digest,
            {
                path: stat if max(stat[2:4], default=0) < stable else stat[:1]
                for path, stat in part.files.items()
            },
        ]
        for key, part in sorted(state.parts.items())
    }
    content = {
        "version": _VERSION,
        "needs": sorted(map(str, state.needs)),
        "folders": {name: str(folder) for name, folder in sorted(state.folders.items())},
        "parts": parts,
    }
    return json.dumps(content) + "\n"


def unwritable(error: OSError, out: Path) -> HostError:
    return HostError(Problem(f"cannot write: {reason_of(error)}", Location(error.filename or out)))


def write_depfile(path: Path, target: Path, sources: Iterable[Path]) -> None:
    """Write a make depfile with the inputs of `target`.

    Raises HostError for a path that make cannot represent.
    """
    inputs = tuple(sources)
    invalid = [each for each in (target, *inputs) if any(sign in str(each) for sign in "\n\r\0;")]
    if invalid:
        hint = "rename the folder: paths must not contain ';' or line breaks"
        raise HostError(Problem(f"make cannot handle the path {str(invalid[0])!r}", hint=hint))
    escapes = str.maketrans({"$": "$$", "#": "\\#", " ": "\\ "})
    rule, *names = (str(each).translate(escapes) for each in (target, *inputs))
    listed = " \\\n  ".join(names)
    write_if_changed(path, f"{rule}: {listed}\n" if names else f"{rule}:\n")
