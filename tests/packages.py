"""Makes packages for tests, from the text of a manifest."""

from collections.abc import Mapping
from pathlib import Path

from forge.workspace.discovery import ROS_DEFAULTS
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import Package

HEAD = """<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>0.1.0</version>
  <description>A package of the tests</description>
  <maintainer email="tests@example.com">The tests</maintainer>
  <license>Apache-2.0</license>
{body}
</package>
"""


def write_files(root: Path, files: Mapping[str, str]) -> Path:
    """Write files below a folder, which is returned; a text with '#!' is executable."""
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        if text.startswith("#!"):
            path.chmod(0o755)
    return root


def manifest_text(name: str, *lines: str, build_type: str = "ament_cmake") -> str:
    """Return a manifest with the given lines and build type."""
    export = f"<export><build_type>{build_type}</build_type></export>"
    return HEAD.format(name=name, body="\n".join(f"  {line}" for line in (*lines, export)))


def manifests(*folders: str) -> dict[str, str]:
    """Return the manifests of packages that are named like their folders."""
    return {f"{folder}/package.xml": manifest_text(folder.rpartition("/")[2]) for folder in folders}


def package(name: str, *depends: str, build_type: str = "ament_cmake", tag: str = "depend") -> Package:
    """Return a package in src/NAME with one dependency element for each of `depends`."""
    lines = [f"<{tag}>{other}</{tag}>" for other in depends]
    path = Path("src") / name
    content = manifest_text(name, *lines, build_type=build_type).encode()
    return Package(path, parse_manifest(content, path / "package.xml", ROS_DEFAULTS))


def distribution(name: str, group: str, entry: str = "", folder: str = "") -> dict[str, str]:
    """Return the metadata of a distribution with one entry point, by default NAME = NAME."""
    info = f"{folder}{name}-1.dist-info"
    return {
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: 1\n",
        f"{info}/entry_points.txt": f"[{group}]\n{entry or f'{name} = {name}'}\n",
    }
