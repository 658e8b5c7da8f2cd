"""generate HTML documentation of the interfaces of the workspace"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path, PurePosixPath

from forge.base.ament_index import prefixes
from forge.base.distributions import EMBEDDED
from forge.base.errors import (
    ForgeError,
    HostError,
    InterfaceError,
    Location,
    Problem,
    print_warnings,
    raise_if_any,
)
from forge.base.files import read_file, text_or_nothing, write_if_changed
from forge.base.frozen import frozen
from forge.base.layout import INTERFACE_PAGES_DIR
from forge.base.names import LOWER_NAME, did_you_mean
from forge.base.options import flag, option, options_of
from forge.build.folder_marks import mark_build_base
from forge.cli.commands.interface.inputs import IncludeOptions, distribution_of, installed_definitions
from forge.cli.options import profile_option
from forge.environment.installed import underlay_prefixes
from forge.interfaces.model import Catalog, File
from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library, contradictions, definition_files, read_source
from forge.interfaces.resolve.resolution import dependency_catalogs, resolve
from forge.interfaces.writing import Written, unwritable
from forge.plugins.interface_pages.site import PackageInfo, site
from forge.workspace.discovery import ROS_DEFAULTS, discover
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import Package
from forge.workspace.resolve import GENERATORS, INTERFACE_GROUP
from forge.workspace.root import find_install, find_root

_FIRST_PAGE = "index.html"
_LISTING = ".forge_site"
"""The file in the folder of a site that lists all others."""
_OUTPUT = Path("build") / INTERFACE_PAGES_DIR


@frozen
class Options:
    EPILOG = "Types that the interfaces refer to are documented, too, so that all links work."
    packages: tuple[str, ...] = option(
        "document only these packages, which may be outside of the workspace",
        default=(),
        positional=True,
        metavar="PKG",
    )
    output: Path | None = option(f"output folder (default: {_OUTPUT})", parse=Path, short="-o", metavar="DIR")
    underlays: bool = flag("also document all interfaces in sourced prefixes")
    embedded: bool = flag("also document all interfaces embedded in forge")
    title: str = option("title of the site (default: %(default)s)", default="Interfaces", metavar="TEXT")
    others: IncludeOptions = options_of(IncludeOptions)
    profile: str | None = profile_option()


def run(options: Options) -> int:
    """Write the pages of the requested packages, and of those that they refer to."""
    root = find_root(Path.cwd(), Path.home())
    workspace = discover(root, ["."], os.environ)
    print_warnings(workspace.problems)
    install = find_install(root, Path.home(), options.profile)
    built = installed_definitions(install, workspace.packages)
    packages = {
        name: package
        for name, package in workspace.packages.items()
        if (
            INTERFACE_GROUP in package.manifest.groups
            or any(each.name == GENERATORS for each in package.manifest.dependencies)
        )
        and (name in built or definition_files(workspace.root / package.path))
    }
    folders = {name: root / package.path for name, package in packages.items()}
    folders |= {name: Path(folder) for name, folder in options.others.includes}
    hint = "names of interface packages consist of lower-case letters, digits and single underscores"
    misnomers = (
        Problem(f"'{name}' is not a valid name of an interface package", Location(folder), hint)
        for name, folder in folders.items()
        if not LOWER_NAME.fullmatch(name)
    )
    raise_if_any(misnomers, InterfaceError)
    out = options.output or Path(os.path.relpath(root / _OUTPUT))
    if any(
        (root / each.path).resolve().is_relative_to(out.resolve()) for each in workspace.packages.values()
    ):
        message = "the output folder contains packages, which discovery would then ignore"
        raise ForgeError(Problem(message, Location(out), "choose a separate folder with --output"))
    underlays = underlay_prefixes(install) if install else ()
    sourced = (*prefixes(os.environ), *underlays)
    library = Library(
        includes=folders,
        prefixes=sourced,
        rosdistro=distribution_of(options.others.rosdistro),
        built=built,
    )
    documented_packages = _wanted(options, folders, library)
    results = [_attempt(name, library) for name in documented_packages]
    problems = [
        problem for result in results if isinstance(result, InterfaceError) for problem in result.problems
    ]
    catalogs = [result for result in results if isinstance(result, Catalog)]
    if not catalogs:
        raise_if_any(dict.fromkeys(problems), InterfaceError)
    others = [other for catalog in catalogs for other in dependency_catalogs(catalog, library)]
    # Types of other packages are documented only if these refer to them.
    catalogs += sorted(
        (other for other in others if other.package not in documented_packages),
        key=lambda other: other.package,
    )
    abouts = {
        each.package: _about(each.package, library, packages, whole=each.package in documented_packages)
        for each in catalogs
    }
    if options.output is None and not out.parent.exists():
        mark_build_base(out.parent)
    written = write_site(site(catalogs, abouts, options.title), out)
    count = f"{len(written.changed)} of {written.total} files"
    print(f"{count} written, start page: '{out / _FIRST_PAGE}'")
    raise_if_any(dict.fromkeys(problems), InterfaceError)
    return 0


def _wanted(options: Options, own: Mapping[str, Path], library: Library) -> dict[str, Path]:
    """Return the folders of the packages to document completely; raises ForgeError."""
    folders = library.packages()
    names = list(options.packages) or [
        name
        for name, folder in folders.items()
        if name in own or (options.embedded if folder.is_relative_to(EMBEDDED) else options.underlays)
    ]
    raise_if_any(
        Problem(f"unknown interface package '{name}'", hint=did_you_mean(name, folders))
        for name in names
        if name not in folders
    )
    if not names:
        hint = "change to a workspace, name packages, or add --underlays or --embedded"
        raise ForgeError(Problem("no interfaces to document", hint=hint))
    return {name: folders[name] for name in sorted(set(names))}


def _attempt(name: str, library: Library) -> Catalog | InterfaceError:
    """Return a catalog, or the error, so that errors of all packages are reported."""
    try:
        places = library.definitions(name).values()
        sources = [read_source(name, base, relative) for base, relative in places]
        if name not in library.built:
            print_warnings(contradictions(sources))
        parsed = parse_all(sources)
        return resolve(name, parsed, library, events=library.has_events)
    except InterfaceError as error:
        return error


def _about(name: str, library: Library, packages: Mapping[str, Package], *, whole: bool) -> PackageInfo:
    folder = library.folder(name) or Path()
    if name in library.includes:
        origin = "from the workspace"
    else:
        origin = "embedded in forge" if folder.is_relative_to(EMBEDDED) else "from an underlay"
    manifest, path = None, folder / "package.xml"
    if name in packages:
        manifest = packages[name].manifest
    else:
        with suppress(OSError, ForgeError):  # missing or unreadable
            manifest = parse_manifest(read_file(path), path, {**ROS_DEFAULTS, **os.environ})
    limits = "" if whole else ", only referenced types"
    if manifest is None:
        return PackageInfo(origin=origin + limits)
    return PackageInfo(manifest.version, manifest.description, origin + limits)


def write_site(files: Iterable[File], out: Path) -> Written:
    """Write the files of a site below `out`, and remove obsolete files of an earlier run.

    Raises HostError if the folder is not writable, or contains a first page that forge did not write.
    """
    listing = out / _LISTING
    try:
        if not listing.is_file() and (out / _FIRST_PAGE).exists():
            hint = "choose another folder with --output, or remove the file"
            problem = Problem(f"'{_FIRST_PAGE}' exists, but forge did not write it", Location(out), hint)
            raise HostError(problem)
        before = set(text_or_nothing(listing).splitlines()) - {""}
        paths = map(PurePosixPath, before)
        before = {str(path) for path in paths if not path.is_absolute() and ".." not in path.parts}
        written = {file.path: write_if_changed(out / file.path, file.text) for file in files}
        # Keep all existing files in the list, even if the next steps fail.
        write_if_changed(listing, "".join(f"{path}\n" for path in sorted(before | written.keys())))
        for path in sorted(before - written.keys()):
            (out / path).unlink(missing_ok=True)
            for folder in PurePosixPath(path).parents[:-1]:
                with suppress(OSError):
                    (out / folder).rmdir()
        write_if_changed(listing, "".join(f"{path}\n" for path in sorted(written)))
    except OSError as error:
        raise unwritable(error, out) from error
    return Written(tuple(out / path for path, changed in written.items() if changed), len(written))
