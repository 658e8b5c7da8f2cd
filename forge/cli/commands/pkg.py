"""`forge pkg`: create packages and query installed ones."""

from __future__ import annotations

import os
from pathlib import Path

from forge.base.errors import ForgeError, Problem
from forge.base.extensions import PKG_VERBS
from forge.base.frozen import frozen
from forge.base.names import did_you_mean
from forge.base.options import flag, option
from forge.base.xml import parse_xml
from forge.cli.main import Parser, add_verbs_of_plugins
from forge.cli.options import add_verb, profile_option
from forge.environment.installed import executables, find_package, known_packages
from forge.workspace.root import find_install, source_packages


@frozen
class _ListOptions:
    profile: str | None = profile_option()


@frozen
class _ExecutablesOptions:
    package: str | None = option(
        "list executables of this package (default: of all)", positional=True, nargs="?", metavar="PACKAGE"
    )
    full_path: bool = flag("print paths instead of names")
    profile: str | None = profile_option()


@frozen
class _PrefixOptions:
    package: str = option("name of the package", positional=True, metavar="PACKAGE")
    share: bool = flag("print the package's share folder instead of the prefix")
    profile: str | None = profile_option()


@frozen
class _XmlOptions:
    package: str = option("name of the package", positional=True, metavar="PACKAGE")
    tag: str | None = option("print only the text of elements with this tag", short="-t", metavar="TAG")
    profile: str | None = profile_option()


def register(parser: Parser) -> None:
    verbs = parser.add_subparsers(metavar="VERB", required=True)
    add_verb(verbs, "list", "list installed packages", _ListOptions, _list)
    summary = "list executables of installed packages"
    add_verb(verbs, "executables", summary, _ExecutablesOptions, _executables)
    add_verb(verbs, "prefix", "print the prefix of an installed package", _PrefixOptions, _prefix)
    summary = "print the manifest (package.xml) of an installed package"
    add_verb(verbs, "xml", summary, _XmlOptions, _xml)
    add_verbs_of_plugins(parser, verbs, PKG_VERBS, verbs.choices)


def _install(profile: str | None) -> Path | None:
    return find_install(Path.cwd(), Path.home(), profile)


def _find(package: str, profile: str | None) -> Path:
    """Return the prefix of an installed package; raises ForgeError with a hint."""
    install = _install(profile)
    return find_package(package, os.environ, install, lambda: source_packages(install))


def _list(options: _ListOptions) -> None:
    for name in known_packages(os.environ, _install(options.profile)):
        print(name)


def _executables(options: _ExecutablesOptions) -> None:
    if options.package is None:
        packages = known_packages(os.environ, _install(options.profile))
    else:
        packages = {options.package: _find(options.package, options.profile)}
    for name, prefix in packages.items():
        for path in executables(name, prefix):
            print(path if options.full_path else f"{name} {path.name}")


def _prefix(options: _PrefixOptions) -> None:
    prefix = _find(options.package, options.profile)
    print(prefix / "share" / options.package if options.share else prefix)


def _xml(options: _XmlOptions) -> None:
    path = _find(options.package, options.profile) / "share" / options.package / "package.xml"
    try:
        content = path.read_bytes()
    except OSError:
        problem = Problem("package XML manifest not found", hint=f"expected '{path}'")
        raise ForgeError(problem) from None
    root = parse_xml(content, path)
    if options.tag is None:
        print(content[root.start :].decode(errors="replace").rstrip())
        return
    elements = tuple(root.all(options.tag))
    if not elements:
        hint = did_you_mean(options.tag, (child.tag for child in root.children))
        raise ForgeError(Problem("XML tag not found", hint=hint))
    for element in elements:
        print(element.text.strip())
