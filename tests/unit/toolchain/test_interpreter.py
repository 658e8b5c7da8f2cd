from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from forge.base.errors import EnvironmentFault
from forge.toolchain.interpreter import Interpreter, find_interpreter, own_path

if TYPE_CHECKING:
    from tests.conftest import Tree

OWN = Interpreter(own_path(), (sys.version_info.major, sys.version_info.minor))


def test_code_goes_where_the_version_says() -> None:
    """Below any prefix the same."""
    assert Interpreter(Path("/x/python3"), (3, 12)).site_packages == "lib/python3.12/site-packages"


@pytest.mark.parametrize("variables", [{}, {"VIRTUAL_ENV": ""}, {"VIRTUAL_ENV": sys.prefix}])
def test_without_a_word_it_is_our_own(variables: dict[str, str]) -> None:
    """Also in the virtual environment that forge itself runs in."""
    assert find_interpreter(None, variables) == OWN
    assert OWN.own


def test_the_name_it_was_started_by_makes_no_other(monkeypatch: pytest.MonkeyPatch, tree: Tree) -> None:
    """The forge command uses python3, users write python: that is no reason to rebuild."""
    root = tree({"bin/python3": "", "other/python": "", "other/python3": ""})
    (root / "bin/python").symlink_to("python3")
    monkeypatch.setattr(sys, "executable", str(root / "bin/python"))
    assert own_path() == root / "bin/python3"
    monkeypatch.setattr(sys, "executable", str(root / "other/python"))
    assert own_path() == root / "other/python"


@pytest.mark.parametrize(
    ("python", "variables", "message"),
    [
        (
            "python9",
            {"PATH": "/bin"},
            "error: python 'python9' not found\nhint: pass an existing program to '--python'",
        ),
        (
            None,
            {"VIRTUAL_ENV": "/not/there"},
            (
                "error: the active virtual environment '/not/there' has no 'bin/python'\n"
                "hint: run 'deactivate', or choose an interpreter with '--python'"
            ),
        ),
    ],
)
def test_a_missing_python_is_a_message(python: str | None, variables: dict[str, str], message: str) -> None:
    """With what would help."""
    with pytest.raises(EnvironmentFault) as caught:
        find_interpreter(python, variables)
    assert str(caught.value) == message
