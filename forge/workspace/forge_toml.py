"""Reads forge.toml, the settings of a workspace: options for commands, profiles and packages."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from forge.base.errors import Location, Problem, SelectionError, WorkspaceError
from forge.base.files import read_file
from forge.base.formats import read_toml
from forge.base.names import did_you_mean, is_safe_name

FORGE_TOML = "forge.toml"
_BARE_KEY = re.compile("[A-Za-z0-9_-]+")

PROFILES: Mapping[str, dict[str, Any]] = {
    name: {"build": {"mixin": [name]}} for name in ("debug", "release", "asan", "tsan", "ubsan")
}
"""The profiles of every workspace; a table in forge.toml replaces the profile of this name."""


def read_forge_toml(root: Path) -> dict[str, Any]:
    """Return the contents of a workspace's forge.toml; raises WorkspaceError if it is malformed."""
    path = root / FORGE_TOML
    if not path.exists():
        return {}
    status = path.stat()
    return _content(path, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)


@lru_cache(maxsize=1)
def _content(path: Path, *_state_of_file: int) -> dict[str, Any]:
    """Read a file that several stages of a command ask for."""
    return read_toml(read_file(path), path)


def table_of(content: Mapping[str, Any], key: str, path: Path) -> dict[str, Any]:
    """Return the table `key` of the file `path`; raises WorkspaceError if it is not a table."""
    table = content.get(key)
    if table is None:
        return {}
    if not isinstance(table, dict):
        hint = f"write 'option: value' below '{key}:'"
        if path.suffix == ".toml":
            hint = f"write a table [{key}] of 'option = value'"
        raise WorkspaceError(Problem(f"'{key}' is not a table of options", Location(path), hint))
    return table


def profile_of(content: Mapping[str, Any], name: str, path: Path) -> dict[str, Any]:
    """Return the options of a profile by command; raises SelectionError for an unknown one."""
    profiles = {**PROFILES, **table_of(content, "profiles", path)}
    if not is_safe_name(name):
        hint = "use letters, digits, '.', '_', '+' and '-', since folders are named after profiles"
        raise SelectionError(Problem(f"invalid name of a profile: '{name}'", hint=hint))
    if name not in profiles:
        write = f"write a table [{_table(name)}.build] with the options of its builds into {FORGE_TOML}"
        hint = did_you_mean(name, profiles) or write
        place = Location(path) if path.exists() else None
        raise SelectionError(Problem(f"unknown profile '{name}'", place, hint))
    if not isinstance(profiles[name], dict):
        hint = f"write tables of options, such as [{_table(name)}.build]"
        raise WorkspaceError(Problem(f"the profile '{name}' is not a table", Location(path), hint))
    tables = table_of(profiles, name, path)
    if keys := [key for key, value in tables.items() if not isinstance(value, dict)]:
        message = f"'{keys[0]}' of the profile '{name}' belongs to no command"
        hint = f"write it below [{_table(name)}.build], or below another command"
        if keys[0] in {"build", "test"}:
            message = f"'{keys[0]}' of the profile '{name}' is not a table of options"
            hint = f"write a table [{_table(name)}.{keys[0]}] of 'option = value'"
        raise WorkspaceError(Problem(message, Location(path), hint))
    return tables


def _table(profile: str) -> str:
    """Return the table of a profile as TOML spells it."""
    return f"profiles.{profile if _BARE_KEY.fullmatch(profile) else json.dumps(profile, ensure_ascii=False)}"


def folder_of_profile(base: str, name: str) -> str:
    """Return the folder of a profile, beside the others, because forge owns all in a build folder."""
    return f"{base.rstrip('/')}-{name}"


def install_of_profile(root: Path, name: str) -> str:
    """Return the install folder of a profile relative to the root; raises SelectionError."""
    path = root / FORGE_TOML
    base = table_of(profile_of(read_forge_toml(root), name, path), "build", path).get("install-base")
    return base if isinstance(base, str) else folder_of_profile("install", name)
