"""What the verbs of `forge interface` have in common: which definitions, of which package, found where."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge.ament_index import prefixes
from forge.errors import ForgeError, InterfaceError, Problem, raise_if_any
from forge.interfaces.declarations import LOWER_NAME
from forge.interfaces.parsing import parse_all
from forge.interfaces.resolution import resolve
from forge.interfaces.sources import Library, read_folder, read_source

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from forge.interfaces.model import Catalog

    Verbs = argparse._SubParsersAction[argparse.ArgumentParser]  # noqa: SLF001  (argparse has no public name)


def add_inputs(parser: argparse.ArgumentParser) -> None:
    """Add the options that say which definitions to compile."""
    parser.add_argument("--package", metavar="NAME", help="the package that the definitions belong to")
    add_includes(parser)
    parser.add_argument(
        "--file",
        metavar="BASE:RELATIVE",
        dest="files",
        action="append",
        default=[],
        type=_pair(":", str.rpartition),
        help="a definition, such as /src/p:msg/X.msg, instead of a folder of them",
    )
    parser.add_argument(
        "--strict", action="store_true", help="refuse what is legal but hurts: see the reference"
    )


def add_includes(parser: argparse.ArgumentParser) -> None:
    """Add the option that says where other packages are."""
    parser.add_argument(
        "--include",
        metavar="PKG=DIR",
        dest="includes",
        action="append",
        default=[],
        type=_pair("=", str.partition),
        help="a folder with the msg, srv and action folders of another package",
    )


def library_of(options: argparse.Namespace, recorded: Mapping[str, Path] | None = None) -> Library:
    """Return what can be found; `recorded` folders of earlier runs count where this run names none."""
    includes = {package: Path(folder) for package, folder in options.includes}
    return Library(includes={**(recorded or {}), **includes}, prefixes=prefixes(os.environ))


def catalog_of(options: argparse.Namespace, folder: str | None, library: Library) -> Catalog:
    """Return what the command line names, read, parsed and resolved; raises ForgeError."""
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
    parsed = parse_all(sources)
    if options.strict:
        from forge.interfaces.strictness import doubts  # noqa: PLC0415  (few ask for that)

        raise_if_any(doubts(parsed), InterfaceError)
    return resolve(package, parsed, library, _forgotten(options))


def _forgotten(options: argparse.Namespace) -> dict[str, str]:
    """Return the messages that lie beside the files that were named, and were not named themselves."""
    named = {relative for _, relative in options.files}
    beside = (path for base in {base for base, _ in options.files} for path in Path(base).glob("msg/*.msg"))
    return {path.stem: f"msg/{path.name}" for path in beside if f"msg/{path.name}" not in named}


def _pair(mark: str, split: Callable[[str, str], tuple[str, str, str]]) -> Callable[[str], tuple[str, str]]:
    """Return a reader of 'LEFT<mark>RIGHT'."""

    def read(text: str) -> tuple[str, str]:
        left, _, right = split(text, mark)
        if not left or not right:
            raise argparse.ArgumentTypeError(f"'{text}' has no '{mark}' between two parts")
        return left, right

    return read
