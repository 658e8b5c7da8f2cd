"""Options that say where packages are looked for and which of them count; the same for every command."""

from __future__ import annotations

import argparse
import re
from typing import TYPE_CHECKING

from forge.errors import Problem, SelectionError
from forge.selection import Query

if TYPE_CHECKING:
    from collections.abc import Sequence

    from forge.cli import Parser

_BY_NAME = {
    "select": "only these",
    "skip": "not these",
    "up-to": "these and all that they need",
    "above": "these and all that need them",
    "above-and-dependencies": "these, all that need them, and all that those need",
    "select-by-dep": "only those that need one of these",
    "skip-by-dep": "not those that need one of these",
    "skip-up-to": "neither these nor what they need",
}
_BY_PATTERN = {
    "select": "only those whose name begins like this regular expression",
    "skip": "not those whose name begins like it",
    "up-to": "those whose name begins like it, and all that they need",
}
_BY_RESULT = {
    "select-build-failed": "only those that failed to build the last time",
    "skip-build-finished": "not those that built the last time",
    "select-test-failures": "only those whose tests failed the last time",
    "skip-test-passed": "not those whose tests passed the last time",
}
_BY_CHANGE = ("packages_select_changed", "packages_above_changed")


def add(parser: Parser) -> None:
    """Add where packages are looked for, and which of them count."""
    _add_discovery(parser)
    _add_selection(parser)
    _add_sets(parser)


def _add_discovery(parser: Parser) -> None:
    """Add where packages are looked for."""
    group = parser.add_argument_group("where packages are")
    _paths(group, "--base-paths", ["."], "look below these folders (default: here)")
    _paths(
        group,
        "--paths",
        [],
        "these folders themselves, and no others without --base-paths; 'src/*' means all in it",
    )
    _paths(group, "--metas", ["colcon.meta"], "files with options for single packages (default: colcon.meta)")
    group.add_argument(
        "--ignore-user-meta", action="store_true", help="leave out the files in ~/.colcon/metadata"
    )
    _names(group, "--packages-ignore", "as if these were not there")
    _patterns(group, "--packages-ignore-regex", "as if those whose name begins like it were not there")


def _add_selection(parser: Parser) -> None:
    """Add which packages count."""
    group = parser.add_argument_group("which packages")
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
        help="these and what needs them over at most N steps",
    )
    for word, meaning in (("start", "from this one on"), ("end", "up to this one")):
        group.add_argument(
            f"--packages-{word}", type=_name, metavar="PKG", help=f"{meaning}, in the order of building"
        )
    results = group.add_mutually_exclusive_group()
    for word, meaning in _BY_RESULT.items():
        results.add_argument(f"--packages-{word}", action="store_true", help=meaning)
    group.add_argument(
        "--packages-select-changed",
        action="store_true",
        help="only those with files that differ from git's last commit, new files included",
    )
    group.add_argument("--packages-above-changed", action="store_true", help="those and all that need them")
    group.add_argument(
        "--since", default="HEAD", metavar="REV", help="changed against which revision (default: HEAD)"
    )
    group.add_argument(
        "--strict",
        action="store_true",
        help="a name that no package has is an error everywhere; for build, so is a file that two packages "
        "install with different contents",
    )


def _add_sets(parser: Parser) -> None:
    """Add where further options come from; forge.configuration reads them."""
    group = parser.add_argument_group("options from files")
    group.add_argument("--profile", metavar="NAME", help="options of a profile in forge.toml")
    group.add_argument(
        "--mixin", nargs="*", metavar="NAME", help="options of mixins, which 'forge mixin list' names"
    )
    group.add_argument(
        "--mixin-files", nargs="*", metavar="FILE", help="files with mixins, beside the user's own"
    )


def add_listing(parser: Parser) -> None:
    """Add all that a command takes which shows packages, and builds none."""
    add(parser)
    parser.add_argument(
        "--build-base",
        default="build",
        metavar="DIR",
        help="where results of builds are noted (default: build)",
    )
    parser.add_argument("--embedded", action="store_true", help="with the packages that forge brings along")
    parser.add_argument("--json", action="store_true", help="print JSON")


def base_paths_of(options: argparse.Namespace) -> Sequence[str]:
    """Return the folders to walk: none where the command line has --paths, and not --base-paths."""
    given = getattr(options, "given", ())
    if "paths" in given and options.paths and "base_paths" not in given:
        return ()
    return tuple(options.base_paths)


def paths_of(options: argparse.Namespace) -> Sequence[str]:
    """Return the folders that are packages themselves: the command line's --base-paths put files' aside."""
    given = getattr(options, "given", ())
    return () if "base_paths" in given and "paths" not in given else tuple(options.paths)


def query_of(options: argparse.Namespace) -> Query:
    """Return the selection options as typed."""
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
    )


def chooses(options: argparse.Namespace) -> bool:
    """Tell if any option says which packages count."""
    flags = (*(f"packages_{word.replace('-', '_')}" for word in _BY_RESULT), *_BY_CHANGE)
    return query_of(options) != Query() or any(getattr(options, flag) for flag in flags)


def _depth(words: Sequence[str]) -> tuple[int, tuple[str, ...]]:
    """Return the number of steps and the names that --packages-above-depth takes; raises SelectionError."""
    if not words:
        return 0, ()
    first, *names = words
    if not first.isdecimal():
        message = f"the first word of --packages-above-depth is how many steps, not '{first}'"
        raise SelectionError(Problem(message, hint="as in '--packages-above-depth 1 my_package'"))
    return int(first), tuple(names)


def _paths(group: argparse._ArgumentGroup, option: str, default: list[str], meaning: str) -> None:
    group.add_argument(option, nargs="*", default=default, metavar="PATH", help=meaning)


def _names(group: argparse._ArgumentGroup, option: str, meaning: str) -> None:
    group.add_argument(option, nargs="*", type=_name, metavar="PKG", help=meaning)


def _patterns(group: argparse._ArgumentGroup, option: str, meaning: str) -> None:
    group.add_argument(option, nargs="*", type=_pattern, metavar="REGEX", help=meaning)


def _name(text: str) -> str:
    """Return the name of a package; a blank in front shields one that begins with a dash."""
    return text.lstrip()


def _pattern(text: str) -> str:
    """Return a regular expression as typed; raises ArgumentTypeError for what is none."""
    try:
        re.compile(text)
    except re.error as error:
        raise argparse.ArgumentTypeError(f"'{text}' is no regular expression: {error}") from None
    return text
