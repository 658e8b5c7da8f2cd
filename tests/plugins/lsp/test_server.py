"""A session of the language server in this process."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.packages import manifest_text
from tests.plugins.lsp.editors import Editor, editor

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
        found.start(root, workspace={"workspaceEdit": {"resourceOperations": ["rename"]}})
        yield found


def test_diagnostics_follow_unsaved_text(client: Editor, root: Path) -> None:
    path = root / "src/nav/msg/Path.msg"
    assert client.open(path) == []
    assert client.type(path, "shapes/Pont[] points\n") == ["0:0-13: unknown type 'shapes/Pont'"]
    assert client.type(path, "shapes/Point[] points\nint x\n") == ["1:0-3: unknown type 'int'"]
    client.tell("textDocument/didClose", textDocument={"uri": path.as_uri()})
    assert client.problems(path) == []


def test_open_files_are_checked_again_when_another_file_changes(client: Editor, root: Path) -> None:
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


def test_hover_definition_and_references_work(client: Editor, root: Path) -> None:
    path, point = root / "src/nav/msg/Path.msg", root / "src/shapes/msg/Point.msg"
    client.open(path, "# \N{PINCHING HAND}\nshapes/Point[] points\n")
    shown = client.at("textDocument/hover", path, "1:8")
    assert "Serialized: 8 bytes" in shown["contents"]["value"]
    assert client.at("textDocument/hover", path, "0:0") is None
    assert client.at("textDocument/definition", path, "1:8")["uri"] == point.as_uri()
    assert client.at("textDocument/definition", path, "0:0") is None
    found = client.at("textDocument/references", point, "0:2", context={"includeDeclaration": False})
    where = {"start": {"line": 1, "character": 0}, "end": {"line": 1, "character": 12}}
    assert [each for each in found if each["uri"] == path.as_uri()] == [
        {"uri": path.as_uri(), "range": where}
    ]
    assert client.at("textDocument/hover", root / "notes.txt", "0:0") is None


def test_completion_replaces_the_typed_prefix(client: Editor, root: Path) -> None:
    path = root / "src/nav/msg/Path.msg"
    client.open(path, "shapes/P\n")
    found = client.at("textDocument/completion", path, "0:8")
    where = {"start": {"line": 0, "character": 0}, "end": {"line": 0, "character": 8}}
    edits = [each["textEdit"] for each in found["items"]]
    assert edits == [{"range": where, "newText": "shapes/Point"}]
    assert not found["isIncomplete"]
    assert client.at("textDocument/completion", root / "notes.txt", "0:0") is None


def test_a_rename_edits_all_files_and_moves_one(client: Editor, root: Path) -> None:
    path, point = root / "src/nav/msg/Path.msg", root / "src/shapes/msg/Point.msg"
    client.open(path, "shapes/Point[] points\n")
    asked = client.at("textDocument/prepareRename", path, "0:8")
    assert asked["placeholder"] == "Point"
    *edits, move = client.at("textDocument/rename", path, "0:8", newName="Spot")["documentChanges"]
    edit = next(each for each in edits if each["textDocument"]["uri"] == path.as_uri())
    assert edit["textDocument"] == {"uri": path.as_uri(), "version": 1}
    assert [(each["range"]["start"]["character"], each["newText"]) for each in edit["edits"]] == [(7, "Spot")]
    spot = point.with_name("Spot.msg").as_uri()
    assert (move["kind"], move["oldUri"], move["newUri"]) == ("rename", point.as_uri(), spot)
    with pytest.raises(AssertionError, match="invalid interface name 'spot'"):
        client.at("textDocument/rename", path, "0:8", newName="spot")
    assert client.at("textDocument/prepareRename", root / "notes.txt", "0:0") is None
    assert client.at("textDocument/rename", root / "notes.txt", "0:0", newName="A") is None


def test_a_rename_shows_a_warning_about_cmake(client: Editor, root: Path) -> None:
    (root / "src/shapes/CMakeLists.txt").write_text("rosidl_generate_interfaces(shapes ${FILES})\n")
    path = root / "src/nav/msg/Path.msg"
    client.open(path, "shapes/Point[] points\n")
    assert client.at("textDocument/rename", path, "0:8", newName="Spot")["documentChanges"]
    assert client.messages == ["not changed: 'shapes/CMakeLists.txt' does not name 'Point.msg' literally"]


def test_renaming_a_type_needs_editor_support(root: Path, caplog: pytest.LogCaptureFixture) -> None:
    """The answer is an error of the protocol, and no failure of the server that its log would show."""
    with editor() as client:
        client.start(root)
        path = root / "src/nav/msg/Path.msg"
        client.open(path, "shapes/Point[] points\n")
        with pytest.raises(AssertionError, match="this editor cannot rename files"):
            client.at("textDocument/rename", path, "0:8", newName="Spot")
        with pytest.raises(AssertionError, match="this editor cannot rename files"):
            client.at("textDocument/prepareRename", path, "0:8")
        assert client.at("textDocument/prepareRename", path, "0:16")["placeholder"] == "points"
        with pytest.raises(AssertionError, match="'code': -32803"):
            client.at("textDocument/rename", path, "0:8", newName="spot")
    assert not [record for record in caplog.records if record.exc_info]


def test_columns_count_in_the_units_of_the_editor(client: Editor, root: Path) -> None:
    path = root / "src/nav/msg/Path.msg"
    problem = "the file starts with a byte-order mark, which ROS's own generators reject"
    assert client.open(path, "\ufeff# \N{PINCHING HAND}\n") == [f"0:0-5: {problem}"]


def test_file_watchers_are_registered_if_the_editor_supports_them(root: Path) -> None:
    with editor() as client:
        client.start(root, workspace={"didChangeWatchedFiles": {"dynamicRegistration": True}})
        client.open(root / "src/nav/msg/Path.msg")
        assert client.registered == ["workspace/didChangeWatchedFiles"]


def test_changed_files_are_found_without_file_watchers(root: Path) -> None:
    path, other = root / "src/nav/msg/Path.msg", root / "src/shapes/msg/Late.msg"
    with editor() as client:
        client.start(root)
        assert client.open(path, "shapes/Late late\n") == ["0:0-11: unknown type 'shapes/Late'"]
        for text, problems in (("int8 x\n", []), (None, ["0:0-11: unknown type 'shapes/Late'"])):
            if text:
                other.write_text(text, encoding="utf-8")
            else:
                other.unlink()
            client.tell("textDocument/didSave", textDocument={"uri": path.as_uri()})
            assert client.problems(path) == problems


def test_other_file_types_are_ignored(client: Editor, root: Path) -> None:
    assert client.open(root / "src/nav/notes.txt", "int x\n") == []
    client.tell("textDocument/didSave", textDocument={"uri": (root / "src/nav/notes.txt").as_uri()})
    client.tell("textDocument/didClose", textDocument={"uri": (root / "src/nav/notes.txt").as_uri()})
    assert (root / "src/nav/notes.txt").as_uri() not in client.diagnostics


def test_a_file_outside_the_folder_has_its_own_workspace(client: Editor, root: Path) -> None:
    path = root.parent / "other/msg/Alone.msg"
    path.parent.mkdir(parents=True, exist_ok=True)
    assert client.open(path, "Missing x\n") == ["0:0-7: unknown type 'other/Missing'"]
