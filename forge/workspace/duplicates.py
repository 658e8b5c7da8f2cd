"""Reports packages with the same name, by the folders that contain them a second time."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path

from forge.base.errors import Location, Problem
from forge.base.layout import IGNORE_MARK
from forge.base.text import listed
from forge.workspace.model import Workspace

_FEW = 5


def clashes(workspace: Workspace, names: Collection[str]) -> Iterator[Problem]:
    """Yield a problem for each folder that contains packages of `names` which are also elsewhere."""
    paths: dict[str, list[Path]] = {}
    for other in workspace.duplicates:
        if other.name in names:
            paths.setdefault(other.name, [workspace.packages[other.name].path]).append(other.path)
    # What is not below 'src', or deeper, is probably the copy.
    kept = {
        name: min(found, key=lambda path: (path.parts[:1] != ("src",), len(path.parts), path))
        for name, found in paths.items()
    }
    copies = [(name, path) for name, found in paths.items() for path in found if path != kept[name]]
    groups: dict[tuple[Path, Path], list[tuple[str, Path]]] = {}
    for name, path in copies:
        # The copies of folders with the same contents below are one group.
        first, second = kept[name], path
        while first.parts and second.parts and first.name == second.name:
            first, second = first.parent, second.parent
        groups.setdefault((first, second), []).append((name, path))
    tops = {top for pair in groups for top in pair}
    if len(tops) > 1 and all(top != Path() and (workspace.root / top / "src").is_dir() for top in tops):
        quoted = listed(sorted(paths), _FEW)
        message = f"this folder contains {len(tops)} workspaces with packages of the same names: {quoted}"
        yield Problem(message, hint=f"change to one of them: cd {min(tops)}")
        return
    others = {path for _, path in copies}
    every = (*workspace.packages.values(), *workspace.duplicates)
    manifests = {package.path: package.manifest.path for package in every}
    for (top, copy), found in groups.items():
        name, path = found[0]
        near = f"'{path}/{IGNORE_MARK}'"
        only_copies = all(path in others for path in manifests if path.is_relative_to(copy))
        if only_copies and copy != Path():
            near = f"'{copy}/{IGNORE_MARK}'"
        worktree = (workspace.root / copy / ".git").is_file()
        why = f"'{copy}' is another checkout of a repository: " if worktree else ""
        hint = f"{why}rename one, or ignore one by creating an empty file {near}"
        if len(found) == 1:
            message = f"two packages are named '{name}': '{kept[name]}' and '{path}'"
            yield Problem(message, Location(manifests[path]), hint)
        else:
            quoted = listed([name for name, _ in found], _FEW)
            message = f"{len(found)} packages are in '{top}' and again in '{copy}': {quoted}"
            yield Problem(message, Location(copy), hint)
