"""Answers the completion scripts of shells: `python -S -E words.py KIND [WORD ...]`.

With `complete` or `describe`, the words are the command line after `forge`, and stdin contains the
table of `forge.plugins.completion.command`. All other kinds print names.

Shells start this program for each completion, so it imports as little as possible, and most modules only for
the kinds that need them.
"""

from __future__ import annotations

import json
import os
import re
import sys
from contextlib import suppress
from itertools import chain

if __name__ == "__main__":
    # Import from the parent folder of the package: its modules would shadow others.
    sys.path[0] = os.path.abspath(f"{__file__}/../../../..")

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from forge.workspace.root import find_install, find_root, is_root
from forge.workspace.source_names import folders_to_search

_IGNORED = frozenset({"COLCON_IGNORE", "AMENT_IGNORE", "CATKIN_IGNORE"})
_KINDS = ("package.xml", "CMakeLists.txt", "pyproject.toml", "setup.py")
_NAME = re.compile(
    rb"<name>\s*([^<\s]+)\s*</name>|^\s*project\s*\(\s*\"?([\w-]+)", re.MULTILINE | re.IGNORECASE
)
_TYPED = re.compile(r"\w[\w.+/-]*")
_INDEX = "share/ament_index/resource_index"
_INTERFACES = ("msg", "srv", "action")


def main(words: Sequence[str], variables: Mapping[str, str]) -> int:
    """Print candidates, names, or the root of the workspace, one per line."""
    lines: Iterable[str]
    if words[:1] == ["root"]:
        root = find_root(Path.cwd(), Path.home())
        lines = (str(root),) if is_root(root) else ()
    elif words[:1] in (["complete"], ["describe"]):
        candidates = _candidates(json.load(sys.stdin), words[1:-1], words[-1], variables)
        described = words[0] == "describe"
        lines = (f"{word}\t{summary}" if described and summary else word for word, summary in candidates)
    else:
        lines = _safe_names(words, variables)
    for line in lines:
        sys.stdout.write(f"{line}\n")
    return 0


def _candidates(
    table: Mapping[str, Any], words: Sequence[str], current: str, variables: Mapping[str, str]
) -> Iterator[tuple[str, str]]:
    """Yield the possible next words, each with a summary; shells expand '@folders' and '@files'."""
    path, argument = "", ""
    expected: Sequence[str] = ()
    """Whether the preceding option takes one, many or passed-on values, their kind, and more words."""
    for word in words:
        context = table[path]
        number = expected[0] if expected else ""
        if word.startswith("-"):
            if number != "passed" or word.partition("=")[0] in context["ends"]:
                expected = context["options"].get(word, [""])[1:]
        elif number == "one":
            expected = ()
        elif not number and word in context["words"]:
            path = f"{path} {word}".strip()
        elif not number:
            argument = word
    context = table[path]
    kind, *more = (expected or context["rest"])[1:] or ("anything",)
    if kind == "runnable" and argument:
        kind, more = "executables", [argument]
    values = {"words": more, "folders": ["@folders"], "files": ["@files"]}.get(kind)
    yield from (
        (value, "") for value in (_safe_names((kind, *more), variables) if values is None else values)
    )
    if expected[:1] == ["one"]:
        return
    passed = expected[:1] == ["passed"]
    yield from () if passed else context["words"].items()
    for option, (summary, *_) in context["options"].items() if current.startswith("-") else ():
        if summary is not None and (not passed or option in context["ends"]):
            yield option, summary


def _safe_names(words: Sequence[str], variables: Mapping[str, str]) -> list[str]:
    """Return the sorted names of a kind that shells can insert unquoted."""
    return sorted(name for name in set(_names(words, variables)) if _TYPED.fullmatch(name))


def _names(words: Sequence[str], variables: Mapping[str, str]) -> Iterator[str]:
    names: Iterator[str]
    match list(words):
        case ["packages", *_]:
            names = package_names(str(find_root(Path.cwd(), Path.home())))
        case ["installed", *_]:
            names = (
                name for prefix in _prefixes(variables) for name in _files(f"{prefix}/{_INDEX}/packages")
            )
        case ["runnable", *_]:
            from forge.environment.prefixes import PACKAGES, package_prefixes

            # Packages without ament are found only in the enclosing workspace.
            install = find_install(Path.cwd(), Path.home())
            own = (
                _files(f"{prefix}/{PACKAGES}") for prefix in (package_prefixes(install) if install else ())
            )
            names = chain(_names(["installed"], variables), *own)
        case ["executables", package, *_]:
            names = _executables(package, variables)
        case ["interface_packages", *_]:
            names = (folder.rpartition("/")[2] for folder in _interface_folders(variables))
        case ["interfaces", *_]:
            names = (name for folder in _interface_folders(variables) for name in _interfaces(folder))
        case ["mixins", verb, *_]:
            _add_site_packages()
            from forge.base.extensions import OPTIONS, find

            plugin = find(OPTIONS, "mixin", "option")
            mixins = plugin.read_mixins(plugin.mixin_folders(variables))
            names = (name for command, name in mixins if command == verb)
        case ["repositories", *_]:
            _add_site_packages()
            from forge.base.env_vars import home
            from forge.base.extensions import OPTIONS, find
            from forge.base.files import text_or_nothing
            from forge.base.formats import read_yaml

            path = home(variables) / find(OPTIONS, "mixin", "option").REPOSITORIES
            names = map(str, read_yaml(text_or_nothing(path), path))
        case ["profiles", *_]:
            _add_site_packages()
            from forge.workspace.forge_toml import FORGE_TOML, PROFILES, read_forge_toml, table_of

            root = find_root(Path.cwd(), Path.home())
            names = iter({**table_of(read_forge_toml(root), "profiles", root / FORGE_TOML), **PROFILES})
        case _:
            names = iter(())
    return names


def package_names(root: str) -> Iterator[str]:
    """Yield the names of the packages of a workspace; skip ignored folders, follow links."""
    for folder, entries in folders_to_search(root):
        if not entries.keys().isdisjoint(_IGNORED):
            entries.clear()
        kind = next((kind for kind in _KINDS if kind in entries), None)
        if kind is None:
            continue
        entries.clear()
        match = None
        if not kind.endswith((".py", ".toml")):
            with suppress(OSError), open(f"{folder}/{kind}", "rb") as stream:
                match = _NAME.search(stream.read())
        yield (match[1] or match[2]).decode(errors="replace") if match else os.path.basename(folder)


def _prefixes(variables: Mapping[str, str]) -> tuple[Path, ...]:
    from forge.environment.installed import known_prefixes

    return known_prefixes(variables, find_install(Path.cwd(), Path.home()))


def _executables(package: str, variables: Mapping[str, str]) -> Iterator[str]:
    """Yield the programs of a package; those of a package without ament may be in bin."""
    from forge.environment import installed

    install = find_install(Path.cwd(), Path.home())
    for prefix in _prefixes(variables):
        yield from (path.name for path in installed.executables(package, prefix))
    if not installed.is_registered(package, variables, install) and (
        plain := installed.unregistered_prefix(package, install)
    ):
        yield from (path.name for path in installed.plain_executables(package, plain))


def _interface_folders(variables: Mapping[str, str]) -> Iterator[str]:
    """Yield the folders with definitions of all packages: installed ones and those that forge embeds."""
    for prefix in _prefixes(variables):
        yield from (f"{prefix}/share/{name}" for name in _files(f"{prefix}/{_INDEX}/rosidl_interfaces"))
    embedded = os.path.abspath(f"{__file__}/../../../embedded")
    for name in _files(embedded):
        if any(_files(f"{embedded}/{name}/{kind}") for kind in _INTERFACES):
            yield f"{embedded}/{name}"


def _interfaces(folder: str) -> Iterator[str]:
    """Yield the full names of the interfaces in a folder, without requests and responses of services."""
    package = folder.rpartition("/")[2]
    for kind in _INTERFACES:
        for file in _files(f"{folder}/{kind}"):
            name, _, ending = file.rpartition(".")
            if ending in {kind, "idl"} and "_" not in name:
                yield f"{package}/{kind}/{name}"


def _add_site_packages() -> None:
    """Make the parsers of YAML and TOML importable; without them, this program starts faster."""
    if sys.flags.no_site:
        import site

        site.main()


def _files(folder: str) -> list[str]:
    try:
        return [name for name in os.listdir(folder) if not name.startswith(".")]
    except OSError:
        return []


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:], os.environ))
