"""Environment variables that configure forge: FORGE_* and colcon's COLCON_*."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path

from forge.base.files import writable_by_others

_SECRET = frozenset({"FORGE_CACHE_TOKEN", "FORGE_REMOTE_CACHE"})
"""Variables that may contain credentials, which only forge needs."""

SEQUENTIAL = "sequential"
EXECUTORS = ("parallel", SEQUENTIAL)

_USER = re.compile(r"(?<=://)[^/\s]*@")


def expand_home(path: str) -> Path:
    """Return a path with the home folder in place of '~'; like a shell, keep the name of an unknown user."""
    return Path(os.path.expanduser(path))  # noqa: PTH111  (which raises RuntimeError for an unknown user)


def setting(name: str, variables: Mapping[str, str]) -> str | None:
    """Return the value of FORGE_`name`, else of COLCON_`name`, else None."""
    return variables.get(f"FORGE_{name}") or variables.get(f"COLCON_{name}") or None


def default_executor(executors: tuple[str, ...]) -> str:
    """Return the executor that the environment selects if it is one of these, else the first."""
    name = setting("DEFAULT_EXECUTOR", os.environ)
    return name if name and name in executors else executors[0]


def home(variables: Mapping[str, str]) -> Path:
    """Return the folder of the user's settings, shared with colcon."""
    return Path(setting("HOME", variables) or "~/.colcon").expanduser()


def cache_home(variables: Mapping[str, str]) -> Path:
    """Return the cache folder, whose contents may be removed at any time."""
    named = variables.get("FORGE_CACHE_DIR")
    if named:
        return Path(named).expanduser().absolute()
    return Path(variables.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "forge"


def own_cache(variables: Mapping[str, str]) -> Path | None:
    """Return the user's private cache folder, None without a home folder or if other users can write to it.

    Its contents are executed and trusted, so it is never in FORGE_CACHE_DIR, which several users may share.
    """
    try:
        cache = Path(variables.get("XDG_CACHE_HOME") or "~/.cache").expanduser()
        if (cache / "forge").exists() and writable_by_others((cache / "forge").stat()):
            return None
    except (RuntimeError, OSError):
        return None
    return cache / "forge" if cache.is_absolute() else None


def compiled_templates(variables: Mapping[str, str], other: Path) -> tuple[Path, ...]:
    """Return the folders for compiled templates: the user's cache, else the folder `other` of one build."""
    own = own_cache(variables)
    return (own / "templates", other) if own else (other,)


def without_secrets(variables: Mapping[str, str]) -> dict[str, str]:
    """Return the environment for code of packages, without credentials."""
    return {name: value for name, value in variables.items() if name not in _SECRET}


def without_passwords(word: str) -> str:
    """Return a command-line argument without the user information of URLs."""
    return _USER.sub("...@", word)
