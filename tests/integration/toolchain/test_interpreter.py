import sys

import pytest

from forge.base.errors import HostError
from forge.toolchain.interpreter import Interpreter, find_interpreter, is_own, own_path
from tests.conftest import Tree

OWN = Interpreter(own_path(), (sys.version_info.major, sys.version_info.minor))


def test_the_option_takes_precedence(tree: Tree) -> None:
    """Its value is a path, or a name to look up."""
    root = tree({"bin/python3.13": "#!/bin/sh\necho 3 13\n"})
    variables = {"PATH": str(root / "bin"), "VIRTUAL_ENV": "/not/there"}
    expected = Interpreter(root / "bin/python3.13", (3, 13))
    assert find_interpreter("python3.13", variables) == expected
    assert find_interpreter(str(root / "bin/python3.13"), variables) == expected
    assert is_own(find_interpreter(sys.executable, variables).path)


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
def test_an_unusable_interpreter_is_reported(program: str, message: str, tree: Tree) -> None:
    path = tree({"odd": program}) / "odd"
    with pytest.raises(HostError) as caught:
        find_interpreter(str(path), {})
    assert str(caught.value) == message.replace("'P'", f"'{path}'")


def test_shims_are_resolved_to_the_real_interpreter(tree: Tree) -> None:
    """Shims of pyenv depend on the current folder, and must not be in the first line of programs."""
    root = tree({"shims/python3": f"#!/bin/sh\nexec '{sys.executable}' \"$@\"\n"})
    assert find_interpreter(None, {"PATH": str(root / "shims")}) == OWN
    assert find_interpreter(str(root / "shims/python3"), {}).path == root / "shims/python3"
