"""generate and hash: a package's definitions to code, descriptions and hashes."""

from __future__ import annotations

import argparse
import json
import os
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from forge.ament_index import prefixes
from forge.errors import ForgeError, InterfaceError, Problem, raise_if_any
from forge.interfaces.declarations import LOWER_NAME
from forge.interfaces.fingerprints import fingerprints
from forge.interfaces.hashing import hashes
from forge.interfaces.model import Catalog, TypeName
from forge.interfaces.parsing import parse_all
from forge.interfaces.records import Record, generator_digest, read_records
from forge.interfaces.rendering import Part, parts
from forge.interfaces.resolution import messages_below, referred, resolve, undeclared
from forge.interfaces.showing import parse_type_name
from forge.interfaces.sources import EMBEDDED, Library, read_folder, read_runtime, read_source
from forge.interfaces.writing import write, write_depfile, write_stamp
from forge.names import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    Verbs = argparse._SubParsersAction[argparse.ArgumentParser]  # noqa: SLF001  (argparse has no public name)

_DEFAULT_LANGUAGES = ("python", "cpp")


def register(verbs: Verbs) -> None:
    """Add what compiles to the words that follow `forge interface`."""
    summary = "compile definitions to Python, C++, C, .idl, .json or Markdown"
    more = "@FILE stands for the words in that file, one per line"
    generate = verbs.add_parser(
        "generate", help=summary, description=summary, epilog=more, fromfile_prefix_chars="@"
    )
    generate.add_argument("source", metavar="SOURCE_DIR", nargs="?", help="a folder with msg, srv or action")
    _add_inputs(generate)
    _add_outputs(generate)
    generate.set_defaults(verb=_generate)
    summary = "print type hashes (RIHS01), of named types or of a folder of definitions"
    hashing = verbs.add_parser("hash", help=summary, description=summary)
    hashing.add_argument("what", metavar="TYPE|SOURCE_DIR", nargs="*", help="types; a folder with --package")
    hashing.add_argument("--json", action="store_true", help="print one object")
    _add_inputs(hashing)
    hashing.set_defaults(verb=_hash)


def _add_inputs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--package", metavar="NAME", help="the package that the definitions belong to")
    parser.add_argument(
        "--include",
        metavar="PKG=DIR",
        dest="includes",
        action="append",
        default=[],
        type=_pair("=", str.partition),
        help="a folder with the msg, srv and action folders of another package",
    )
    parser.add_argument(
        "--file",
        metavar="BASE:RELATIVE",
        dest="files",
        action="append",
        default=[],
        type=_pair(":", str.rpartition),
        help="a definition, such as /src/p:msg/X.msg, instead of a folder of them",
    )


def _add_outputs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--output", metavar="DIR", type=Path, required=True, help="gets LANG/PACKAGE/...")
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


def _pair(mark: str, split: Callable[[str, str], tuple[str, str, str]]) -> Callable[[str], tuple[str, str]]:
    """Return a reader of 'LEFT<mark>RIGHT'."""

    def read(text: str) -> tuple[str, str]:
        left, _, right = split(text, mark)
        if not left or not right:
            raise argparse.ArgumentTypeError(f"'{text}' has no '{mark}' between two parts")
        return left, right

    return read


def _generate(options: argparse.Namespace) -> int:
    library = _library(options)
    catalog = _catalog(options, options.source, library)
    if options.no_runtime:
        raise_if_any(undeclared(catalog, dict(options.includes)), InterfaceError)
    needed = () if options.no_runtime else referred(catalog, library)
    others = () if options.no_runtime else _others(catalog, options)
    record = Record(
        needs=tuple(name for each in needed for name in each.interfaces), folders=_folders(needed, library)
    )
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


def _hash(options: argparse.Namespace) -> int:
    library = _library(options)
    if options.package:
        source = options.what[0] if options.what else None
        found = hashes(_catalog(options, source, library))
    else:
        found = {name: _hash_of(name, library) for name in map(parse_type_name, options.what)}
    if options.json:
        print(json.dumps({str(name): text for name, text in found.items()}, indent=1))
    else:
        for name, text in found.items():
            print(name, text)
    return 0


def _library(options: argparse.Namespace, recorded: Mapping[str, Path] | None = None) -> Library:
    """Return what can be found; `recorded` folders of earlier runs count where this run names none."""
    includes = {package: Path(folder) for package, folder in options.includes}
    return Library(includes={**(recorded or {}), **includes}, prefixes=prefixes(os.environ))


def _catalog(options: argparse.Namespace, folder: str | None, library: Library) -> Catalog:
    """Read, parse and resolve the definitions that the command line names."""
    package: str | None = options.package
    if not package:
        raise ForgeError(Problem("the definitions belong to no package", hint="add --package NAME"))
    if not LOWER_NAME.fullmatch(package):
        hint = "such a name has lower-case letters, digits and single underscores"
        raise ForgeError(Problem(f"'{package}' is not the name of an interface package", hint=hint))
    sources = tuple(read_source(package, Path(base), relative) for base, relative in options.files)
    if folder:
        sources += read_folder(package, Path(folder))
    if not sources:
        hint = "name a folder with msg, srv or action in it"
        raise ForgeError(Problem("there is nothing to compile", hint=hint))
    return resolve(package, parse_all(sources), library)


def _others(catalog: Catalog, options: argparse.Namespace) -> tuple[Catalog, ...]:
    """Return what is needed of packages that are not generated into the same folder themselves.

    A second package's run must not take away what the first one needs: both share one folder.
    """
    records = read_records(options.output)
    records.pop(catalog.package, None)
    whole = {catalog.package, *records}
    library = _library(options, dict(pair for record in records.values() for pair in record.folders.items()))
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


def _hash_of(name: TypeName, library: Library) -> str:
    """Return the hash of an interface or of a type derived from one; raises InterfaceError."""
    base = TypeName(name.package, name.kind, name.name.partition("_")[0])
    parsed = library.find(base)
    if parsed:
        catalog = Catalog(
            base.package, {base: parsed.interface}, messages_below(parsed, library), {base: parsed.source}
        )
        found = hashes(catalog).get(name)
        if found:
            return found
    hint = did_you_mean(str(name), [str(each) for each in library.names()])
    raise InterfaceError(Problem(f"there is no type '{name}'", hint=hint))


def _files(count: int) -> str:
    return "1 file" if count == 1 else f"{count} files"
