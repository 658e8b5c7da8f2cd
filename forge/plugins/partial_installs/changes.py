"""Derive from CMake's install scripts which files an install step has to install again."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from forge.base.frozen import Pairs
from forge.base.text import digest
from forge.build.copies import is_folder
from forge.plugins.partial_installs.install_scripts import (
    InstalledEntry,
    folder_modes,
    installed_entries,
    read_install_scripts,
)


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
