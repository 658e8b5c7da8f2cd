"""Reads forge.toml, the settings of a workspace: options for commands, profiles and packages."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from forge.base.errors import Location, Problem, WorkspaceError
from forge.base.files import read_file
from forge.base.formats import read_toml

FORGE_TOML = "forge.toml"


def read_forge_toml(root: Path) -> dict[str, Any]:
    """Return the contents of a workspace's forge.toml; raises WorkspaceError if it is malformed."""
    path = root / FORGE_TOML
    return read_toml(read_file(path), path) if path.exists() else {}


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
