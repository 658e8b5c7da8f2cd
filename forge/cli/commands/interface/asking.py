"""The verbs list, package, packages, show and proto of `forge interface`, as in `ros2 interface`."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from forge.base.ament_index import prefix_of
from forge.base.errors import InterfaceError, Problem
from forge.base.names import did_you_mean
from forge.base.standard_interfaces import EMBEDDED, distribution_hint
from forge.cli.commands.interface.inputs import add_distribution, known_library, require_built
from forge.interfaces.read.sources import names_in

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from forge.cli.main import Parser
    from forge.interfaces.model import TypeName
    from forge.interfaces.read.sources import Library

    Verbs = argparse._SubParsersAction[Parser]

_HEADINGS = {"msg": "Messages:", "srv": "Services:", "action": "Actions:"}


def register(verbs: Verbs) -> None:
    _add_listing(verbs, "list", _list, "list all interfaces")
    package = _add_listing(verbs, "package", _package, "list the interfaces of a package")
    package.add_argument("package", metavar="PACKAGE", help="name of the package")
    _add_listing(verbs, "packages", _packages, "list the packages that have interfaces")
    summary = "print a definition with nested messages expanded"
    show = verbs.add_parser("show", help=summary, description=summary)
    show.add_argument(
        "type", metavar="TYPE", type=_filled, help="full name of the interface; '-' reads the name from stdin"
    )
    levels = show.add_mutually_exclusive_group()
    levels.add_argument(
        "--all-comments", action="store_true", help="show the comments of nested messages, too"
    )
    levels.add_argument("--no-comments", action="store_true", help="omit comments and blank lines")
    add_distribution(show)
    show.set_defaults(verb=_show)
    summary = "print a message, a service's request or an action's goal as YAML, with default values"
    proto = verbs.add_parser("proto", help=summary, description=summary)
    proto.add_argument("type", metavar="TYPE", type=_filled, help="full name of the interface")
    proto.add_argument("--no-quotes", action="store_true", help="print the YAML without surrounding quotes")
    add_distribution(proto)
    proto.set_defaults(verb=_proto)


def _add_listing(verbs: Verbs, word: str, verb: Callable[[argparse.Namespace], int], summary: str) -> Parser:
    listing = verbs.add_parser(word, help=summary, description=summary)
    for flag, kind in (("msgs", "msg"), ("srvs", "srv"), ("actions", "action")):
        listing.add_argument(
            f"-{flag[0]}",
            f"--only-{flag}",
            dest="kinds",
            action="append_const",
            const=kind,
            help=f"list only {_HEADINGS[kind].rstrip(':').lower()}",
        )
    add_distribution(listing)
    listing.set_defaults(verb=verb)
    return listing


def _filled(text: str) -> str:
    if not text:
        raise argparse.ArgumentTypeError("the name is empty")
    return text


def _list(options: argparse.Namespace) -> int:
    names = sorted(known_library(options).names())
    for kind, heading in _HEADINGS.items():
        if not options.kinds or kind in options.kinds:
            print(heading)
            for name in names:
                if name.kind == kind:
                    print(f"    {name}")
    return 0


def _package(options: argparse.Namespace) -> int:
    library = known_library(options)
    folder = library.folder(options.package)
    if not folder:
        _check_package(options.package, library)
        return 0
    for name in sorted(names_in(options.package, folder, library.rosdistro)):
        if not options.kinds or name.kind in options.kinds:
            print(name)
    return 0


def _packages(options: argparse.Namespace) -> int:
    # With several kinds, `ros2 interface packages` uses the first one in this order.
    kind = next((kind for kind in _HEADINGS if kind in (options.kinds or ())), None)
    library = known_library(options)
    for package, folder in library.packages().items():
        names = list(names_in(package, folder, library.rosdistro))
        if any(name.kind == kind for name in names) if kind else names:
            print(package)
    return 0


def _show(options: argparse.Namespace) -> int:
    from forge.interfaces.show import Comments, parse_type_name, show

    library = known_library(options)
    text = sys.stdin.readline().strip() if options.type == "-" else options.type
    name = parse_type_name(text, library.names)
    path = _definition(name, library)
    if path.suffix == ".idl":
        print(path.read_text(encoding="utf-8"), end="")
        return 0
    inner = Comments.ALL if options.all_comments else Comments.TOP
    comments = Comments.NONE if options.no_comments else inner
    for line in show(name, comments, lambda each: _definition(each, library).read_text(encoding="utf-8")):
        print(line)
    return 0


def _proto(options: argparse.Namespace) -> int:
    from forge.interfaces.prototype import to_yaml
    from forge.interfaces.resolve.resolution import nested_messages
    from forge.interfaces.show import parse_type_name

    library = known_library(options)
    name = parse_type_name(options.type, library.names)
    path = _definition(name, library)
    parsed = library.find(name)
    if not parsed:
        raise InterfaceError(Problem(f"'{path}' does not define the interface '{name}'"))
    text = to_yaml(parsed.interface, nested_messages(parsed, library))
    print(text if options.no_quotes else f'"{text}"')
    return 0


def _definition(name: TypeName, library: Library) -> Path:
    """Return the file of an interface; raises InterfaceError with the message of `ros2 interface`."""
    folder = library.folder(name.package) or _check_package(name.package, library)
    path = library.file(name)
    if path:
        return path
    near = library.distribution_hint(name) or did_you_mean(str(name), [str(each) for each in library.names()])
    missing = folder / name.kind / f"{name.name}.idl"
    raise InterfaceError(Problem(f"Could not find the interface '{missing}'", hint=near))


def _check_package(package: str, library: Library) -> Path:
    """Return the share folder of a package without interfaces; raises InterfaceError if it does not exist."""
    prefix = prefix_of(package, library.prefixes)
    if prefix:
        return prefix / "share" / package
    hint = distribution_hint(package, library.rosdistro)
    if not hint and (EMBEDDED / package / "package.xml").is_file():
        return EMBEDDED / package
    require_built(package, library)
    hint = hint or did_you_mean(package, library.packages())
    raise InterfaceError(Problem(f"Unknown package '{package}'", hint=hint))
