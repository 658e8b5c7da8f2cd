"""The state that a build records in the install folder: its interpreter, underlays and ROS distribution."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

from forge.base.files import read_file, text_or_nothing
from forge.base.frozen import frozen
from forge.base.layout import INSTALL_STATE_FILE, LAYOUT_MARKER

_SOURCED = re.compile(r'^ *COLCON_CURRENT_PREFIX="(/(?:[^"\\]|\\.)*)"$', re.MULTILINE)
"""The lines of a setup.sh written by colcon or forge that name its underlays, lowest first."""


@frozen
class InstallState:
    """The recorded state; empty before the first build. The interpreter may have been removed."""

    python: str | None = None
    underlays: tuple[Path, ...] = ()
    rosdistro: str | None = None
    profile: str = ""
    root: str = os.pardir
    """The root of the workspace, relative to the install tree."""


def recorded_underlays(root: Path) -> tuple[Path, ...]:
    """Return the recorded underlays of an install tree, lowest first, without its own overlays."""
    return tuple(path for path in recorded_state(root).underlays if not is_built_on(path, root))


def recorded_overlays(root: Path) -> tuple[Path, ...]:
    """Return the recorded underlays of an install tree that were built on it, which would form a cycle."""
    return tuple(path for path in recorded_state(root).underlays if is_built_on(path, root))


def is_built_on(overlay: Path, root: Path) -> bool:
    """Return whether an install tree is `root`, or was built on it directly or indirectly."""
    waiting, seen = [os.path.realpath(overlay)], set[str]()
    while waiting:
        path = waiting.pop()
        if path not in seen:
            seen.add(path)
            waiting += map(os.path.realpath, underlays_of(Path(path)))
    return os.path.realpath(root) in seen


def underlays_of(root: Path) -> tuple[Path, ...]:
    """Return the underlays of any install tree as recorded by forge, else as sourced by colcon's script."""
    if (root / INSTALL_STATE_FILE).is_file():
        return recorded_state(root).underlays
    # Other tools also write a setup.sh; only colcon's prefixes have this marker.
    return _sourced(root) if (root / LAYOUT_MARKER).is_file() else ()


def forget_underlays(root: Path) -> None:
    (root / INSTALL_STATE_FILE).unlink(missing_ok=True)


def recorded_python(root: Path) -> str | None:
    """Return the recorded interpreter of an install tree if it exists."""
    python = recorded_state(root).python
    return python if python and Path(python).exists() else None


def python_of(prefix: Path) -> str | None:
    """Return the recorded interpreter of the install tree around the prefix of a package."""
    return recorded_python(prefix) or recorded_python(prefix.parent)


def recorded_state(root: Path) -> InstallState:
    try:
        state = json.loads(read_file(root / INSTALL_STATE_FILE))
        underlays = tuple(map(Path, state["underlays"]))
        return InstallState(
            str(state["python"]),
            underlays,
            state.get("rosdistro"),
            state.get("profile", ""),
            state.get("root", os.pardir),
        )
    except OSError:  # begin_workspace reports inaccessible files
        return InstallState()
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        # The next build replaces a damaged file; the script also names the underlays.
        return InstallState(underlays=_sourced(root))


def _sourced(root: Path) -> tuple[Path, ...]:
    underlay_paths = _SOURCED.findall(text_or_nothing(root / "setup.sh"))
    return tuple(Path(re.sub(r"\\(.)", r"\1", path)) for path in underlay_paths)
