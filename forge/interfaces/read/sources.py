"""Find and read definitions in folders, installed packages and the embedded packages."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from forge.base import distributions
from forge.base.ament_index import INDEX
from forge.base.errors import ForgeError, InterfaceError, Location, Problem, reason_of
from forge.base.files import names_in, read_file
from forge.base.xml import parse_xml
from forge.interfaces.model import SECTIONS, File, Source, TypeName, sections_of, with_events
from forge.interfaces.read.parsing import ENDINGS, Parsed, parse

_RUNTIMES = {"python": ("python", "*"), "cpp": ("include", "*"), "c": ("include", "*.h")}
"""The folder and the file pattern of the run time for each language."""


def read_folder(
    package: str, folder: Path, rosdistro: str = distributions.OLDEST, built: Path | None = None
) -> tuple[Source, ...]:
    """Read the definitions of a package, sorted by kind and name; .idl files in other folders come last.

    An embedded package has those of a ROS distribution. For `built`, see definition_places().
    Raises InterfaceError if there are no definitions, or if one is not UTF-8.
    """
    definitions = [(base, relative) for relative, base in definition_files(folder, rosdistro).items()]
    if built:
        definitions = [*definition_places(folder, rosdistro, built).values()]
    if not definitions:
        hint = "definitions must be in subfolders msg, srv and action; .idl files in any subfolder"
        raise InterfaceError(Problem(f"no interface definitions found in '{folder}'", hint=hint))
    kinds = (*SECTIONS, *sorted({key_of(relative)[0] for _, relative in definitions} - SECTIONS.keys()))
    definitions.sort(key=lambda place: (kinds.index(key_of(place[1])[0]), place[1]))
    return tuple(read_source(package, base, relative) for base, relative in definitions)


def definition_places(
    folder: Path, rosdistro: str, built: Path | None
) -> dict[tuple[str, str], tuple[Path, str]]:
    """Return folder and path of each definition of a package, by kind and name.

    If the package was `built` (the folder with its installed definitions), these are the definitions passed
    to that build, and newer ones in its sources.
    """
    files = definition_files(folder, rosdistro)
    places = {key_of(relative): (base, relative) for relative, base in files.items()}
    if built and (listed := _listed(built)):
        keys = {key_of(path): path for path in listed}
        when = _index_entry(built).stat().st_mtime_ns
        for key, (base, path) in places.items():
            if (base / path).stat().st_ctime_ns > when:
                keys.setdefault(key, path)
        # Errors are shown in the sources.
        places = {key: places.get(key, (built, path)) for key, path in keys.items()}
    return places


def contradictions(sources: Iterable[Source]) -> Iterator[Problem]:
    """Yield a problem for each .idl file that is ignored because another definition beside it has its name.

    Files with the same content, and those that rosidl or forge generated, are not reported.
    """
    for source in sources:
        path = source.path.with_suffix(".idl")
        if source.path == path or not path.is_file():
            continue
        relative = PurePosixPath(source.relative).with_suffix(".idl")
        other = read_source(source.package, path.parents[len(relative.parts) - 1], relative.as_posix())
        if not other.text.startswith("// generated ") and _content(source) != _content(other):
            name = f"{source.package}/{'/'.join(key_of(source.relative))}"
            text = f"this definition of '{name}' is ignored, because '{source.path}' is another one"
            yield Problem(text, Location(path), hint="remove one of the two files")


def _content(source: Source) -> object:
    """Return fields and constants of a definition without their comments; None if it is invalid."""
    try:
        sections = sections_of(parse(source))
    except InterfaceError:
        return None
    return [
        [(each.name, each.type, each.default) for each in section.fields]
        + [(each.name, each.type, each.value) for each in section.constants]
        for section in sections
    ]


def definition_files(folder: Path, rosdistro: str = distributions.OLDEST) -> dict[str, Path]:
    """Return the folder of each definition of a package by its path below that folder.

    An installed package has those that were passed to rosidl_generate_interfaces(), from any folder. In
    sources, only the folders msg, srv and action are searched.
    """
    if folder.is_relative_to(distributions.EMBEDDED):
        return distributions.embedded_definitions(folder, rosdistro)
    listed = _listed(folder)
    return dict.fromkeys(_found(folder) if listed is None else listed, folder)


def _listed(share: Path) -> list[str] | None:
    """Return the definitions that the ament index lists for an installed package, None without an entry."""
    try:
        text = _index_entry(share).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError, IndexError):
        return None
    paths = [path for path in text.split("\n") if path.rpartition(".")[2] in ENDINGS]
    # Requests and responses of services are installed beside them.
    messages = {path for path in paths if path.endswith(".msg")}
    parts = {path for path in messages if PurePosixPath(path).parent.name in {"srv", "action"}}
    return sorted(_own(path for path in paths if path not in parts and (share / path).is_file())) or None


def _index_entry(share: Path) -> Path:
    return share.parents[1] / INDEX / "rosidl_interfaces" / share.name


def _found(folder: Path) -> list[str]:
    files = [path for kind in SECTIONS for path in (folder / kind).rglob("*") if path.suffix[1:] == kind]
    files += [path for kind in SECTIONS for path in (folder / kind).rglob("*.idl")]
    files += [path for path in folder.glob("*/*.idl") if path.parent.name not in SECTIONS]
    # Editors keep locks and copies as hidden files.
    return sorted(
        _own(path.relative_to(folder).as_posix() for path in files if not path.name.startswith("."))
    )


def _own(paths: Iterable[str]) -> Iterator[str]:
    """Yield the paths without .idl files that rosidl generated from others."""
    unique_paths = dict.fromkeys(paths)
    written = {key_of(path) for path in unique_paths if not path.endswith(".idl")}
    yield from (path for path in unique_paths if not path.endswith(".idl") or key_of(path) not in written)


def key_of(relative: str) -> tuple[str, str]:
    """Return kind and name of the interface in a file, regardless of the folder."""
    path = PurePosixPath(relative)
    return path.parent.name if path.suffix == ".idl" else path.suffix[1:], path.stem


def read_source(package: str, base: Path, relative: str) -> Source:
    """Read the definition `relative`, a path below `base`, of `package`.

    Raises InterfaceError if it cannot be read, is not UTF-8 or has another extension.
    """
    path = base / relative
    if PurePosixPath(relative).suffix.removeprefix(".") not in ENDINGS:
        hint = "the extension must be .msg, .srv, .action or .idl"
        raise InterfaceError(Problem("not an interface definition", Location(path), hint))
    if PurePosixPath(relative).is_absolute() or ".." in PurePosixPath(relative).parts:
        hint = f"name it by its path below '{base}', as 'msg/Name.msg'"
        raise InterfaceError(
            Problem("the path of a definition must be relative and without '..'", Location(path), hint)
        )
    try:
        content = read_file(path)
    except OSError as error:
        raise InterfaceError(
            Problem(f"cannot read the definition: {reason_of(error)}", Location(path))
        ) from error
    try:
        return Source(package, relative, path, content.decode())
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        hint = "save it as UTF-8, for example with iconv -f ISO-8859-1 -t UTF-8"
        raise InterfaceError(Problem("the file is not valid UTF-8", Location(path, line), hint)) from error


def read_runtime(language: str) -> Iterator[File]:
    """Yield the run-time files that generated code of a language needs."""
    if language not in _RUNTIMES:
        return
    name, pattern = _RUNTIMES[language]
    folder = distributions.EMBEDDED / "rosidl_default_runtime" / name
    for path in sorted(folder.rglob(pattern)):
        relative = path.relative_to(folder)
        # Skip caches that tools create in a checkout.
        if path.is_file() and not any(part.startswith((".", "__pycache__")) for part in relative.parts):
            yield File(relative.as_posix(), path.read_text(encoding="utf-8"))


@dataclass(slots=True)
class Library:
    """The interfaces of all available packages, parsed on demand and cached.

    Search order: `given` definitions, included folders, prefixes in their order, embedded packages.
    """

    includes: Mapping[str, Path] = field(default_factory=dict)
    prefixes: tuple[Path, ...] = ()
    embedded: Path | None = distributions.EMBEDDED
    rosdistro: str = distributions.OLDEST
    """The ROS distribution of the embedded definitions."""
    manifest: Path | None = None
    """The package.xml of the definitions that are compiled, read for hints only."""
    built: Mapping[str, Path] = field(default_factory=dict)
    """The folders into which included packages were installed, with generated definitions, too."""
    given: Mapping[TypeName, Parsed] = field(default_factory=dict)
    _parsed: dict[TypeName, Parsed | None] = field(default_factory=dict)
    _definitions: dict[str, dict[tuple[str, str], tuple[Path, str]]] = field(default_factory=dict)
    _declared: frozenset[str] | None = None

    @property
    def has_events(self) -> bool:
        """Whether services have messages for their events in the distribution."""
        return distributions.has_service_events(self.rosdistro)

    def find(self, name: TypeName) -> Parsed | None:
        """Return the interface of that name, or None; raises InterfaceError if its file is invalid."""
        if name in self.given:
            return self.given[name]
        if name not in self._parsed:
            parsed = None
            if place := self._place(name):
                source = read_source(name.package, *place)
                interface = with_events(parse(source)) if self.has_events else parse(source)
                parsed = Parsed(source, interface) if interface.name == name else None
            self._parsed[name] = parsed
        return self._parsed[name]

    def file(self, name: TypeName) -> Path | None:
        """Return the file of an interface; an .idl file only if there is no other."""
        place = self._place(name)
        return place[0] / place[1] if place else None

    def _place(self, name: TypeName) -> tuple[Path, str] | None:
        """Return the folder of the definitions, and the path below it, of an interface."""
        folder = self.folder(name.package)
        if not folder:
            return None
        # Nearly all definitions are here; the whole list takes longer to read.
        usual = f"{name.kind}/{name.name}.{name.kind}"
        path = distributions.find_definition(folder, self.rosdistro, usual)
        if path:
            return path.parent.parent, usual
        return self.definitions(name.package).get((name.kind, name.name))

    def definitions(self, package: str) -> dict[tuple[str, str], tuple[Path, str]]:
        """Return folder and path of each definition of a package, by kind and name."""
        if package not in self._definitions:
            folder = self.folder(package)
            self._definitions[package] = (
                definition_places(folder, self.rosdistro, self.built.get(package)) if folder else {}
            )
        return self._definitions[package]

    def folder(self, package: str) -> Path | None:
        """Return the folder with the msg, srv and action folders of a package."""
        folders = [each[package] for each in (self.includes, self.built) if package in each]
        folders += [prefix / "share" / package for prefix in self.prefixes]
        folders += [self.embedded / package] if self.embedded else []
        return next((each for each in folders if _has_interfaces(each, self.rosdistro)), None)

    def packages(self) -> dict[str, Path]:
        """Return the folder of each package that has interfaces, by name."""
        places = [prefix / INDEX / "rosidl_interfaces" for prefix in self.prefixes]
        places += [self.embedded] if self.embedded else []
        names = {*self.includes, *(name for place in places for name in names_in(place) if name[0] != ".")}
        folders = {name: self.folder(name) for name in sorted(names)}
        return {name: folder for name, folder in folders.items() if folder}

    def names(self) -> Iterator[TypeName]:
        yield from self.given
        for package in self.packages():
            yield from self.names_in(package)

    def names_in(self, package: str) -> Iterator[TypeName]:
        """Yield the names of the interfaces of a package, sorted by kind."""
        order = {kind: number for number, kind in enumerate(SECTIONS)}
        keys = sorted(self.definitions(package), key=lambda key: (order.get(key[0], len(order)), key))
        return (TypeName(package, *key) for key in keys if "_" not in key[1])

    def distribution_hint(self, name: TypeName) -> str | None:
        """Return a hint that names the distributions with a type that this one lacks, or None."""
        folder = self.folder(name.package)
        if folder and not distributions.is_embedded(folder):
            return None
        return distributions.distribution_hint(
            name.package, self.rosdistro, f"{name.kind}/{name.name}.{name.kind}"
        )

    def declares(self, package: str) -> bool:
        """Return whether the manifest declares a package."""
        if self._declared is None:
            self._declared = frozenset()
            with suppress(OSError, ForgeError):
                root = parse_xml(read_file(self.manifest), self.manifest) if self.manifest else None
                tags = root.children if root else ()
                self._declared = frozenset(each.text.strip() for each in tags if each.tag.endswith("depend"))
        return package in self._declared


def _has_interfaces(folder: Path, rosdistro: str) -> bool:
    if (folder / distributions.SINCE).is_dir() and folder.is_relative_to(distributions.EMBEDDED):
        return bool(distributions.embedded_definitions(folder, rosdistro))
    return any((folder / kind).is_dir() for kind in SECTIONS) or any(folder.glob("*/*.idl"))
