"""The verbs list, package, packages, show and proto of `forge interface`, as in `ros2 interface`."""

from __future__ import annotations

import sys
from itertools import compress
from typing import TYPE_CHECKING, Any

from forge.base.ament_index import prefix_of
from forge.base.distributions import distribution_option
from forge.base.errors import InterfaceError, Problem
from forge.base.frozen import frozen
from forge.base.names import did_you_mean
from forge.base.options import option, options_of
from forge.base.standard_interfaces import EMBEDDED, distribution_hint
from forge.cli.commands.interface.inputs import known_library, require_built
from forge.cli.options import add_verb
from forge.interfaces.read.sources import names_in

if TYPE_CHECKING:
    from pathlib import Path

    from forge.interfaces.model import TypeName
    from forge.interfaces.read.sources import Library

_HEADINGS = {"msg": "Messages:", "srv": "Services:", "action": "Actions:"}


def _filled(text: str) -> str:
    if not text:
        raise ValueError("the name is empty")
    return text


@frozen
class _ListingOptions:
    only_msgs: bool = option("list only messages", default=False, short="-m")
    only_srvs: bool = option("list only services", default=False, short="-s")
    only_actions: bool = option("list only actions", default=False, short="-a")
    rosdistro: str | None = distribution_option()

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
        parse=_filled,
        metavar="TYPE",
    )
    all_comments: bool = option(
        "show the comments of nested messages, too", default=False, conflicts="comments"
    )
    no_comments: bool = option("omit comments and blank lines", default=False, conflicts="comments")
    rosdistro: str | None = distribution_option()


@frozen
class _ProtoOptions:
    type: str = option("full name of the interface", positional=True, parse=_filled, metavar="TYPE")
    no_quotes: bool = option("print the YAML without surrounding quotes", default=False)
    rosdistro: str | None = distribution_option()


def register(verbs: Any) -> None:
    add_verb(verbs, "list", "list all interfaces", _ListingOptions, _list)
    add_verb(verbs, "package", "list the interfaces of a package", _PackageOptions, _package)
    add_verb(verbs, "packages", "list the packages that have interfaces", _ListingOptions, _packages)
    add_verb(verbs, "show", "print a definition with nested messages expanded", _ShowOptions, _show)
    summary = "print a message, a service's request or an action's goal as YAML, with default values"
    add_verb(verbs, "proto", summary, _ProtoOptions, _proto)


def _list(options: _ListingOptions) -> int:
    names = sorted(known_library(options.rosdistro).names())
    for kind in options.kinds or _HEADINGS:
        print(_HEADINGS[kind])
        for name in names:
            if name.kind == kind:
                print(f"    {name}")
    return 0


def _package(options: _PackageOptions) -> int:
    library = known_library(options.listing.rosdistro)
    folder = library.folder(options.package)
    if not folder:
        _check_package(options.package, library)
        return 0
    for name in sorted(names_in(options.package, folder, library.rosdistro)):
        if not options.listing.kinds or name.kind in options.listing.kinds:
            print(name)
    return 0


def _packages(options: _ListingOptions) -> int:
    # With several kinds, `ros2 interface packages` uses the first one in this order.
    kinds = options.kinds[:1]
    library = known_library(options.rosdistro)
    for package, folder in library.packages().items():
        names = list(names_in(package, folder, library.rosdistro))
        if any(name.kind in kinds for name in names) if kinds else names:
            print(package)
    return 0


def _show(options: _ShowOptions) -> int:
    from forge.interfaces.show import Comments, parse_type_name, show

    library = known_library(options.rosdistro)
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


def _proto(options: _ProtoOptions) -> int:
    from forge.interfaces.prototype import to_yaml
    from forge.interfaces.resolve.resolution import nested_messages
    from forge.interfaces.show import parse_type_name

    library = known_library(options.rosdistro)
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
