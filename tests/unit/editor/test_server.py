"""A session of the language server in this process."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.editors import Editor, editor
from tests.packages import manifest_text

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


_FILES = {
    "src/nav/package.xml": manifest_text("nav", "<depend>shapes</depend>"),
    "src/nav/msg/Path.msg": "shapes/Point[] points\n",
    "src/shapes/package.xml": manifest_text("shapes"),
    "src/shapes/msg/Point.msg": "float64 x\n",
}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ws")
    for name, text in _FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def client(root: Path) -> Iterator[Editor]:
    with editor() as found:
        found.start(root)
        yield found


def test_problems_follow_what_is_typed_and_not_what_is_saved(client: Editor, root: Path) -> None:
    path = root / "src/nav/msg/Path.msg"
    assert client.open(path) == []
    assert client.type(path, "shapes/Pont[] points\n") == ["0:0-13: unknown type 'shapes/Pont'"]
    assert client.type(path, "shapes/Point[] points\nint x\n") == ["1:0-3: unknown type 'int'"]
    client.tell("textDocument/didClose", textDocument={"uri": path.as_uri()})
    assert client.problems(path) == []


def test_a_file_that_is_open_is_checked_again_if_another_one_changes(client: Editor, root: Path) -> None:
    path, other = root / "src/nav/msg/Path.msg", root / "src/shapes/msg/Line.msg"
    assert client.open(path, "shapes/Line line\n") == ["0:0-11: unknown type 'shapes/Line'"]
    client.open(other, "Point start\n")
    assert client.problems(path) == []
    client.tell("textDocument/didClose", textDocument={"uri": other.as_uri()})
    assert client.problems(path) == ["0:0-11: unknown type 'shapes/Line'"]
    other.write_text("Point start\n", encoding="utf-8")
    change = {"uri": other.as_uri(), "type": 1}
    client.tell("workspace/didChangeWatchedFiles", changes=[change])
    assert client.problems(path) == []


def test_columns_count_in_the_units_of_the_editor(client: Editor, root: Path) -> None:
    path = root / "src/nav/msg/Path.msg"
    problem = "the file starts with a byte-order mark, which ROS's own generators reject"
    assert client.open(path, "\ufeff# \N{PINCHING HAND}\n") == [f"0:0-5: {problem}"]


def test_an_editor_that_can_is_asked_to_report_changed_files(root: Path) -> None:
    with editor() as client:
        client.start(root, workspace={"didChangeWatchedFiles": {"dynamicRegistration": True}})
        client.open(root / "src/nav/msg/Path.msg")
        assert client.registered == ["workspace/didChangeWatchedFiles"]


def test_files_of_other_kinds_are_left_alone(client: Editor, root: Path) -> None:
    assert client.open(root / "src/nav/notes.txt", "int x\n") == []
    client.tell("textDocument/didSave", textDocument={"uri": (root / "src/nav/notes.txt").as_uri()})
    client.tell("textDocument/didClose", textDocument={"uri": (root / "src/nav/notes.txt").as_uri()})
    assert (root / "src/nav/notes.txt").as_uri() not in client.diagnostics


def test_a_file_outside_of_the_folder_has_a_workspace_of_its_own(client: Editor, root: Path) -> None:
    path = root.parent / "other/msg/Alone.msg"
    path.parent.mkdir(parents=True, exist_ok=True)
    assert client.open(path, "Missing x\n") == ["0:0-7: unknown type 'other/Missing'"]
