"""Reads the install scripts that CMake generates: the files that they copy, and their destinations.

A build folder has a `cmake_install.cmake` for each of its source folders, with a block for each call of
install(). Only code that CMake itself generates is understood here. Scripts with code of a package, a
destination outside the prefix, or another structure are not analysed.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from forge.base.files import text_or_nothing, tree_below
from forge.base.frozen import Pairs, frozen
from forge.base.text import digest
from forge.build.copies import is_folder
from forge.build.inputs.fingerprints import file_state
from forge.workspace.cmake_text import Call, calls

SCRIPT = "cmake_install.cmake"
_PREFIX = "${CMAKE_INSTALL_PREFIX}"
_BLOCK = re.compile(
    r"^if\([^\n]*CMAKE_INSTALL_COMPONENT[^\n]* OR NOT CMAKE_INSTALL_COMPONENT\)\n(.*?)^endif\(\)\n",
    re.M | re.S,
)
_AROUND = frozenset({"else", "endif", "if", "include", "message", "set", "string", "unset"})
"""The commands outside of blocks, except those that write a manifest."""
_IN_BLOCKS = frozenset({"else", "endforeach", "endif", "foreach", "if", "message", "string", "unset"})
_FILE = frozenset({"DIFFERENT", "GLOB", "REMOVE", "RPATH_CHANGE", "RPATH_CHECK", "RPATH_REMOVE", "RPATH_SET"})
"""Operations of file() on installed files in blocks, besides INSTALL."""
_STRIP = "CMAKE_INSTALL_DO_STRIP"
_INSTALLED = "$ENV{DESTDIR}${CMAKE_INSTALL_PREFIX}/"
_STATE = re.compile(
    r"\$?\{?(CMAKE_INSTALL_DO_STRIP|CMAKE_INSTALL_CONFIG_NAME|_cmake_\w+|EXPORT_FILE_CHANGED|OLD_CONFIG_FILES)\b.*"
)


@frozen
class InstallRule:
    """A call of file(INSTALL): the folder below the prefix, the installed files, and the whole block.

    `sources` are absolute paths; if one ends with '/', its contents are installed. `name` renames a single
    file. `options` are the other arguments; `is_copy` is True if the files are only copied; some may be
    excluded.
    """

    folder: str
    kind: str
    sources: tuple[str, ...]
    name: str
    options: tuple[str, ...]
    is_copy: bool
    block: str


class InstalledEntry(NamedTuple):
    """One installed path: the rule that installs it, its source, and the stat of the source as text."""

    rule: InstallRule
    source: str
    state: str


@frozen
class InstallScripts:
    """All rules of a build folder, the digest of its scripts, and the beginning of the first one.

    The rules are None if some of them are unknown.
    """

    rules: tuple[InstallRule, ...] | None
    digest: str
    prologue: str


def read_install_scripts(build: Path) -> InstallScripts:
    """Return the files that the scripts of a build folder install."""
    rules: list[InstallRule] | None = []
    read, prologue = hashlib.blake2b(digest_size=16), None
    waiting = [f"{build}/{SCRIPT}"]
    for path in waiting:
        text = text_or_nothing(path, errors="surrogateescape")
        read.update(text.encode(errors="surrogateescape"))
        around, blocks = _BLOCK.sub("", text), _BLOCK.finditer(text)
        prologue = text[: first.start()] if prologue is None and (first := _BLOCK.search(text)) else prologue
        included = _included(around, build)
        rule_lists = [_rules(block[0], block[1]) for block in blocks]
        waiting += included or ()
        if included is None or None in rule_lists:
            rules = None
        if rules is not None:
            rules += (rule for each in rule_lists for rule in each or ())
    return InstallScripts(None if rules is None else tuple(rules), read.hexdigest(), prologue or "")


def _included(text: str, build: Path) -> list[str] | None:
    """Return the scripts that a script includes, or None if it contains unknown commands."""
    included = []
    for call in _all_calls(text):
        match call and (call.command, *call.words):
            case ("include", path) if path.startswith(f"{build}/") and path.endswith(f"/{SCRIPT}"):
                included.append(path)
            case ("file", "WRITE", path, "${CMAKE_INSTALL_MANIFEST_CONTENT}") if path.startswith(f"{build}/"):
                pass
            case (command, *_) if command in _AROUND - {"include"}:
                pass
            case _:
                return None
    return included


def _rules(block: str, body: str) -> list[InstallRule] | None:
    """Return the rules of a block; None if it may contain code of the package.

    A block that changes files without installing any would change those of other blocks.
    """
    rules: list[InstallRule] = []
    every = [*_all_calls(body)]
    for call in every:
        if call is None:
            return None
        match call.command, call.words:
            case "file", ("INSTALL", *words):
                rule = _rule(words, block, is_copy=len(every) == 1)
                if rule is None:
                    return None
                rules.append(rule)
            case "file", (action, *_) if action in _FILE:
                pass
            case "execute_process", _ if _STRIP in call.conditions:
                pass
            case "if", words if not _is_generated(words):
                return None
            case command, _ if command not in _IN_BLOCKS:
                return None
    return rules if rules or all(call and call.command in _IN_BLOCKS for call in every) else None


def _is_generated(condition: tuple[str, ...]) -> bool:
    """Return whether a condition was generated by CMake: about installed files or its own state."""
    terms: list[list[str]] = [[]]
    for word in condition:
        if word == "AND":
            terms.append([])
        elif word != "NOT":
            terms[-1].append(word)
    for term in terms:
        match term:
            case ("EXISTS" | "IS_SYMLINK", path) if path.startswith(_INSTALLED) or path == "${file}":
                pass
            case (word,) | (word, "MATCHES", _) if _STATE.fullmatch(word):
                pass
            case _:
                return False
    return True


def _rule(words: list[str], block: str, *, is_copy: bool) -> InstallRule | None:
    match words:
        case ("DESTINATION", folder, "TYPE", kind, *rest) if folder.startswith(_PREFIX) and "FILES" in rest:
            at = rest.index("FILES")
            options, files = rest[:at], rest[at + 1 :]
        case _:
            return None
    count = next((number for number, word in enumerate(files) if not word.startswith("/")), len(files))
    sources, patterns = files[:count], files[count:]
    name = options[options.index("RENAME") + 1] if "RENAME" in options else ""
    below = folder.removeprefix(_PREFIX).strip("/")
    if any("$" in word or "\\" in word for word in (below, name, *sources)) or (name and len(sources) != 1):
        return None
    options = [word for word in options if word not in {"RENAME", name}]
    excludes = all(word in {"REGEX", "EXCLUDE"} for word in (*patterns[::3], *patterns[2::3]))
    is_copy &= excludes and len(patterns) % 3 == 0
    return InstallRule(below, kind, tuple(sources), name, tuple(options), is_copy, block)


def _all_calls(text: str) -> Iterator[Call | None]:
    """Yield the calls, and finally None if some text is not a call."""
    ended = 0
    for call in calls(f"{text}\nend()"):
        ended = call.command == "end"
        if not ended:
            yield call
    if not ended:
        yield None


def installed_entries(rules: Iterable[InstallRule]) -> Mapping[str, InstalledEntry] | None:
    """Return the installed entry of each path below the prefix; folders are expanded.

    None if a source is missing, or if two rules install to the same path: then their order decides.
    """
    by_path: dict[str, InstalledEntry] = {}
    for rule in rules:
        for source in rule.sources:
            name = rule.name or os.path.basename(source)
            top = "/".join(filter(None, (rule.folder, name)))
            if not os.path.lexists(source):
                return None
            entries: list[tuple[str, str, os.stat_result | None]] = [(top, source, None)]
            if rule.kind == "DIRECTORY" and os.path.isdir(source):
                files, empty = tree_below(source.rstrip("/"))
                start = len(source.rstrip("/")) + 1
                below = (*files, *((path, None) for path in empty))
                entries = [
                    ("/".join(filter(None, (top, path[start:]))), path, status) for path, status in below
                ]
            for path, each, status in entries:
                if path in by_path:
                    return None
                by_path[path] = InstalledEntry(rule, each, file_state(each, status))
    return by_path


def folder_modes(rules: Iterable[InstallRule]) -> Mapping[str, int]:
    """Return the mode of each folder whose mode is installed, regardless of its contents."""
    return {
        folder: os.stat(folder).st_mode
        for rule in rules
        if rule.kind == "DIRECTORY" and "USE_SOURCE_PERMISSIONS" in rule.block
        for source in rule.sources
        for folder, _, _ in os.walk(source)
    }


def partial_install(
    build: Path, variables: Pairs, before: Mapping[str, Any]
) -> tuple[dict[str, Any], str | None]:
    """Return notes about what a build folder installs, and CMake code that installs only what has changed.

    `before` are the notes of the last installation, with the installed files and folders. Instead of code,
    return None if everything has to be installed. Of the notes, `scripts` identifies the install scripts and
    the `variables` of the step, and `code` says whether the scripts run code of the package.
    """
    scripts = read_install_scripts(build)
    entries = installed_entries(scripts.rules) if scripts.rules is not None else None
    identity = digest(scripts.digest, *map("=".join, variables))
    now: dict[str, Any] = {"scripts": identity, "code": scripts.rules is None}
    if entries is None or scripts.rules is None:
        return now, None
    now["sources"] = {path: entry.state for path, entry in entries.items()}
    now["modes"] = folder_modes(scripts.rules)
    changed = _changed(before, now)
    return now, None if changed is None else "".join((scripts.prologue, *_calls_for(changed, entries)))


def _changed(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str] | None:
    """Return the installed paths whose sources have changed; None if anything else may be different."""
    then, current = before.get("sources"), now["sources"]
    if not (then and current) or before["scripts"] != now["scripts"] or then.keys() != current.keys():
        return None
    if before.get("modes") != now["modes"]:
        return None
    # Excluded files were not installed either.
    installed = {*before["files"], *(folder.rstrip("/") for folder in before["folders"])}
    if not installed <= current.keys():  # such as a link to a folder, which is installed as a link
        return None
    return [path for path, state in current.items() if then[path] != state and path in installed]


def _calls_for(changed: Iterable[str], entries: Mapping[str, InstalledEntry]) -> Iterator[str]:
    """Yield the CMake code that installs some files; rules other than plain copies keep their block."""
    blocks = dict[str, None]()
    for path in changed:
        rule, source = entries[path].rule, entries[path].source
        if not rule.is_copy or rule.options or rule.kind not in {"FILE", "DIRECTORY"}:
            blocks[rule.block] = None
            continue
        folder, _, name = path.rpartition("/")
        renamed = f' RENAME "{name}"' if rule.name else ""
        where = f'"${{CMAKE_INSTALL_PREFIX}}/{folder}"'
        kind = "DIRECTORY" if is_folder(source) else "FILE"
        yield f'file(INSTALL DESTINATION {where} TYPE {kind}{renamed} FILES "{source}")\n'
    yield from blocks
