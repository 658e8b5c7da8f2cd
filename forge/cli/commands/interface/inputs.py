"""Options shared by the verbs of `forge interface`: definitions, their package, include folders."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath

from forge.base.ament_index import INDEX, prefix_of, prefixes
from forge.base.distributions import (
    EMBEDDED,
    VARIABLE,
    check_distribution,
    distribution_hint,
    distribution_in,
    distribution_option,
)
from forge.base.errors import ForgeError, InterfaceError, Location, Problem, print_warnings, raise_if_any
from forge.base.extensions import OPTIONS, find
from forge.base.files import text_or_nothing
from forge.base.frozen import frozen
from forge.base.layout import forge_command
from forge.base.names import LOWER_NAME, did_you_mean
from forge.base.options import flag, option, options_of
from forge.cli.preparation import known_rosdistro
from forge.environment.installed import known_prefixes
from forge.environment.prefixes import package_prefixes
from forge.interfaces.model import Catalog, Source, TypeName
from forge.interfaces.read.parsing import ENDINGS, parse_all
from forge.interfaces.read.sources import Library, contradictions, read_folder, read_source
from forge.interfaces.resolve.resolution import resolve
from forge.workspace.root import find_install, find_root, is_root, source_packages


def _pair(mark: str, split: Callable[[str, str], tuple[str, str, str]]) -> Callable[[str], tuple[str, str]]:
    """Return a function that parses 'LEFT<mark>RIGHT'."""

    def read(text: str) -> tuple[str, str]:
        left, _, right = split(text, mark)
        if not left or not right:
            raise ValueError(f"'{text}' is not of the form LEFT{mark}RIGHT")
        return left, right

    return read


@frozen
class IncludeOptions:
    includes: tuple[tuple[str, str], ...] = option(
        "folder with subfolders msg, srv and action of another package; repeatable",
        default=(),
        flag="--include",
        repeats=True,
        parse=_pair("=", str.partition),
        metavar="PKG=DIR",
    )
    rosdistro: str | None = distribution_option()

    @property
    def folders(self) -> dict[str, Path]:
        return {package: Path(folder) for package, folder in self.includes}


@frozen
class InputOptions:
    package: str | None = option("name of the package that the definitions belong to", metavar="NAME")
    others: IncludeOptions = options_of(IncludeOptions)
    files: tuple[tuple[str, str], ...] = option(
        "a single definition, such as /src/p:msg/X.msg, instead of a folder; repeatable",
        default=(),
        flag="--file",
        repeats=True,
        parse=_pair(":", str.rpartition),
        metavar="BASE:RELATIVE",
    )
    strict: bool = flag("reject error-prone definitions; the command reference lists them")


def library_of(options: IncludeOptions, recorded: Mapping[str, Path] | None = None) -> Library:
    """Return the searchable definitions; `recorded` folders of earlier runs are used unless overridden.

    Builds generate code from these: only included and sourced definitions count, as for other compilers.
    """
    return Library(
        includes={**(recorded or {}), **options.folders},
        prefixes=prefixes(os.environ),
        rosdistro=distribution_of(options.rosdistro),
    )


def known_library(
    rosdistro: str | None, includes: Mapping[str, Path] | None = None, profile: str | None = None
) -> Library:
    """Return the definitions that can be queried: those of the enclosing workspace, then sourced ones."""
    install = find_install(Path.cwd(), Path.home(), profile)
    own = package_prefixes(install) if install else ()
    return Library(
        includes=includes or {},
        prefixes=tuple(dict.fromkeys((*own, *known_prefixes(os.environ, install)))),
        rosdistro=distribution_of(rosdistro),
    )


def require_built(package: str, library: Library, profile: str | None) -> None:
    """Raise InterfaceError for a package of the enclosing workspace whose interfaces are not installed."""
    root = find_root(Path.cwd(), Path.home())
    if not library.folder(package) and is_root(root) and package in source_packages(root / "install"):
        message = f"package '{package}' is in this workspace, but not built"
        command = forge_command(f"build --packages-up-to {package}", profile)
        raise InterfaceError(Problem(message, hint=f"run: {command}"))


def distribution_of(rosdistro: str | None, folder: Path | None = None) -> str:
    """Return the distribution of embedded definitions: chosen here, or by the workspace around `folder`.

    The default is the working directory. The workspace is searched only if neither --rosdistro nor ROS_DISTRO
    is set: builds always set it, and the files that a search reads would be inputs of the package.
    """
    folder = folder or Path.cwd()
    check_distribution(rosdistro)
    chosen = rosdistro or os.environ.get(VARIABLE)
    if not chosen:
        root, install = find_root(folder, Path.home()), find_install(folder, Path.home())
        chosen = known_rosdistro(None, root, install or root / "install")
    return distribution_in({VARIABLE: chosen} if chosen else {})


def installed_definitions(install: Path | None, names: Iterable[str]) -> dict[str, Path]:
    """Return the folders into which packages of a workspace have installed their definitions."""
    homes = (
        ((name, prefix / "share" / name) for name in names for prefix in (install / name, install))
        if install
        else ()
    )
    return {
        name: home for name, home in homes if (home.parents[1] / INDEX / "rosidl_interfaces" / name).is_file()
    }


def _built_from(package: str, folder: Path, profile: str | None) -> Path | None:
    """Return the folder with the installed definitions of a workspace package if the package was built."""
    if not (folder / "package.xml").is_file():
        return None
    install = find_install(folder.resolve(), Path.home(), profile)
    return installed_definitions(install, [package]).get(package)


def _warnings_before_a_build(path: Path, sources: Iterable[Source]) -> Iterator[Problem]:
    """Yield the definitions that a build adds or leaves out according to CMakeLists.txt."""
    from forge.workspace.cmake_text import calls  # builds read no folder

    read = {each.path.name: each.path for each in sources}
    words: dict[str, int] = {}
    for call in calls(text_or_nothing(path)):
        if call.command == "rosidl_generate_interfaces" and "SKIP_INSTALL" not in call.words:
            words |= dict.fromkeys(call.words[1:], call.line)
    listed = {word: PurePosixPath(word).name for word in words if word.rpartition(".")[2] in ENDINGS}
    for word, name in listed.items():
        if name not in read:
            hint = "before a package is built, only definitions below msg, srv and action are found"
            yield Problem(f"'{word}' is left out", Location(path, words[word]), hint)
    if words and not any("$" in word for word in words.keys() - listed.keys()):
        for name in sorted(read.keys() - {*listed.values()}):
            text = "builds leave this definition out: it is not in rosidl_generate_interfaces()"
            yield Problem(text, Location(read[name]))


def catalog_of(
    options: InputOptions, folder: str | None, library: Library, profile: str | None = None
) -> Catalog:
    """Return the resolved definitions named on the command line; raises ForgeError."""
    package = options.package
    if not package:
        raise ForgeError(Problem("missing package name", hint="add --package NAME"))
    if not LOWER_NAME.fullmatch(package):
        hint = "use lower-case letters, digits and single underscores"
        raise ForgeError(Problem(f"'{package}' is not a valid name of an interface package", hint=hint))
    sources = tuple(read_source(package, Path(base), relative) for base, relative in options.files)
    if folder:
        built = _built_from(package, Path(folder), profile)
        folder_sources = read_folder(package, Path(folder), library.rosdistro, built)
        print_warnings(contradictions(folder_sources))
        if not built:
            print_warnings(_warnings_before_a_build(Path(folder) / "CMakeLists.txt", folder_sources))
        sources += folder_sources
    if not sources:
        hint = "name a folder that contains msg, srv or action"
        raise ForgeError(Problem("no interface definitions found", hint=hint))
    parsed = parse_all(sources)
    if options.strict:
        plugin = find(OPTIONS, "strict", "option", ("lint",))
        raise_if_any(plugin.lint(parsed), InterfaceError)
    named = {relative for _, relative in options.files}
    beside = (path for base in {base for base, _ in options.files} for path in Path(base).glob("msg/*.msg"))
    return resolve(
        package,
        parsed,
        library,
        {path.stem: f"msg/{path.name}" for path in beside if f"msg/{path.name}" not in named},
        events=library.has_events,
    )


def definition_path(name: TypeName, library: Library, profile: str | None) -> Path:
    """Return the file of an interface; raises InterfaceError with the message of `ros2 interface`."""
    folder = library.folder(name.package) or check_package(name.package, library, profile)
    path = library.file(name)
    if path:
        return path
    near = library.distribution_hint(name) or did_you_mean(str(name), [str(each) for each in library.names()])
    missing = folder / name.kind / f"{name.name}.idl"
    raise InterfaceError(Problem(f"Could not find the interface '{missing}'", hint=near))


def check_package(package: str, library: Library, profile: str | None) -> Path:
    """Return the share folder of a package without interfaces; raises InterfaceError if it does not exist."""
    prefix = prefix_of(package, library.prefixes)
    if prefix:
        return prefix / "share" / package
    hint = distribution_hint(package, library.rosdistro)
    if not hint and (EMBEDDED / package / "package.xml").is_file():
        return EMBEDDED / package
    require_built(package, library, profile)
    hint = hint or did_you_mean(package, library.packages())
    raise InterfaceError(Problem(f"Unknown package '{package}'", hint=hint))


def non_empty(text: str) -> str:
    """Return a name; raises ValueError for an empty one."""
    if not text:
        raise ValueError("the name is empty")
    return text
