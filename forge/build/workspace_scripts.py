"""The setup scripts of the workspace: detect possible changes, and write them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.distributions import VARIABLE
from forge.build.folder_marks import workspace_scripts
from forge.build.inputs.fingerprints import FileTable, contents_of, digest_of, stamp_files
from forge.environment.install_state import recorded_overlays, recorded_state
from forge.environment.prefixes import PACKAGES, find_underlays

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from forge.base.layout import Layout
    from forge.build.journal import Journal

_HOOKS = (".dsv", ".sh", ".bash", ".zsh", ".fish")


class WorkspaceScripts:
    """The scripts below the install folder, and the packages whose contribution may have changed."""

    def __init__(self, layout: Layout, journal: Journal, table: FileTable) -> None:
        """Start without changes, except those of a killed build."""
        self._layout = layout
        self._journal = journal
        self._table = table
        self._unfinished = not journal.ended
        self._changing: dict[str, str] = {}
        """Packages whose contribution may change, with the previous digest."""

    def begin(self, name: str, files: tuple[str, ...]) -> None:
        """Note the contribution of a package with these installed `files` before it is built."""
        self._changing[name] = self._digest(name, files)

    def end(self, name: str, files: tuple[str, ...]) -> None:
        """Compare the contribution of a package after its build."""
        if self._changing[name] == self._digest(name, files):
            del self._changing[name]

    def remove(self, name: str) -> None:
        """Note that a package was removed."""
        self._changing[name] = ""

    def write(self, python: Path, variables: Mapping[str, str], *, built: bool) -> None:
        """Write the scripts if they may have changed; `built` is True if this build built anything."""
        install = self._layout.install
        scripts = workspace_scripts(install)
        untouched = self._journal.scripts == stamp_files(scripts)
        is_recorded = recorded_state(install).rosdistro == variables[VARIABLE] and not recorded_overlays(
            install
        )
        if not built and untouched and is_recorded and not self._unfinished:
            return
        from forge.build.installation import finish_workspace
        from forge.build.prefix import tidy

        chain = find_underlays(variables, install).chain
        unchanged = untouched and not self._changing and not self._unfinished
        finish_workspace(self._layout, chain, python, variables[VARIABLE], unchanged=unchanged)
        tidy(self._layout)
        self._journal.end(ended=True)
        self._journal.note_scripts(stamp_files(scripts))

    def _digest(self, name: str, files: tuple[str, ...]) -> str:
        """Return a digest of a package's contribution to the workspace's scripts; '' if it has no files.

        The digested package.* scripts already reflect all hooks and existing folders.
        """
        prefix = self._layout.prefix(name)
        share, index = f"{prefix}/share/{name}/", f"{prefix}/{PACKAGES}/{name}"
        listed = [
            path for path in files if path == index or (path.startswith(share) and path.endswith(_HOOKS))
        ]
        return digest_of(listed, contents_of(listed, self._table)) if listed else ""
