"""All definitions and manifests of a workspace, with unsaved buffers in place of files.

Each file is read once, and again only when it changes. Definitions of underlays and of embedded packages are
read on demand.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from forge.base.errors import ForgeError, InterfaceError
from forge.base.files import names_in, text_or_nothing
from forge.base.names import snake_case
from forge.interfaces.model import Message, Source, TypeName
from forge.interfaces.read.parsing import ENDINGS, Parsed
from forge.interfaces.read.sources import Library, definition_files
from forge.plugins.lsp.manifests import MANIFEST, ManifestReading, read_manifest
from forge.plugins.lsp.occurrences import Occurrence, Reading, read_leniently
from forge.workspace.load import find_packages
from forge.workspace.selection import SearchPaths

_SUFFIXES = frozenset(f".{ending}" for ending in ENDINGS)


class Index:
    """The files below `root` once `scan` was called.

    `library` contains the definitions of all other packages.
    """

    def __init__(self, root: Path, library: Library, variables: Mapping[str, str]) -> None:
        self.root = root
        self.library = library
        self._variables = variables
        self._buffers: dict[Path, str] = {}
        self.readings: dict[Path, Reading] = {}
        self.manifests: dict[Path, ManifestReading] = {}
        self._by_name: dict[TypeName, Path] = {}
        self._outputs: dict[tuple[str, str, str], dict[Path, TypeName]] = {}
        """The definitions by package, kind and name of the generated files."""
        self.assigned: set[Path] = set()
        """The manifests whose build type is overridden, by colcon.pkg for example."""
        self._uses: dict[TypeName, dict[Path, list[Occurrence]]] = {}
        self._elsewhere: tuple[TypeName, ...] | None = None
        self._stamps: dict[Path, int | None] = {}
        """The last modification time of each file that was read, and of its folder."""

    def scan(self) -> None:
        try:
            packages = find_packages(self.root, SearchPaths(), self._variables).packages
        except ForgeError:
            packages = {}  # an invalid forge.toml: files are read as they are opened
        for package in packages.values():
            folder = self.root / package.path
            self.refresh(folder / MANIFEST)
            reading = self.manifests.get(folder / MANIFEST)
            if reading and reading.manifest and reading.manifest.build_type != package.build_type:
                self.assigned.add(reading.path)
            for relative, base in definition_files(folder).items():
                if base:
                    self.refresh(base / relative)

    def open(self, path: Path, text: str) -> None:
        """Use the text of a buffer in place of the file."""
        self._buffers[path] = text
        self._put(path, text)

    def close(self, path: Path) -> None:
        self._buffers.pop(path, None)
        self.refresh(path)

    def refresh(self, path: Path) -> None:
        """Read a changed, created or removed file again."""
        if path in self._buffers or not is_known(path):
            return
        self._stamps[path] = _changed(path)
        self._stamps.setdefault(path.parent, _changed(path.parent))
        try:
            self._put(path, path.read_text(encoding="utf-8", errors="replace"))
        except OSError:
            self._put(path, None)

    def refresh_changed(self) -> None:
        """Read all files again that were changed, created or removed in the meantime."""
        for path, stamp in tuple(self._stamps.items()):
            new_stamp = _changed(path)
            if new_stamp == stamp:
                continue
            self._stamps[path] = new_stamp
            if is_known(path):
                self.refresh(path)
            elif new_stamp is not None:
                for each in (path / name for name in names_in(path)):
                    if each not in self._stamps:
                        self.refresh(each)

    def text(self, path: Path) -> str:
        """Return the text of a file, empty if it cannot be read."""
        reading = self.readings.get(path) or self.manifests.get(path)
        match reading:
            case Reading():
                return reading.source.text
            case ManifestReading():
                return reading.text
        return text_or_nothing(path)

    def manifest_of(self, path: Path) -> ManifestReading | None:
        """Return the manifest of the package that contains a file."""
        for folder in path.parents:
            if folder / MANIFEST in self.manifests:
                return self.manifests[folder / MANIFEST]
        return None

    def uses(self, name: TypeName) -> Iterator[tuple[Path, Occurrence]]:
        """Yield the references to a message in definitions of the workspace."""
        # Many paths are slow to compare.
        for path, occurrences in sorted(self._uses.get(name, {}).items(), key=lambda use: str(use[0])):
            yield from ((path, each) for each in occurrences)

    def same_outputs(self, name: TypeName) -> Mapping[Path, TypeName]:
        """Return the definitions of the workspace whose generated files conflict with those of a type."""
        return self._outputs.get(_output(name), {})

    def find(self, name: TypeName) -> Parsed | None:
        """Return an interface without its invalid parts, or None."""
        path = self._by_name.get(name)
        if path is None:
            return self.library.find(name)
        reading = self.readings[path]
        return Parsed(reading.source, reading.interface or Message(name))

    def find_or_none(self, name: TypeName) -> Parsed | None:
        """Return an interface, None if it does not exist or its file in another workspace is invalid."""
        try:
            return self.find(name)
        except InterfaceError:
            return None

    def names(self) -> Iterator[TypeName]:
        """Yield the names of all interfaces, those of the workspace first."""
        yield from self._by_name
        if self._elsewhere is None:
            self._elsewhere = tuple(self.library.names())
        yield from (name for name in self._elsewhere if name not in self._by_name)

    def distribution_hint(self, name: TypeName) -> str | None:
        """Return which ROS distributions have an interface that this one lacks, or None."""
        return self.library.distribution_hint(name)

    def declares(self, package: str) -> bool:
        """Return False: each package of the workspace has its own manifest."""
        del package
        return False

    def _put(self, path: Path, text: str | None) -> None:
        """Replace the data of a file; None removes it."""
        if path.name == MANIFEST:
            self._put_manifest(path, text)
            return
        self._forget(path)
        if text is not None:
            reading = read_leniently(Source(self._package_of(path), _relative(path), path, text))
            self.readings[path] = reading
            self._by_name.setdefault(reading.name, path)
            self._outputs.setdefault(_output(reading.name), {})[path] = reading.name
            for each in reading.occurrences:
                if each.type:
                    self._uses.setdefault(each.type, {}).setdefault(path, []).append(each)

    def _put_manifest(self, path: Path, text: str | None) -> None:
        """Replace the data of a manifest, and the package of the definitions beside it."""
        old = self.manifests.pop(path, None)
        if text is None:
            return
        manifest = self.manifests[path] = read_manifest(path, text, self._variables)
        if old and manifest.name and old.name != manifest.name:
            for reading in tuple(self.readings.values()):
                own = path.parent in reading.source.path.parents
                if own and reading.source.package != self._package_of(reading.source.path):
                    self._put(reading.source.path, reading.source.text)

    def _forget(self, path: Path) -> None:
        old = self.readings.pop(path, None)
        if old is None:
            return
        if self._by_name.get(old.name) == path:
            del self._by_name[old.name]
        self._outputs[_output(old.name)].pop(path, None)
        for each in old.occurrences:
            if each.type:
                self._uses[each.type].pop(path, None)

    def _package_of(self, path: Path) -> str:
        """Return the name of the package that contains a definition."""
        manifest = self.manifest_of(path)
        if manifest is None:
            manifest_path = next(
                (folder / MANIFEST for folder in path.parents if (folder / MANIFEST).is_file()), None
            )
            if manifest_path:
                self.refresh(manifest_path)
                manifest = self.manifests.get(manifest_path)
        return (manifest.name if manifest else None) or path.parent.parent.name


def _output(name: TypeName) -> tuple[str, str, str]:
    return name.package, name.kind, snake_case(name.name)


def is_known(path: Path) -> bool:
    """Return whether a file is of a kind that the language server understands."""
    return path.suffix in _SUFFIXES or path.name == MANIFEST


def _changed(path: Path) -> int | None:
    """Return the last modification time of a file or folder, None if it does not exist."""
    try:
        return os.stat(path).st_mtime_ns  # noqa: PTH116  (of thousands of files: faster)
    except OSError:
        return None


def _relative(path: Path) -> str:
    return f"{path.parent.name}/{path.name}"
