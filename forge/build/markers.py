"""Create the build and install folders with the marker files that identify tool and layout."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from forge.base.errors import Problem, WorkspaceError
from forge.base.files import write_if_changed
from forge.base.layout import BUILT_BY, IGNORE_MARK, INSTALL_STATE_FILE, LAYOUT_MARKER
from forge.build.folder_marks import BUILDERS, builder, recorded_layout
from forge.environment.shells import SHELLS

if TYPE_CHECKING:
    from pathlib import Path

    from forge.base.layout import Layout


def create_output_folders(layout: Layout) -> None:
    """Create the build and install folders with the markers that colcon and forge share.

    Raises WorkspaceError if a folder cannot be created, belongs to another tool, or has the other layout.
    """
    problems = []
    if layout.target:
        # The folders around them are marked, too: they identify the workspace and contain no packages.
        _make_ignored(layout.of_host.install)
        write_if_changed(layout.of_host.build / BUILT_BY, "colcon\n")
        _make_ignored(layout.of_host.build)
    for check in (_begin_build, _begin_install):
        try:
            problem = check(layout)
        except OSError as error:
            hint = "choose other folders with '--build-base' and '--install-base', or make them writable"
            problem = Problem(f"cannot create '{error.filename}': {error.strerror}", hint=hint)
        if problem:
            problems.append(problem)
    if problems:
        raise WorkspaceError(*dict.fromkeys(problems))


def foreign_build(layout: Layout) -> Problem | None:
    """Return a problem if the build folder was created by another tool."""
    tool = builder(layout.build)
    if tool in {None, *BUILDERS}:
        return None
    hint = "choose another folder with '--build-base'"
    return Problem(f"the build folder '{layout.build}' was created by '{tool}'", hint=hint)


def other_layout(layout: Layout) -> Problem | None:
    """Return a problem if the install folder has the other layout (merged or isolated)."""
    layout_name = recorded_layout(layout.install)
    if layout_name in {None, layout.word}:
        return None
    change = "remove '--merge-install'" if layout.merged else "add '--merge-install'"
    return Problem(
        f"the install folder '{layout.install}' has the {layout_name} layout, not the {layout.word} one",
        hint=f"{change}, remove the folder, or choose another with '--install-base'",
    )


def workspace_scripts(root: Path) -> list[str]:
    """Return the workspace-level files of an install folder: forge's state file and the setup scripts."""
    scripts = (f"{root}/{name}.{shell}" for name in ("setup", "local_setup") for shell in SHELLS)
    return [f"{root}/{INSTALL_STATE_FILE}", *scripts]


def remove_file(path: Path, root: Path) -> None:
    """Remove a file and its parent folders that become empty, up to but not including `root`."""
    path.unlink(missing_ok=True)
    remove_empty(path.parent, root)


def remove_empty(folder: Path, root: Path) -> None:
    """Remove a folder if it is empty, and parents that become empty, up to but not including `root`."""
    while folder != root:
        try:
            folder.rmdir()
        except FileNotFoundError:
            pass
        except OSError:
            break
        folder = folder.parent


def mark_build_base(build: Path) -> None:
    """Create the build folder of a workspace with its marks."""
    _make_ignored(build)
    write_if_changed(build / BUILT_BY, "colcon\n")


def _begin_build(layout: Layout) -> Problem | None:
    """Create the build folder; return a problem if another tool owns it."""
    problem = foreign_build(layout)
    if problem:
        return problem
    mark_build_base(layout.build)
    return None


def _begin_install(layout: Layout) -> Problem | None:
    """Create the install folder; return a problem if it is a file or has the other layout."""
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
    """Create a folder that package discovery ignores."""
    folder.mkdir(parents=True, exist_ok=True)
    marker = folder / IGNORE_MARK
    if not os.path.lexists(marker):
        marker.touch()
