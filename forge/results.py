"""The build and install folders as wholes: their markers, and what forge remembers of an install tree."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge.errors import Place, Problem, WorkspaceError
from forge.files import read_file, read_text, write_if_changed
from forge.prefixes import LAYOUT_MARKER
from forge.shells import SHELLS

if TYPE_CHECKING:
    from forge.layout import Layout

STATE = ".forge.json"
BEFORE = ".forge_before"
"""In the install folder, what was installed of packages that are being built: it moves there at once."""

_BUILDERS = ("colcon", "forge")


def begin_workspace(layout: Layout) -> None:
    """Make the build and install folders with their markers, which colcon shares with forge.

    Raises WorkspaceError when a folder cannot be made, belongs to another tool, or has the other layout.
    """
    problems = []
    for check in (_begin_build, _begin_install):
        try:
            problem = check(layout)
        except OSError as error:
            hint = "choose other folders with '--build-base' and '--install-base', or make them writable"
            problem = Problem(f"cannot make '{error.filename}': {error.strerror}", hint=hint)
        if problem:
            problems.append(problem)
    if problems:
        raise WorkspaceError(*dict.fromkeys(problems))


def foreign_build(layout: Layout) -> Problem | None:
    """Return what is to be said of a build folder in which another tool has built."""
    marker = layout.build / ".built_by"
    builder = read_text(marker).strip() if marker.exists() else None
    if builder in {None, *_BUILDERS}:
        return None
    hint = "remove the folder, or choose another with '--build-base'"
    return Problem(f"the build folder '{layout.build}' belongs to '{builder}'", hint=hint)


def other_layout(layout: Layout) -> Problem | None:
    """Return what is to be said of an install folder that is shared the other way."""
    marker = layout.install / LAYOUT_MARKER
    word = read_text(marker).strip() if marker.exists() else None
    if word in {None, layout.word}:
        return None
    change = "remove '--merge-install'" if layout.merged else "add '--merge-install'"
    return Problem(
        f"the install folder '{layout.install}' has the {word} layout, not the {layout.word} one",
        hint=f"{change}, remove the folder, or choose another with '--install-base'",
    )


def recorded_underlays(root: Path) -> tuple[Path, ...]:
    """Return the underlays that the last build of an install tree recorded, lowest first."""
    return _recorded(root)[1]


def forget_underlays(root: Path) -> None:
    """Let an install tree be built as if it had been built on nothing before."""
    (root / STATE).unlink(missing_ok=True)


def recorded_python(root: Path) -> str | None:
    """Return the interpreter that an install tree was last built for, if there is a record and a file."""
    python = _recorded(root)[0]
    return python if python and Path(python).exists() else None


def _recorded(root: Path) -> tuple[str | None, tuple[Path, ...]]:
    """Return the interpreter and the underlays of the last build."""
    try:
        state = json.loads(read_file(root / STATE))
        return str(state["python"]), tuple(map(Path, state["underlays"]))
    except OSError:  # what cannot be read cannot be written either: begin_workspace tells
        return None, ()
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        problem = Problem(
            "this is no state of forge", Place(root / STATE), hint="remove the file and build again"
        )
        raise WorkspaceError(problem) from error


def workspace_scripts(root: Path) -> list[str]:
    """Return what an install tree has beside its packages: forge's state and the scripts to source."""
    scripts = (f"{root}/{name}.{shell}" for name in ("setup", "local_setup") for shell in SHELLS)
    return [f"{root}/{STATE}", *scripts]


def remove_file(path: Path, root: Path) -> None:
    """Remove a file and the folders that this leaves empty, up to but not including `root`."""
    path.unlink(missing_ok=True)
    for folder in path.parents:
        if folder == root:
            break
        try:
            folder.rmdir()
        except OSError:
            break


def _begin_build(layout: Layout) -> Problem | None:
    """Make the build folder, unless another tool has built there."""
    problem = foreign_build(layout)
    if problem:
        return problem
    _make_ignored(layout.build)
    write_if_changed(layout.build / ".built_by", "colcon\n")
    return None


def _begin_install(layout: Layout) -> Problem | None:
    """Make the install folder, unless it is shared the other way."""
    if layout.install.exists() and not layout.install.is_dir():
        hint = "remove it, or choose another with '--install-base'"
        return Problem(f"the install folder '{layout.install}' is a file", hint=hint)
    problem = other_layout(layout)
    if problem:
        return problem
    _make_ignored(layout.install)
    write_if_changed(layout.install / LAYOUT_MARKER, f"{layout.word}\n")
    return None


def _make_ignored(folder: Path) -> None:
    """Make a folder in which nobody looks for packages."""
    folder.mkdir(parents=True, exist_ok=True)
    marker = folder / "COLCON_IGNORE"
    if not os.path.lexists(marker):
        marker.touch()
