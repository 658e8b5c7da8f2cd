"""Makes install trees for tests: packages with files, put into prefixes as a build does."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from forge.base.layout import Layout
from forge.build.folder_marks import create_output_folders, mark_layout
from forge.build.installation import finish_workspace, install_package, uninstall_markers
from forge.toolchain.interpreter import Interpreter
from tests.packages import manifest_text, package

PYTHON = Interpreter(Path(sys.executable), (3, 11))


@dataclass(frozen=True, slots=True)
class Made:
    """A package as its own install step leaves it: `files` are relative to its prefix."""

    name: str
    needs: tuple[str, ...] = ()
    build_type: str = "cmake"
    files: Mapping[str, str] = field(default_factory=dict)

    @property
    def texts(self) -> Mapping[str, str]:
        """The files, with the manifest that all but ament_python packages install."""
        manifest = {f"share/{self.name}/package.xml": manifest_text(self.name)}
        return {**manifest, **self.files}


def make_install(
    base: Path, packages: Sequence[Made], *, merged: bool = False, underlays: tuple[Path, ...] = ()
) -> Layout:
    """Install the packages into BASE/install, in their order, and write its scripts."""
    layout = Layout(base / "build", base / "install", None, merged)
    create_output_folders(layout)
    mark_layout(layout)
    for made in packages:
        prefix = layout.prefix(made.name)
        paths = [prefix / name for name in made.texts]
        for path, text in zip(paths, made.texts.values(), strict=True):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        listing = layout.build_dir(made.name) / "install_manifest.txt"
        listing.parent.mkdir(parents=True, exist_ok=True)
        listing.write_text("\n".join(map(str, paths)), encoding="utf-8")
        uninstall_markers(made.name, layout)
        install_package(package(made.name, build_type=made.build_type), layout, made.needs, PYTHON)
    finish_workspace(layout, underlays, PYTHON.path)
    return layout


def dsv_package(name: str, *lines: str, needs: tuple[str, ...] = (), files: Mapping[str, str]) -> Made:
    """Return a package whose own local_setup.dsv has the lines."""
    listed = {f"share/{name}/local_setup.dsv": "".join(f"{line}\n" for line in lines)}
    return Made(name, needs, "ament_cmake", {**listed, **files})
