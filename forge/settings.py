"""What the environment says about forge itself; names are colcon's, or ours with FORGE_ in front."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

_SECRET = frozenset({"FORGE_CACHE_TOKEN", "FORGE_REMOTE_CACHE"})
"""What may be or have a password, which nobody needs but forge itself."""

_USER = re.compile(r"(?<=://)[^/\s]*@")


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


def own_cache(variables: Mapping[str, str]) -> Path | None:
    """Return the folder of what forge keeps for this user alone, if there is a home to have it in.

    What lies there is run and believed, so it is not where FORGE_CACHE_DIR says, which a team may share.
    """
    try:
        cache = Path(variables.get("XDG_CACHE_HOME") or "~/.cache").expanduser()
    except RuntimeError:
        return None
    return cache / "forge" if cache.is_absolute() else None


def compiled_templates(variables: Mapping[str, str], other: Path) -> tuple[Path, ...]:
    """Return where compiled templates may be kept: with the user, else in the folder `other` of one build."""
    own = own_cache(variables)
    return (own / "templates", other) if own else (other,)


def without_secrets(variables: Mapping[str, str]) -> dict[str, str]:
    """Return the environment for code of packages, which is anybody's."""
    return {name: value for name, value in variables.items() if name not in _SECRET}


def without_passwords(word: str) -> str:
    """Return a word of a command line for the eyes of others: URLs do not say who asks."""
    return _USER.sub("...@", word)
