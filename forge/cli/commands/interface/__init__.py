"""`forge interface`: compile interface definitions and query installed and embedded ones."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from functools import partial
from itertools import compress
from pathlib import Path
from typing import Any

from forge.base.distributions import EMBEDDED, distribution_option
from forge.base.env_vars import compiled_templates
from forge.base.errors import InterfaceError, Problem, print_warnings, raise_if_any
from forge.base.extensions import VERBS
from forge.base.files import text_or_nothing
from forge.base.frozen import frozen
from forge.base.options import flag, option, options_of
from forge.base.templating import keep_compiled
from forge.base.text import counted
from forge.cli.commands.interface.inputs import (
    InputOptions,
    catalog_of,
    check_package,
    definition_path,
    known_library,
    library_of,
    non_empty,
)
from forge.cli.main import Parser, add_verbs_of_plugins
from forge.cli.options import add_verb, profile_option
from forge.engine.observed import keep
from forge.interfaces import writing
from forge.interfaces.model import Catalog
from forge.interfaces.read.parsing import python_keywords
from forge.interfaces.read.sources import read_runtime
from forge.interfaces.resolve.resolution import (
    dependency_catalogs,
    undeclared_dependencies,
)
from forge.interfaces.show import parse_type_name, show

__all__ = ["inputs"]

_DEFAULT_LANGUAGES = ("python", "cpp")
_HEADINGS = {"msg": "Messages:", "srv": "Services:", "action": "Actions:"}


@frozen
class _ListingOptions:
    only_msgs: bool = flag("list only messages", short="-m")
    only_srvs: bool = flag("list only services", short="-s")
    only_actions: bool = flag("list only actions", short="-a")
    rosdistro: str | None = distribution_option()
    profile: str | None = profile_option()

    @property
    def kinds(self) -> list[str]:
        """Return the kinds to list, none for all."""
        return list(compress(_HEADINGS, (self.only_msgs, self.only_srvs, self.only_actions)))


@frozen
class _PackageOptions:
    package: str = option("name of the package", positional=True, metavar="PACKAGE")
    listing: _ListingOptions = options_of(_ListingOptions)


@frozen
class _ShowOptions:
    type: str = option(
        "full name of the interface; '-' reads the name from stdin",
        positional=True,
        parse=non_empty,
        metavar="TYPE",
    )
    all_comments: bool = flag("show the comments of nested messages, too", conflicts="comments")
    no_comments: bool = flag("omit comments and blank lines", conflicts="comments")
    rosdistro: str | None = distribution_option()
    profile: str | None = profile_option()


def register(parser: Parser) -> None:
    verbs = parser.add_subparsers(metavar="VERB", required=True, parser_class=type(parser))
    own: dict[str, tuple[str, Any, Any]] = {
        "list": ("list all interfaces", _ListingOptions, _list),
        "package": ("list the interfaces of a package", _PackageOptions, _package),
        "packages": ("list the packages that have interfaces", _ListingOptions, _packages),
        "show": ("print a definition with nested messages expanded", _ShowOptions, _show),
        "generate": (
            "compile definitions to Python, C++, C, IDL, JSON, JSON Schema, TypeScript or Markdown",
            _GenerateOptions,
            _generate,
        ),
    }
    for word in ("list", "package", "packages", "show", "proto", "hash", "schema", "generate"):
        if word in own:
            add_verb(verbs, word, *own[word])
        else:
            add_verbs_of_plugins(parser, verbs, VERBS, own, word)
    verbs.choices["generate"].fromfile_prefix_chars = "@"
    add_verbs_of_plugins(parser, verbs, VERBS, own)


def _list(options: _ListingOptions) -> int:
    names = sorted(known_library(options.rosdistro, profile=options.profile).names())
    for kind in options.kinds or _HEADINGS:
        print(_HEADINGS[kind])
        for name in names:
            if name.kind == kind:
                print(f"    {name}")
    return 0


def _package(options: _PackageOptions) -> int:
    library = known_library(options.listing.rosdistro, profile=options.listing.profile)
    folder = library.folder(options.package)
    if not folder:
        check_package(options.package, library, options.listing.profile)
        return 0
    for name in sorted(library.names_in(options.package)):
        if not options.listing.kinds or name.kind in options.listing.kinds:
            print(name)
    return 0


def _packages(options: _ListingOptions) -> int:
    # With several kinds, `ros2 interface packages` uses the first one in this order.
    kinds = options.kinds[:1]
    library = known_library(options.rosdistro, profile=options.profile)
    for package in library.packages():
        names = list(library.names_in(package))
        if any(name.kind in kinds for name in names) if kinds else names:
            print(package)
    return 0


def _show(options: _ShowOptions) -> int:
    library = known_library(options.rosdistro, profile=options.profile)
    text = sys.stdin.readline().strip() if options.type == "-" else options.type
    name = parse_type_name(text, library.names)
    path = definition_path(name, library, options.profile)
    if path.suffix == ".idl":
        print(path.read_text(encoding="utf-8"), end="")
        return 0
    levels = 0 if options.no_comments else sys.maxsize if options.all_comments else 1
    for line in show(
        name, levels, lambda each: definition_path(each, library, options.profile).read_text(encoding="utf-8")
    ):
        print(line)
    return 0


@frozen
class _GenerateOptions:
    EPILOG = "@FILE reads arguments from FILE, one per line"
    source: str | None = option(
        "folder with subfolders msg, srv or action", positional=True, nargs="?", metavar="SOURCE_DIR"
    )
    inputs: InputOptions = options_of(InputOptions)
    output: Path = option(
        "output folder; files go to python/NAME, cpp/NAME and so on",
        parse=Path,
        required=True,
        metavar="DIR",
    )
    languages: tuple[str, ...] | None = option(
        "output to generate: python, cpp, c, idl, json, jsonschema, arrow, protobuf, typescript or docs; "
        f"repeatable (default: {' and '.join(_DEFAULT_LANGUAGES)})",
        flag="--lang",
        repeats=True,
        metavar="LANG",
    )
    no_runtime: bool = flag(
        "do not write run-time files and types of other packages; allow only types of included packages"
    )
    stamp: Path | None = option("file to touch after success", parse=Path, metavar="FILE")
    depfile: Path | None = option(
        "write a make rule with all files read to this file", parse=Path, metavar="FILE"
    )


def _generate(options: _GenerateOptions) -> int:
    inputs = options.inputs
    states = writing.read_states(options.output)
    before = states.get(inputs.package or "", writing.OutputState())
    if before.parts:
        # The earlier files remain outputs even if this run fails.
        ledger = writing.ledger_of(inputs.package or "", options.output)
        content = text_or_nothing(ledger).encode()
        earlier = [f"{options.output}/{path}" for path in before.files]
        keep(ledger, content, (*earlier, *filter(None, (options.depfile,))))
    library = library_of(inputs.others)
    bases = (options.source, *(base for base, _ in inputs.files))
    library.manifest = next((Path(base) / "package.xml" for base in bases if base), None)
    catalog = catalog_of(inputs, options.source, library)
    if options.no_runtime:
        raise_if_any(undeclared_dependencies(catalog, dict(inputs.others.includes), library), InterfaceError)
    print_warnings(python_keywords(catalog.interfaces.values()))
    needed = () if options.no_runtime else dependency_catalogs(catalog, library)
    others = () if options.no_runtime else _others(catalog, options, states)
    folders = {each.package: library.folder(each.package) for each in needed}
    state = writing.OutputState(
        needs=tuple(name for each in needed for name in each.interfaces),
        folders={
            package: folder.absolute()
            for package, folder in folders.items()
            if folder and not folder.is_relative_to(EMBEDDED)
        },
    )
    keep_compiled(*compiled_templates(os.environ, options.output / writing.STATE_FOLDER / "templates"))
    catalogs = (catalog, *others)
    languages = tuple(dict.fromkeys(options.languages or _DEFAULT_LANGUAGES))
    digests = writing.fingerprints(catalogs, f"{writing.generator_digest()} {library.rosdistro}")
    parts = [
        part for language in languages for each in catalogs for part in writing.parts(each, language, digests)
    ]
    if not options.no_runtime:
        parts += [
            writing.Part(language, "run-time files", None, partial(read_runtime, language))
            for language in languages
        ]
    written = writing.write(parts, options.output, catalog.package, state, states)
    keep(writing.ledger_of(catalog.package, options.output), written.ledger)
    if options.depfile:
        sources = [source.path for each in (catalog, *others) for source in each.sources.values()]
        writing.write_depfile(options.depfile, options.stamp or options.output, dict.fromkeys(sources))
    if options.stamp:
        options.stamp.parent.mkdir(parents=True, exist_ok=True)
        options.stamp.touch()
    else:
        print(f"{len(written.changed)} of {counted(written.total, 'file')} written to '{options.output}'")
    return 0


def _others(
    catalog: Catalog, options: _GenerateOptions, found: Mapping[str, writing.OutputState]
) -> tuple[Catalog, ...]:
    """Return the types of other packages that the packages in the output folder need.

    Several packages may share the output folder: one run must not remove files that another package needs.
    Packages that are generated as a whole into the folder are left out.
    """
    states = {package: state for package, state in found.items() if package != catalog.package}
    packages = {catalog.package, *states}
    folders = dict(pair for state in states.values() for pair in state.folders.items())
    library = library_of(options.inputs.others, folders)
    needs = []
    for package, state in states.items():
        partial = [name for name in state.needs if name.package not in packages]
        if lost := [name for name in partial if library.find(name) is None]:
            message = f"cannot find '{lost[0]}', which '{package}' needs"
            hint = f"generate '{package}' again, or remove '{options.output}'"
            raise InterfaceError(Problem(message, hint=hint))
        needs += partial
    return tuple(
        other for other in dependency_catalogs(catalog, library, needs) if other.package not in packages
    )
