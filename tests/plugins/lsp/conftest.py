"""A small workspace with every kind of file, and a way to point into it."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from forge.base.extensions import FORMATS, is_installed
from forge.plugins.lsp.index import Index
from tests.conftest import Tree
from tests.packages import manifest_text
from tests.plugins.lsp.editors import index_of

collect_ignore = (
    []
    if is_installed(FORMATS, "idl")
    else ["test_completion.py", "test_hover.py", "test_navigation.py", "test_rename.py"]
)
"""Tests whose workspace contains an .idl file, which another plugin reads."""

_BOX = """#include "shapes/msg/Point.idl"
module shapes {
  module msg {
    module Box_Constants {
      const short SIDES = 6;
    };
    struct Box {
      shapes::msg::Point corner;
    };
  };
};
"""
_CMAKE = """rosidl_generate_interfaces(${PROJECT_NAME}
  "msg/Point.msg"
  msg/Box.idl)
"""
_POINT = """# A place.

uint8 FLAT=2  # no height

float64 x  # to the right [m]
float32 y 0.5
"""
FILES = {
    "src/shapes/package.xml": manifest_text("shapes"),
    "src/shapes/CMakeLists.txt": _CMAKE,
    "src/shapes/msg/Point.msg": _POINT,
    "src/shapes/msg/Box.idl": _BOX,
    "src/nav/package.xml": manifest_text("nav", "<depend>shapes</depend>", "<depend>std_msgs</depend>"),
    "src/nav/msg/Path.msg": "shapes/Point[] points\nstring name\n",
    "src/nav/srv/Plan.srv": "shapes/Point goal\n---\nPath path\nbool ok\n",
    "src/nav/action/Drive.action": "shapes/Box[2] boxes\n---\n---\nfloat32 left\n",
}


@dataclass(frozen=True, slots=True)
class Pointer:
    """Points at words of files."""

    index: Index

    def path(self, file: str) -> Path:
        return self.index.root / "src" / file

    def at(self, file: str, word: str) -> tuple[Index, Path, int, int]:
        """Return where a word is, as functions of the editor take it."""
        path = self.path(file)
        for number, line in enumerate(self.index.text(path).splitlines()):
            if word in line:
                return self.index, path, number, line.index(word) + 1
        raise AssertionError(f"{file} has no '{word}'")


@pytest.fixture
def workspace(tree: Tree) -> Pointer:
    return Pointer(index_of(tree(FILES)))


@pytest.fixture
def plugin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Return a build type of an installed distribution; its module is missing, because no editor loads it."""
    info = tmp_path / "site/weird-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: weird\nVersion: 1.0\n", encoding="utf-8")
    (info / "entry_points.txt").write_text("[forge.build_types]\nweird_make = missing\n", encoding="utf-8")
    monkeypatch.syspath_prepend(info.parent)
    return "weird_make"
