"""generate: a package's definitions to code and descriptions."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from forge.commands.interface.inputs import add_inputs, catalog_of, library_of
from forge.errors import InterfaceError, Problem, raise_if_any
from forge.interfaces.fingerprints import fingerprints
from forge.interfaces.records import RECORDS, Record, generator_digest, read_records
from forge.interfaces.rendering import Part, parts
from forge.interfaces.resolution import referred, undeclared
from forge.interfaces.sources import EMBEDDED, Library, read_runtime
from forge.interfaces.writing import write, write_depfile, write_stamp
from forge.settings import compiled_templates
from forge.templating import keep_compiled

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterable

    from forge.commands.interface.inputs import Verbs
    from forge.interfaces.model import Catalog

_DEFAULT_LANGUAGES = ("python", "cpp")


def register(verbs: Verbs) -> None:
    """Add what compiles to the words that follow `forge interface`."""
    summary = "compile definitions to Python, C++, C, .idl, .json or Markdown"
    more = "@FILE stands for the words in that file, one per line"
    generate = verbs.add_parser(
        "generate", help=summary, description=summary, epilog=more, fromfile_prefix_chars="@"
    )
    generate.add_argument("source", metavar="SOURCE_DIR", nargs="?", help="a folder with msg, srv or action")
    add_inputs(generate)
    _add_outputs(generate)
    generate.set_defaults(verb=_generate)


def _add_outputs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--output", metavar="DIR", type=Path, required=True, help="where python/NAME, cpp/NAME and so on go"
    )
    default = " and ".join(_DEFAULT_LANGUAGES)
    parser.add_argument(
        "--lang",
        metavar="LANG",
        dest="languages",
        action="append",
        help=f"python, cpp, c, idl, json or docs; may be repeated (default: {default})",
    )
    parser.add_argument(
        "--no-runtime",
        action="store_true",
        help="write neither run-time files nor other packages' types; use only types of included packages",
    )
    parser.add_argument("--stamp", metavar="FILE", type=Path, help="a file to touch when all is done")
    parser.add_argument("--depfile", metavar="FILE", type=Path, help="gets a make rule with the files read")


def _generate(options: argparse.Namespace) -> int:
    library = library_of(options)
    catalog = catalog_of(options, options.source, library)
    if options.no_runtime:
        raise_if_any(undeclared(catalog, dict(options.includes)), InterfaceError)
    needed = () if options.no_runtime else referred(catalog, library)
    others = () if options.no_runtime else _others(catalog, options)
    record = Record(
        needs=tuple(name for each in needed for name in each.interfaces), folders=_folders(needed, library)
    )
    keep_compiled(*compiled_templates(os.environ, options.output / RECORDS / "templates"))
    written = write(_parts((catalog, *others), options), options.output, catalog.package, record)
    if options.depfile:
        sources = [source.path for each in (catalog, *others) for source in each.sources.values()]
        write_depfile(options.depfile, options.stamp or options.output, dict.fromkeys(sources))
    if options.stamp:
        write_stamp(options.stamp)
    else:
        print(f"{len(written.changed)} of {_files(written.total)} written to '{options.output}'")
    return 0


def _parts(catalogs: tuple[Catalog, ...], options: argparse.Namespace) -> list[Part]:
    """Return what there is to render, with digests by which an earlier run's result is known to be good."""
    languages = tuple(dict.fromkeys(options.languages or _DEFAULT_LANGUAGES))
    digests = fingerprints(catalogs, generator_digest())
    found = [part for language in languages for each in catalogs for part in parts(each, language, digests)]
    if not options.no_runtime:
        found += [
            Part(language, "run-time files", None, partial(read_runtime, language)) for language in languages
        ]
    return found


def _others(catalog: Catalog, options: argparse.Namespace) -> tuple[Catalog, ...]:
    """Return what is needed of packages that are not generated into the same folder themselves.

    A second package's run must not take away what the first one needs: both share one folder.
    """
    records = read_records(options.output)
    records.pop(catalog.package, None)
    whole = {catalog.package, *records}
    library = library_of(
        options, dict(pair for record in records.values() for pair in record.folders.items())
    )
    needs = []
    for package, record in records.items():
        partial = [name for name in record.needs if name.package not in whole]
        if lost := [name for name in partial if library.find(name) is None]:
            message = f"'{lost[0]}', which '{package}' needs, is not there any more"
            hint = f"generate '{package}' again, or '{options.output}' from nothing"
            raise InterfaceError(Problem(message, hint=hint))
        needs += partial
    return tuple(other for other in referred(catalog, library, needs) if other.package not in whole)


def _folders(others: Iterable[Catalog], library: Library) -> dict[str, Path]:
    """Return where the definitions of other packages lie; those that forge brings along are always there."""
    found = {other.package: library.folder(other.package) for other in others}
    return {
        package: folder.absolute()
        for package, folder in found.items()
        if folder and not folder.is_relative_to(EMBEDDED)
    }


def _files(count: int) -> str:
    return "1 file" if count == 1 else f"{count} files"
