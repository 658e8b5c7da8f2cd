"""The layout of build, install and log folders, compatible with colcon."""

from __future__ import annotations

from pathlib import Path

from forge.base.frozen import frozen

PACKAGE = Path(__file__).parents[1]
"""The folder of forge's modules; a wheel contains the templates in it, a checkout next to it."""


SCRATCH_DIR = ".forge"
"""The folder for forge's own files in a package's build folder."""
TEST_SCRATCH_DIR = ".forge_test"
"""The same for tests."""

PROGRAMS_DIR = ".forge_programs"
"""In the build folder: a folder of links to the programs that come first on PATH."""
TEMPLATES_DIR = ".forge_templates"
"""In the build folder: compiled templates, if the user has no cache folder."""
OWN_CACHE_DIR = ".forge_own"
"""In the build folder: what would be in the user's cache folder, if there is none."""


def templates_folder() -> Path:
    """Return the folder of the templates, in the wheel or the checkout."""
    packed = PACKAGE / "_templates"
    return packed if packed.is_dir() else PACKAGE.parent / "templates"


def own_folders() -> list[Path]:
    """Return the folders with forge's modules and templates."""
    templates = templates_folder()
    return [PACKAGE] if templates.is_relative_to(PACKAGE) else [PACKAGE, templates]


@frozen
class Layout:
    """The absolute output folders of one workspace, and whether packages share a prefix."""

    build: Path
    install: Path
    logs: Path | None
    merged: bool = False
    symlink: bool = False

    def prefix(self, name: str) -> Path:
        """Return the install prefix of package `name`."""
        return self.install if self.merged else self.install / name

    def build_dir(self, name: str) -> Path:
        """Return the build folder of package `name`."""
        return self.build / name

    @property
    def word(self) -> str:
        """The text of colcon's layout marker."""
        return "merged" if self.merged else "isolated"
