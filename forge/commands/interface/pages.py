"""The work of `forge interface docs`: which packages, found where, and what is known of each."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge.ament_index import prefixes
from forge.discovery import ROS_DEFAULTS, discover
from forge.errors import ForgeError, InterfaceError, Place, Problem, raise_if_any
from forge.files import read_file
from forge.interfaces.declarations import LOWER_NAME
from forge.interfaces.html_site import About, site
from forge.interfaces.model import Catalog
from forge.interfaces.parsing import parse_all
from forge.interfaces.resolution import referred, resolve
from forge.interfaces.sources import EMBEDDED, Library, names_in, read_folder
from forge.interfaces.writing import write_site
from forge.manifest import parse_manifest
from forge.names import did_you_mean
from forge.workspace import warn
from forge.workspace_root import find_root

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable, Mapping

    from forge.model import Manifest, Package, Workspace

_GROUP = "rosidl_interface_packages"
_GENERATORS = "rosidl_default_generators"
_FIRST_PAGE = "index.html"


def make_site(options: argparse.Namespace, default: Path) -> int:
    """Write the pages that the options ask for; `default` is where, below the root of the workspace."""
    root = find_root(Path.cwd(), Path.home())
    found = discover(root, ["."], os.environ)
    warn(found.problems)
    packages = _interface_packages(found)
    folders = {name: root / package.path for name, package in packages.items()}
    folders |= {name: Path(folder) for name, folder in options.includes}
    raise_if_any(_misnomers(folders), InterfaceError)
    out = options.output or Path(os.path.relpath(root / default))
    raise_if_any(_buried([root / each.path for each in found.packages.values()], out))
    library = Library(includes=folders, prefixes=prefixes(os.environ))
    whole = _wanted(options, folders, library)
    catalogs = _catalogs(whole, library)
    abouts = {
        each.package: _about(each.package, library, packages, whole=each.package in whole)
        for each in catalogs
    }
    written = write_site(site(catalogs, abouts, options.title), out, _FIRST_PAGE)
    count = f"{len(written.changed)} of {written.total} files"
    print(f"{count} written, the first page is '{out / _FIRST_PAGE}'")
    return 0


def _interface_packages(workspace: Workspace) -> dict[str, Package]:
    """Return the packages of the workspace that define interfaces; files of others may only look so."""
    return {
        name: package
        for name, package in workspace.packages.items()
        if _defines_interfaces(package.manifest) and any(names_in(name, workspace.root / package.path))
    }


def _defines_interfaces(manifest: Manifest) -> bool:
    return _GROUP in manifest.groups or any(each.name == _GENERATORS for each in manifest.dependencies)


def _misnomers(folders: Mapping[str, Path]) -> list[Problem]:
    """Return a problem for each name that would be no good in a path, or in generated code."""
    hint = "the name of a package with interfaces has lower-case letters, digits and single underscores"
    return [
        Problem(f"'{name}' is not the name of an interface package", Place(folder), hint)
        for name, folder in folders.items()
        if not LOWER_NAME.fullmatch(name)
    ]


def _buried(folders: Iterable[Path], out: Path) -> list[Problem]:
    """Return a problem if packages lie below where the pages go, where no tool looks for packages."""
    around = out.resolve()
    if not any(folder.resolve().is_relative_to(around) for folder in folders):
        return []
    hint = "name a folder for the pages alone with --output"
    return [Problem("there are packages in this folder, which the pages would hide", Place(out), hint)]


def _wanted(options: argparse.Namespace, own: Mapping[str, Path], library: Library) -> dict[str, Path]:
    """Return the folders of the packages that are documented as a whole; raises ForgeError."""
    known = library.packages()
    names = list(options.packages) or [
        name
        for name, folder in known.items()
        if name in own or (options.embedded if folder.is_relative_to(EMBEDDED) else options.underlays)
    ]
    raise_if_any(
        Problem(f"there is no package '{name}' with interfaces", hint=did_you_mean(name, known))
        for name in names
        if name not in known
    )
    if not names:
        hint = "go to a workspace, name packages, or add --underlays or --embedded"
        raise ForgeError(Problem("there are no interfaces to make pages of", hint=hint))
    return {name: known[name] for name in sorted(set(names))}


def _catalogs(folders: Mapping[str, Path], library: Library) -> tuple[Catalog, ...]:
    """Return the catalogs of the folders, and of what they refer to elsewhere; raises InterfaceError."""
    results = [_attempt(name, folder, library) for name, folder in folders.items()]
    problems = [p for result in results if isinstance(result, InterfaceError) for p in result.problems]
    raise_if_any(dict.fromkeys(problems), InterfaceError)
    catalogs = [result for result in results if isinstance(result, Catalog)]
    others: dict[str, list[Catalog]] = {}
    for catalog in catalogs:
        for other in referred(catalog, library):
            others.setdefault(other.package, []).append(other)
    return (*catalogs, *_partial(others, folders))


def _attempt(name: str, folder: Path, library: Library) -> Catalog | InterfaceError:
    """Return the error instead of raising it, so that the next package is read as well."""
    try:
        return resolve(name, parse_all(read_folder(name, folder)), library)
    except InterfaceError as error:
        return error


def _partial(others: Mapping[str, list[Catalog]], whole: Iterable[str]) -> Iterable[Catalog]:
    """Yield the catalogs that are not of packages which are there as a whole."""
    for package in sorted(others.keys() - set(whole)):
        yield from others[package]


def _about(name: str, library: Library, packages: Mapping[str, Package], *, whole: bool) -> About:
    """Return what the manifest of a package says, and where it is from."""
    folder = library.folder(name) or Path()
    if name in library.includes:
        origin = "from the workspace"
    else:
        origin = "brought along by forge" if folder.is_relative_to(EMBEDDED) else "from an underlay"
    manifest = packages[name].manifest if name in packages else _manifest(folder / "package.xml")
    limits = "" if whole else ", only what others refer to"
    if manifest is None:
        return About(origin=origin + limits)
    return About(manifest.version, manifest.description, origin + limits)


def _manifest(path: Path) -> Manifest | None:
    """Return the manifest beside definitions; None where there is none, or none that can be read."""
    try:
        return parse_manifest(read_file(path), path, {**ROS_DEFAULTS, **os.environ})
    except (OSError, ForgeError):
        return None
