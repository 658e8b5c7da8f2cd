"""The state that a build records in the install folder: its interpreter, underlays and ROS distribution."""

from __future__ import annotations

import json
from pathlib import Path

from forge.base.errors import Location, Problem, WorkspaceError
from forge.base.files import read_file
from forge.base.frozen import frozen
from forge.base.layout import INSTALL_STATE_FILE


@frozen
class _State:
    """What is recorded; empty before the first build."""

    python: str | None = None
    underlays: tuple[Path, ...] = ()
    rosdistro: str | None = None


def recorded_underlays(root: Path) -> tuple[Path, ...]:
    """Return the recorded underlays of an install tree, lowest first."""
    return _recorded(root).underlays


def forget_underlays(root: Path) -> None:
    """Remove the recorded underlays of an install tree."""
    (root / INSTALL_STATE_FILE).unlink(missing_ok=True)


def recorded_python(root: Path) -> str | None:
    """Return the recorded interpreter of an install tree if it exists."""
    python = recorded_path(root)
    return python if python and Path(python).exists() else None


def recorded_path(root: Path) -> str | None:
    """Return the path of the recorded interpreter of an install tree, which may have been removed."""
    return _recorded(root).python


def python_of(prefix: Path) -> str | None:
    """Return the recorded interpreter of the install tree around the prefix of a package."""
    return recorded_python(prefix) or recorded_python(prefix.parent)


def recorded_rosdistro(root: Path) -> str | None:
    """Return the ROS distribution of the last build of an install tree."""
    return _recorded(root).rosdistro


def _recorded(root: Path) -> _State:
    try:
        state = json.loads(read_file(root / INSTALL_STATE_FILE))
        underlays = tuple(map(Path, state["underlays"]))
        return _State(str(state["python"]), underlays, state.get("rosdistro"))
    except OSError:  # begin_workspace reports inaccessible files
        return _State()
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        problem = Problem(
            "invalid state file", Location(root / INSTALL_STATE_FILE), hint="remove the file and build again"
        )
        raise WorkspaceError(problem) from error
