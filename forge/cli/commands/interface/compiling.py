"""The verb generate of `forge interface`: generate code and descriptions from definitions."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.env_vars import compiled_templates
from forge.base.errors import InterfaceError, Problem, print_warnings, raise_if_any
from forge.base.standard_interfaces import EMBEDDED
from forge.base.templating import keep_compiled
from forge.base.text import counted
from forge.cli.commands.interface.inputs import add_inputs, catalog_of, library_of
from forge.interfaces.fingerprints import fingerprints
from forge.interfaces.output_state import STATE_FOLDER, OutputState, generator_digest, read_states
from forge.interfaces.read.keywords import python_keywords
from forge.interfaces.read.sources import Library, read_runtime
from forge.interfaces.rendering import Part, parts
from forge.interfaces.resolve.dependencies import dependency_catalogs, undeclared_dependencies
from forge.interfaces.writing import write, write_depfile, write_stamp

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable

    from forge.cli.commands.interface.inputs import Verbs
    from forge.cli.main import Parser
    from forge.interfaces.model import Catalog

_DEFAULT_LANGUAGES = ("python", "cpp")


def register(verbs: Verbs) -> None:
    summary = "compile definitions to Python, C++, C, .idl, .json or Markdown"
    more = "@FILE reads arguments from FILE, one per line"
    generate = verbs.add_parser(
        "generate", help=summary, description=summary, epilog=more, fromfile_prefix_chars="@"
    )
    generate.add_argument(
        "source", metavar="SOURCE_DIR", nargs="?", help="folder with subfolders msg, srv or action"
    )
    add_inputs(generate)
    _add_outputs(generate)
    generate.set_defaults(verb=_generate)


def _add_outputs(parser: Parser) -> None:
    parser.add_argument(
        "--output",
        metavar="DIR",
        type=Path,
        required=True,
        help="output folder; files go to python/NAME, cpp/NAME and so on",
    )
    default = " and ".join(_DEFAULT_LANGUAGES)
    parser.add_argument(
        "--lang",
        metavar="LANG",
        dest="languages",
        action="append",
        help=f"output to generate: python, cpp, c, idl, json or docs; repeatable (default: {default})",
    )
    parser.add_argument(
        "--no-runtime",
        action="store_true",
        help="do not write run-time files and types of other packages; allow only types of included packages",
    )
    parser.add_argument("--stamp", metavar="FILE", type=Path, help="file to touch after success")
    parser.add_argument(
        "--depfile", metavar="FILE", type=Path, help="write a make rule with all files read to this file"
    )


def _generate(options: argparse.Namespace) -> int:
    library = library_of(options)
    bases = (options.source, *(base for base, _ in options.files))
    library.manifest = next((Path(base) / "package.xml" for base in bases if base), None)
    catalog = catalog_of(options, options.source, library)
    if options.no_runtime:
        raise_if_any(undeclared_dependencies(catalog, dict(options.includes), library), InterfaceError)
    print_warnings(python_keywords(catalog.interfaces.values()))
    needed = () if options.no_runtime else dependency_catalogs(catalog, library)
    others = () if options.no_runtime else _others(catalog, options)
    state = OutputState(
        needs=tuple(name for each in needed for name in each.interfaces), folders=_folders(needed, library)
    )
    keep_compiled(*compiled_templates(os.environ, options.output / STATE_FOLDER / "templates"))
    catalogs = (catalog, *others)
    languages = tuple(dict.fromkeys(options.languages or _DEFAULT_LANGUAGES))
    digests = fingerprints(catalogs, generator_digest())
    found = [part for language in languages for each in catalogs for part in parts(each, language, digests)]
    if not options.no_runtime:
        found += [
            Part(language, "run-time files", None, partial(read_runtime, language)) for language in languages
        ]
    written = write(found, options.output, catalog.package, state)
    if options.depfile:
        sources = [source.path for each in (catalog, *others) for source in each.sources.values()]
        write_depfile(options.depfile, options.stamp or options.output, dict.fromkeys(sources))
    if options.stamp:
        write_stamp(options.stamp)
    else:
        print(f"{len(written.changed)} of {counted(written.total, 'file')} written to '{options.output}'")
    return 0


def _others(catalog: Catalog, options: argparse.Namespace) -> tuple[Catalog, ...]:
    """Return the types of other packages that the packages in the output folder need.

    Several packages may share the output folder: one run must not remove files that another package needs.
    Packages that are generated as a whole into the folder are left out.
    """
    states = read_states(options.output)
    states.pop(catalog.package, None)
    whole = {catalog.package, *states}
    library = library_of(options, dict(pair for state in states.values() for pair in state.folders.items()))
    needs = []
    for package, state in states.items():
        partial = [name for name in state.needs if name.package not in whole]
        if lost := [name for name in partial if library.find(name) is None]:
            message = f"cannot find '{lost[0]}', which '{package}' needs"
            hint = f"generate '{package}' again, or remove '{options.output}'"
            raise InterfaceError(Problem(message, hint=hint))
        needs += partial
    return tuple(
        other for other in dependency_catalogs(catalog, library, needs) if other.package not in whole
    )


def _folders(others: Iterable[Catalog], library: Library) -> dict[str, Path]:
    """Return the folders of the definitions of other packages, except embedded ones."""
    found = {other.package: library.folder(other.package) for other in others}
    return {
        package: folder.absolute()
        for package, folder in found.items()
        if folder and not folder.is_relative_to(EMBEDDED)
    }
