"""What the tracer of build backends logs."""

from __future__ import annotations

import ast
import json

import pytest

from forge.build.wheels.backend_inputs import Traced, external_inputs, parse_trace
from tests.conftest import Tree
from tests.snippets import ROOT


def log(*lines: list[object]) -> str:
    """Return a log as the tracer writes it."""
    return "".join(f"{json.dumps(line)}\n" for line in lines)


def test_logs_are_parsed() -> None:
    traced = parse_trace(
        log(
            ["read", "/a/../b"],
            ["written", "/w"],
            ["listed", "/l/."],
            ["started", "cat"],
            ["asked", "NAME"],
            ["missing", "Cython", True],
            ["interpreter", ["", "/lib"]],
        )
    )
    assert traced == Traced({"/b"}, {"/w"}, {"/l"}, {"cat"}, {"NAME"}, {"Cython": True}, {"/lib"})


@pytest.mark.parametrize("line", ["", "{", "3", '["read"', '["read"]', '["read", 3]', '["a", "b"]', "\0"])
def test_invalid_log_lines_are_skipped(line: str) -> None:
    assert parse_trace(f"{line}\n" + log(["read", "/a"])) == Traced(read={"/a"})


def test_any_file_name_can_be_logged() -> None:
    name = "/a\nb\udcff\u2028'\"\\"
    assert parse_trace(log(["read", name])).read == {name}


def test_listed_folders_programs_and_variables_are_inputs(tree: Tree) -> None:
    root = tree({"shared/a": "", "p/x": ""})
    listed = {f"{root}/shared", f"{root}/gone", f"{root}/p"}
    traced = Traced(listed=listed, started={"cat", "/bin/dog"}, asked={"VERSION", "PATH"})
    assert external_inputs(traced, (f"{root}/p",)) == ("$VERSION", f"{root}/shared/.", "program cat")


def test_a_missing_module_is_searched_for_in_the_right_folders(tree: Tree) -> None:
    root = tree({"lib/python3/os.py": "", "lib/python3/lib-dynload/x": "", "site-packages/a.py": ""})
    folders = ("lib/python3", "lib/python3/lib-dynload", "site-packages", "site-packages/a/_vendor", "absent")
    traced = Traced(
        missing={"mine": False, "Cython": True}, search_path={f"{root}/{name}" for name in folders}
    )
    names = ("Cython/__init__.py", "mine.py", "mine/__init__.py")
    assert external_inputs(traced, ()) == tuple(f"{root}/site-packages/{name}" for name in names)


@pytest.mark.parametrize("name", ["backend_tracer", "setup_install"])
def test_code_for_the_workspace_interpreter_runs_on_python_3_8(name: str) -> None:
    """The workspace's interpreter, and what a setup.py starts, may be older than forge's."""
    text = (ROOT / f"forge/build/wheels/{name}.py").read_text(encoding="utf-8")
    ast.parse(text, feature_version=(3, 8))
