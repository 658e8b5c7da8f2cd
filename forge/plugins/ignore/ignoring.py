"""Finds the packages that package discovery leaves out, and the files that hide them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from forge.base.frozen import frozen
from forge.base.layout import BUILT_BY, IGNORE_MARK, LAYOUT_MARKER
from forge.workspace.discovery import ROS_DEFAULTS
from forge.workspace.identification import MARKS, identify
from forge.workspace.source_names import folders_to_search


@frozen
class IgnoredPackage:
    """A package, its folder, and the file that hides it: a mark, or the manifest of a package around it."""

    name: str
    path: Path
    file: Path

    @property
    def is_marked(self) -> bool:
        return self.file.name in MARKS

    @property
    def remedy(self) -> str:
        """The command that finds the package again, '' if there is none."""
        if self.file.name != IGNORE_MARK:
            return ""
        return f"forge ignore --undo {self.name if self.file.parent == self.path else self.file.parent}"


def hint_for(name: str, root: Path, base_paths: Iterable[str], variables: Mapping[str, str]) -> str | None:
    """Return what hides a package, and the command that finds it again; None if nothing hides it."""
    for each in ignored_packages(root, base_paths, variables):
        if each.name == name:
            remedy = each.remedy or "forge ignore --list"
            return f"'{each.path}' is left out because of '{each.file}': {remedy}"
    return None


def ignored_packages(
    root: Path, base_paths: Iterable[str], variables: Mapping[str, str]
) -> Iterator[IgnoredPackage]:
    """Yield the packages below the base paths that are hidden, sorted by path.

    Build and install folders contain no such packages. Folders that are never searched, such as hidden ones,
    are not searched here either. Packages inside another one count only if they have a package.xml.
    """
    visited: set[tuple[int, int]] = set()
    variables = {**ROS_DEFAULTS, **variables}
    for base in base_paths:
        hidden: dict[Path, Path] = {}
        top = f"{root}/{base}"
        for folder, entries in folders_to_search(top, visited):
            if BUILT_BY in entries or LAYOUT_MARKER in entries:
                entries.clear()
                continue
            path = Path(base, folder[len(top) :].lstrip("/"))
            mark = next((name for name in MARKS if name in entries), None)
            file = hidden.get(path.parent) or (path / mark if mark else None)
            package = identify(root, path, entries.keys() - {*MARKS}, variables).package
            if package is not None and file is not None and (package.ros or file.name in MARKS):
                yield IgnoredPackage(package.name, path, file)
            if file is None and package is not None:
                file = package.manifest.path
            if file is not None:
                hidden[path] = file
