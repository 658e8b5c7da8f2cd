"""Options for package discovery and selection, shared by all commands."""

from __future__ import annotations

import argparse
import re
from typing import TYPE_CHECKING

from forge.base.errors import Problem, SelectionError
from forge.workspace.selection import PackageFilters, Query, SearchPaths

if TYPE_CHECKING:
    from collections.abc import Sequence

    from forge.cli.main import Parser

_BY_NAME = {
    "select": "process only these packages",
    "skip": "skip these packages",
    "up-to": "process these packages and their recursive dependencies",
    "above": "process these packages and all packages that depend on them, recursively",
    "above-and-dependencies": "process these packages, their recursive dependents, and their dependencies",
    "select-by-dep": "process only packages that depend on one of these, directly or indirectly",
    "skip-by-dep": "skip packages that depend on one of these, directly or indirectly",
    "skip-up-to": "skip these packages and their recursive dependencies",
}
_BY_PATTERN = {
    "select": "process only packages whose name matches one of these patterns (from the beginning of the "
    "name)",
    "skip": "skip packages whose name matches one of these patterns",
    "up-to": "process packages whose name matches one of these patterns, and their recursive dependencies",
}
_BY_RESULT = {
    "select-build-failed": "process only packages whose last build failed",
    "skip-build-finished": "skip packages whose last build succeeded",
    "select-test-failures": "process only packages with failures in their last test run",
    "skip-test-passed": "skip packages whose last test run passed",
}
_BY_CHANGE = ("packages_select_changed", "packages_above_changed")


def add(parser: Parser) -> None:
    """Add the options for package discovery and selection."""
    _add_discovery(parser)
    _add_selection(parser)
    group = parser.add_argument_group("options from files")
    group.add_argument("--profile", metavar="NAME", help="use the options of this profile in forge.toml")
    group.add_argument(
        "--mixin",
        nargs="*",
        metavar="NAME",
        help="use the options of these mixins; 'forge mixin show' shows them",
    )
    group.add_argument("--mixin-files", nargs="*", metavar="FILE", help="additional mixin files")


def _add_discovery(parser: Parser) -> None:
    group = parser.add_argument_group("package discovery")
    _paths(group, "--base-paths", ["."], "search these folders recursively for packages (default: .)")
    _paths(
        group,
        "--paths",
        [],
        "use these package folders without searching below them; wildcards such as 'src/*' are allowed",
    )
    _paths(
        group,
        "--metas",
        ["colcon.meta"],
        "files or folders with options for single packages (default: colcon.meta)",
    )
    group.add_argument(
        "--ignore-user-meta", action="store_true", help="ignore metadata files in ~/.colcon/metadata"
    )
    _names(group, "--packages-ignore", "ignore these packages, as if they did not exist")
    _patterns(group, "--packages-ignore-regex", "ignore packages whose name matches one of these patterns")
    group.add_argument(
        "--no-test-dependencies",
        action="store_true",
        help="ignore dependencies that only tests need; for build, do not build the tests that need them",
    )


def _add_selection(parser: Parser) -> None:
    group = parser.add_argument_group("package selection")
    for word, meaning in _BY_NAME.items():
        _names(group, f"--packages-{word}", meaning)
        if word in _BY_PATTERN:
            _patterns(group, f"--packages-{word}-regex", _BY_PATTERN[word])
    group.add_argument(
        "--packages-above-depth",
        nargs="+",
        type=_name,
        default=[],
        metavar=("N", "PKG"),
        help="process these packages and their dependents, up to N levels",
    )
    for word, meaning in (
        ("start", "skip packages before this one in topological order"),
        ("end", "skip packages after this one in topological order"),
    ):
        group.add_argument(f"--packages-{word}", type=_name, metavar="PKG", help=meaning)
    results = group.add_mutually_exclusive_group()
    for word, meaning in _BY_RESULT.items():
        results.add_argument(f"--packages-{word}", action="store_true", help=meaning)
    group.add_argument(
        "--packages-select-changed",
        action="store_true",
        help="process only packages with files changed since --since, including untracked files",
    )
    group.add_argument(
        "--packages-above-changed",
        action="store_true",
        help="process changed packages and all packages that depend on them",
    )
    group.add_argument(
        "--since", default="HEAD", metavar="REV", help="git revision to compare with (default: HEAD)"
    )
    group.add_argument(
        "--strict",
        action="store_true",
        help="treat unknown package names as errors; for build, also files that two packages install "
        "with different contents",
    )


def add_listing(parser: Parser) -> None:
    """Add the options of commands that show packages and build none."""
    add(parser)
    parser.add_argument(
        "--build-base",
        default="build",
        metavar="DIR",
        help="build folder, for results of earlier builds (default: build)",
    )
    parser.add_argument("--embedded", action="store_true", help="include the packages embedded in forge")
    parser.add_argument("--json", action="store_true", help="print the output as JSON")


def search_paths_of(options: argparse.Namespace) -> SearchPaths:
    """Return the search paths.

    If the command line has only one of --paths and --base-paths, it overrides both in option files.
    """
    given = getattr(options, "given", ())
    only_paths = "paths" in given and options.paths and "base_paths" not in given
    only_base_paths = "base_paths" in given and "paths" not in given
    return SearchPaths(
        base_paths=() if only_paths else tuple(options.base_paths),
        paths=() if only_base_paths else tuple(options.paths),
        metas=tuple(options.metas),
        user_metas=not options.ignore_user_meta,
    )


def query_of(options: argparse.Namespace) -> Query:
    """Return the package options as given; raises SelectionError for an invalid depth."""
    fields = {
        "select": options.packages_select,
        "skip": options.packages_skip,
        "select_regex": options.packages_select_regex,
        "skip_regex": options.packages_skip_regex,
        "up_to": options.packages_up_to,
        "up_to_regex": options.packages_up_to_regex,
        "above": options.packages_above,
        "above_and_dependencies": options.packages_above_and_dependencies,
        "select_by_dep": options.packages_select_by_dep,
        "skip_by_dep": options.packages_skip_by_dep,
        "skip_up_to": options.packages_skip_up_to,
        "ignore": options.packages_ignore,
        "ignore_regex": options.packages_ignore_regex,
    }
    return Query(
        **{field: tuple(names) for field, names in fields.items() if names is not None},
        above_depth=_depth(options.packages_above_depth),
        start=options.packages_start,
        end=options.packages_end,
        strict=options.strict,
        no_test_dependencies=options.no_test_dependencies,
        search=search_paths_of(options),
        filters=PackageFilters(
            build_base=options.build_base,
            select_build_failed=options.packages_select_build_failed,
            skip_build_finished=options.packages_skip_build_finished,
            select_test_failures=options.packages_select_test_failures,
            skip_test_passed=options.packages_skip_test_passed,
            select_changed=options.packages_select_changed,
            above_changed=options.packages_above_changed,
            since=options.since,
        ),
    )


def has_selection(options: argparse.Namespace) -> bool:
    """Tell whether any option selects packages."""
    query = query_of(options)
    unlimited = PackageFilters(build_base=query.filters.build_base, since=query.filters.since)
    return query != Query(
        search=query.search, filters=unlimited, no_test_dependencies=query.no_test_dependencies
    )


def _depth(words: Sequence[str]) -> tuple[int, tuple[str, ...]]:
    """Parse the values of --packages-above-depth: a depth and names; raises SelectionError."""
    if not words:
        return 0, ()
    first, *names = words
    if not first.isdecimal():
        message = f"--packages-above-depth expects a number first, not '{first}'"
        raise SelectionError(Problem(message, hint="for example '--packages-above-depth 1 my_package'"))
    return int(first), tuple(names)


def _paths(group: argparse._ArgumentGroup, option: str, default: list[str], meaning: str) -> None:
    group.add_argument(option, nargs="*", default=default, metavar="PATH", help=meaning)


def _names(group: argparse._ArgumentGroup, option: str, meaning: str) -> None:
    group.add_argument(option, nargs="*", type=_name, metavar="PKG", help=meaning)


def _patterns(group: argparse._ArgumentGroup, option: str, meaning: str) -> None:
    group.add_argument(option, nargs="*", type=_pattern, metavar="REGEX", help=meaning)


def _name(text: str) -> str:
    """Return a package name; strip the space that shields names starting with a dash."""
    return text.lstrip()


def _pattern(text: str) -> str:
    """Return a regular expression; raises ArgumentTypeError if it is invalid."""
    try:
        re.compile(text)
    except re.error as error:
        raise argparse.ArgumentTypeError(f"'{text}' is not a valid regular expression: {error}") from None
    return text
