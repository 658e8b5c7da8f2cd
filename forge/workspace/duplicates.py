"""Reports packages with the same name, by the folders that contain them a second time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import Location, Problem
from forge.base.layout import IGNORE_MARK

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from forge.workspace.model import Workspace

_FEW = 5


def clashes(workspace: Workspace, names: Collection[str]) -> Iterator[Problem]:
    """Yield a problem for each folder that contains packages of `names` which are also elsewhere."""
    paths: dict[str, list[Path]] = {}
    for other in workspace.duplicates:
        if other.name in names:
            paths.setdefault(other.name, [workspace.packages[other.name].path]).append(other.path)
    kept = {name: min(found, key=_likelihood) for name, found in paths.items()}
    copies = [(name, path) for name, found in paths.items() for path in found if path != kept[name]]
    groups: dict[tuple[Path, Path], list[tuple[str, Path]]] = {}
    for name, path in copies:
        groups.setdefault(_tops(kept[name], path), []).append((name, path))
    tops = {top for pair in groups for top in pair}
    if len(tops) > 1 and all(top != Path() and (workspace.root / top / "src").is_dir() for top in tops):
        quoted = _listed(sorted(paths))
        message = f"this folder contains {len(tops)} workspaces with packages of the same names: {quoted}"
        yield Problem(message, hint=f"change to one of them: cd {min(tops)}")
        return
    others = {path for _, path in copies}
    every = (*workspace.packages.values(), *workspace.duplicates)
    manifests = {package.path: package.manifest.path for package in every}
    for (top, copy), found in groups.items():
        name, path = found[0]
        near = f"'{path}/{IGNORE_MARK}'"
        if not _holds_more(workspace, copy, others) and copy != Path():
            near = f"'{copy}/{IGNORE_MARK}'"
        worktree = (workspace.root / copy / ".git").is_file()
        why = f"'{copy}' is another checkout of a repository: " if worktree else ""
        hint = f"{why}rename one, or ignore one by creating an empty file {near}"
        if len(found) == 1:
            message = f"two packages are named '{name}': '{kept[name]}' and '{path}'"
            yield Problem(message, Location(manifests[path]), hint)
        else:
            quoted = _listed([name for name, _ in found])
            message = f"{len(found)} packages are in '{top}' and again in '{copy}': {quoted}"
            yield Problem(message, Location(copy), hint)


def _likelihood(path: Path) -> tuple[bool, int, Path]:
    """Return a key that is least for the folder which is probably no copy."""
    return path.parts[:1] != ("src",), len(path.parts), path


def _tops(first: Path, second: Path) -> tuple[Path, Path]:
    """Return the folders in which both paths are the same, else the paths."""
    common = 0
    for one, other in zip(reversed(first.parts), reversed(second.parts), strict=False):
        if one != other:
            break
        common += 1
    if not common:
        return first, second
    return Path(*first.parts[:-common]), Path(*second.parts[:-common])


def _holds_more(workspace: Workspace, folder: Path, copies: Collection[Path]) -> bool:
    """Tell whether a folder contains a package that is no copy of another one."""
    packages = (*workspace.packages.values(), *workspace.duplicates)
    return any(p.path.is_relative_to(folder) and p.path not in copies for p in packages)


def _listed(names: list[str]) -> str:
    shown = ", ".join(f"'{name}'" for name in names[:_FEW])
    return shown if len(names) <= _FEW else f"{shown} and {len(names) - _FEW} more"
