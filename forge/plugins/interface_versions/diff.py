"""compare two versions of interfaces: serialized bytes, hash and API"""

from __future__ import annotations

import json
from collections.abc import Sequence

from forge.base.errors import Problem, SelectionError, print_problem, share_hints
from forge.base.frozen import frozen
from forge.base.options import flag, option, options_of
from forge.cli.commands.interface.inputs import IncludeOptions, known_library
from forge.cli.options import profile_option
from forge.plugins.interface_versions.comparison import (
    API,
    ASPECTS,
    HASH,
    WIRE,
    Difference,
    compare,
    version_of,
)
from forge.plugins.interface_versions.versions import read_version, workspace_packages

_IN_WORDS = {WIRE: "the wire", HASH: "the hash", API: "the API"}


@frozen
class Options:
    EPILOG = (
        "A version is a folder (of a package, a workspace, an install folder) or a revision of git, as in "
        "HEAD~1 or v1.2.0:src/my_msgs. The exit code is 1 if an interface breaks what --fail-on names, "
        "and 2 if one is invalid in a version and cannot be compared."
    )
    old: str = option("the old version", positional=True, metavar="OLD")
    new: str = option(
        "the new version (default: this folder)", default=".", positional=True, nargs="?", metavar="NEW"
    )
    package: str | None = option("compare only the interfaces of this package", metavar="NAME")
    fail_on: tuple[str, ...] = option(
        "properties that must not break: wire, hash, api, or none (default: all)",
        default=ASPECTS,
        nargs="+",
        choices=(*ASPECTS, "none"),
    )
    json: bool = flag("print one JSON object")
    others: IncludeOptions = options_of(IncludeOptions)
    profile: str | None = profile_option()


def run(options: Options) -> int:
    """Print the differences; returns 1 if something broke that must not, 2 if something is not comparable."""
    folders = {**workspace_packages(), **options.others.folders}
    library = known_library(options.others.rosdistro, folders, options.profile)
    read = [read_version(text, library, options.package) for text in (options.old, options.new)]
    old, new = (version_of(*each) for each in read)
    if not (old.names or new.names):
        what = f"package '{options.package}' with interfaces" if options.package else "interfaces"
        hint = "name folders with packages that have folders msg, srv or action"
        raise SelectionError(Problem(f"found no {what} in '{options.old}' or '{options.new}'", hint=hint))
    reasons = (problem for _, invalid in read for problems in invalid.values() for problem in problems)
    for problem in share_hints(dict.fromkeys(reasons)):
        print_problem(problem)
    all_differences = compare(old, new)
    differences = [each for each in all_differences if not each.invalid_in]
    if options.json:
        print(json.dumps({str(each.name): _as_json(each) for each in all_differences}, indent=1))
    else:
        for each in all_differences:
            print(_heading(each))
            if all(each.hashes):
                print("".join(f"  {change.text}\n" for change in each.changes), end="")
        incomparable = len(all_differences) - len(differences)
        print(_summary(differences, len(old.names | new.names) - incomparable, incomparable))
    if len(differences) < len(all_differences):
        return 2
    return int(any(each.breaks & {*options.fail_on} for each in differences))


def _heading(difference: Difference) -> str:
    if difference.invalid_in:
        first, *more = difference.invalid_in
        where = "both versions" if more else f"the {first} version"
        return f"{difference.name}: cannot be compared, because it is invalid in {where}"
    if not difference.hashes[0]:
        return f"{difference.name}: new"
    if not difference.hashes[1]:
        return f"{difference.name}: removed"
    broken = [_IN_WORDS[each] for each in ASPECTS if each in difference.breaks]
    if not broken:
        return f"{difference.name}: keeps the wire, the hash and the API"
    last = f"{' and ' if broken[1:] else ''}{broken[-1]}"
    return f"{difference.name}: breaks {', '.join(broken[:-1])}{last}"


def _summary(differences: Sequence[Difference], total: int, incomparable: int) -> str:
    counts = {each: sum(each in one.breaks for one in differences) for each in ASPECTS}
    broken = ", ".join(f"{count} break {_IN_WORDS[each]}" for each, count in counts.items() if count)
    text = f"{len(differences)} of {total} interfaces differ: {broken or 'nothing breaks'}"
    if not differences:
        text = f"no difference in {total} interfaces"
    return f"{text}; {incomparable} cannot be compared" if incomparable else text


def _as_json(difference: Difference) -> dict[str, object]:
    if difference.invalid_in:
        return {"breaks": None, "changes": [], "invalid_in": difference.invalid_in}
    return {
        "breaks": [aspect for aspect in ASPECTS if aspect in difference.breaks],
        "changes": [change.text for change in difference.changes],
        "old_hash": difference.hashes[0] or None,
        "new_hash": difference.hashes[1] or None,
    }
