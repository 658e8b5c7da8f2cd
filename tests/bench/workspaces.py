"""Workspaces of any size, the same for the same seed."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

MANIFEST = """<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>1.0.0</version>
  <description>Package {name} of a generated workspace</description>
  <maintainer email="bench@example.com">Bench</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>cmake</buildtool_depend>
{depends}  <export><build_type>cmake</build_type></export>
</package>
"""

CMAKELISTS = """cmake_minimum_required(VERSION 3.22)
project({name} NONE)
install(FILES package.xml DESTINATION share/{name})
"""


def write_workspace(root: Path, packages: int, files: int = 18, seed: int = 1) -> Path:
    """Write `packages` packages of `files` sources each; every one needs up to three earlier ones."""
    chance = random.Random(seed)  # noqa: S311  (a reproducible shape, not a secret)
    names: list[str] = []
    for number in range(packages):
        name = f"bench_{number:04}"
        needs = sorted(chance.sample(names, min(len(names), chance.randrange(4))))
        _write_package(root / "src" / f"group_{number % 10}" / name, name, needs, files)
        names.append(name)
    return root


def _write_package(folder: Path, name: str, needs: list[str], files: int) -> None:
    depends = "".join(f"  <depend>{need}</depend>\n" for need in needs)
    (folder / "src").mkdir(parents=True)
    (folder / "package.xml").write_text(MANIFEST.format(name=name, depends=depends), encoding="utf-8")
    (folder / "CMakeLists.txt").write_text(CMAKELISTS.format(name=name), encoding="utf-8")
    for number in range(files):
        (folder / "src" / f"part_{number}.cpp").write_text(f"int part_{number};\n", encoding="utf-8")
