from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from forge.base.errors import EnvironmentFault
from forge.toolchain.interpreter import Interpreter, find_interpreter, own_path, require_modules

if TYPE_CHECKING:
    from tests.conftest import Tree

OWN = Interpreter(own_path(), (sys.version_info.major, sys.version_info.minor))


def test_the_active_virtual_environment_comes_before_our_own(tree: Tree) -> None:
    """It is asked for its version, and is not followed to where its links lead."""
    root = tree({"venv/bin/python": "#!/bin/sh\necho 3 12\n"})
    found = find_interpreter(None, {"VIRTUAL_ENV": str(root / "venv")})
    assert found == Interpreter(root / "venv/bin/python", (3, 12))
    assert not found.own


def test_the_option_comes_first(tree: Tree) -> None:
    """A path, or a name to look for."""
    root = tree({"bin/python3.13": "#!/bin/sh\necho 3 13\n"})
    variables = {"PATH": str(root / "bin"), "VIRTUAL_ENV": "/not/there"}
    expected = Interpreter(root / "bin/python3.13", (3, 13))
    assert find_interpreter("python3.13", variables) == expected
    assert find_interpreter(str(root / "bin/python3.13"), variables) == expected
    assert find_interpreter(sys.executable, variables).own


@pytest.mark.parametrize(
    ("program", "message"),
    [
        (
            "#!/bin/sh\necho 3 8\n",
            "error: python 3.8 at 'P' is too old\nhint: forge requires python 3.10 or newer",
        ),
        ("#!/bin/sh\necho hello\n", "error: 'P' is not a python interpreter"),
        ("#!/bin/sh\nexit 1\n", "error: cannot run the Python interpreter 'P': exit code 1"),
        ("#!/not/there\n", "error: cannot run the Python interpreter 'P': No such file or directory"),
    ],
)
def test_what_is_no_python_is_a_message(program: str, message: str, tree: Tree) -> None:
    """Too old, something else, or broken."""
    path = tree({"odd": program}) / "odd"
    with pytest.raises(EnvironmentFault) as caught:
        find_interpreter(str(path), {})
    assert str(caught.value) == message.replace("'P'", f"'{path}'")


def test_modules_that_are_there_say_nothing() -> None:
    """In our own interpreter, without starting it again, and in another."""
    require_modules(OWN, ["numpy", "json"])
    require_modules(Interpreter(Path(sys.executable).parent / ".." / "bin" / "python3", (3, 11)), ["json"])


def test_missing_modules_are_one_message_with_the_command() -> None:
    """For the interpreter that lacks them."""
    for path in (
        Path(sys.executable),
        Path(sys.executable).parent / ".." / "bin" / Path(sys.executable).name,
    ):
        with pytest.raises(EnvironmentFault) as caught:
            require_modules(Interpreter(path, OWN.version), ["json", "no_such_one", "no_such_two"])
        assert str(caught.value) == (
            f"error: '{path}' lacks modules required by the build: 'no_such_one', 'no_such_two'\n"
            f"hint: {path} -m pip install no_such_one no_such_two"
        )
