"""What the environment says about forge itself; names are colcon's, or ours with FORGE_ in front."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping


def setting(name: str, variables: Mapping[str, str]) -> str | None:
    """Return the value of FORGE_`name`, else of COLCON_`name`; None when neither says anything."""
    return variables.get(f"FORGE_{name}") or variables.get(f"COLCON_{name}") or None


def home(variables: Mapping[str, str]) -> Path:
    """Return the folder of the user's own settings, which forge shares with colcon."""
    return Path(setting("HOME", variables) or "~/.colcon").expanduser()


def cache_home(variables: Mapping[str, str]) -> Path:
    """Return the folder of what forge keeps for other builds: it may be removed at any time."""
    named = variables.get("FORGE_CACHE_DIR")
    if named:
        return Path(named).expanduser().absolute()
    return Path(variables.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "forge"
