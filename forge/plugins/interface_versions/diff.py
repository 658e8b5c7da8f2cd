"""compare two versions of interfaces: serialized bytes, hash and API"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path

from forge.base.errors import Problem, SelectionError
from forge.base.frozen import frozen
from forge.base.options import flag, option, options_of
from forge.cli.commands.interface.inputs import IncludeOptions, known_library
from forge.interfaces.read.sources import definition_files
from forge.plugins.interface_versions.comparison import (
    API,
    ASPECTS,
    HASH,
    WIRE,
    Difference,
    compare,
    version_of,
)
from forge.plugins.interface_versions.versions import catalogs_in, opened
from forge.workspace.discovery import discover
from forge.workspace.root import find_root

_IN_WORDS = {WIRE: "the wire", HASH: "the hash", API: "the API"}


@frozen
class Options:
    EPILOG = (
        "A version is a folder (of a package, a workspace, an install folder) or a revision of git, as in "
        "HEAD~1 or v1.2.0:src/my_msgs. The exit code is 1 if an interface breaks what --fail-on names."
    )
    old: str = option("the old version", positional=True, metavar="OLD")
    new: str = option(
        "the new version (default: this folder)", default=".", positional=True, nargs="?", metavar="NEW"
    )
    package: str | None = option("compare only the interfaces of this package", metavar="NAME")
    fail_on: tuple[str, ...] = option(
        "what must not break: wire, hash, api, or none (default: all)",
        default=ASPECTS,
        nargs="+",
        choices=(*ASPECTS, "none"),
    )
    json: bool = flag("print one JSON object")
    others: IncludeOptions = options_of(IncludeOptions)


def run(options: Options) -> int:
    """Print the differences; returns 1 if something broke that must not."""
    library = known_library(options.others.rosdistro, {**_workspace(), **options.others.folders})
    with ExitStack() as stack:
        versions = [
            version_of(catalogs_in(*stack.enter_context(opened(text)), library, options.package))
            for text in (options.old, options.new)
        ]
    old, new = versions
    if not (old.interfaces or new.interfaces):
        what = f"package '{options.package}' with interfaces" if options.package else "interfaces"
        hint = "name folders with packages that have folders msg, srv or action"
        raise SelectionError(Problem(f"found no {what} in '{options.old}' or '{options.new}'", hint=hint))
    differences = compare(old, new)
    if options.json:
        print(json.dumps(_as_json(differences), indent=1))
    else:
        for each in differences:
            print(_heading(each))
            if all(each.hashes):
                print("".join(f"  {change.text}\n" for change in each.changes), end="")
        total = len(old.interfaces.keys() | new.interfaces.keys())
        print(_summary(differences, total))
    return int(any(each.breaks & {*options.fail_on} for each in differences))


def _workspace() -> dict[str, Path]:
    """Return the packages with interfaces of the enclosing workspace, which need not be built."""
    found = discover(find_root(Path.cwd(), Path.home()), ["."], os.environ)
    folders = {name: found.root / each.path for name, each in found.packages.items()}
    return {name: folder for name, folder in folders.items() if definition_files(folder)}


def _heading(difference: Difference) -> str:
    if not difference.hashes[0]:
        return f"{difference.name}: new"
    if not difference.hashes[1]:
        return f"{difference.name}: removed"
    return f"{difference.name}: {_effect(difference)}"


def _effect(difference: Difference) -> str:
    broken = [_IN_WORDS[each] for each in ASPECTS if each in difference.breaks]
    if not broken:
        return "keeps the wire, the hash and the API"
    return f"breaks {', '.join(broken[:-1])}{' and ' if broken[1:] else ''}{broken[-1]}"


def _summary(differences: Iterable[Difference], total: int) -> str:
    counts = {each: sum(each in one.breaks for one in differences) for each in ASPECTS}
    broken = ", ".join(f"{count} break {_IN_WORDS[each]}" for each, count in counts.items() if count)
    changed = sum(1 for _ in differences)
    if not changed:
        return f"no difference in {total} interfaces"
    return f"{changed} of {total} interfaces differ: {broken or 'nothing breaks'}"


def _as_json(differences: Iterable[Difference]) -> dict[str, object]:
    return {
        str(each.name): {
            "breaks": [aspect for aspect in ASPECTS if aspect in each.breaks],
            "changes": [change.text for change in each.changes],
            "old_hash": each.hashes[0] or None,
            "new_hash": each.hashes[1] or None,
        }
        for each in differences
    }
