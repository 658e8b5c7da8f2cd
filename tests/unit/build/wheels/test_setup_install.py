"""Scripts of entry points import their function, whichever release of setuptools writes them."""

import ast
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace

import pytest

from forge.build.wheels import setup_install
from forge.build.wheels.setup_install import _Template

POINT = EntryPoint("talk", "hello.talk:main", "console_scripts")
LOOPS = {
    # setuptools before 75 and since 80, and the releases between.
    "entry points": {"ep": POINT},
    "names": {"dist": SimpleNamespace(get_entry_map=lambda _: {"talk": POINT})},
}


@pytest.mark.parametrize("local_variables", LOOPS.values(), ids=LOOPS)
def test_scripts_import_the_function_of_their_entry_point(local_variables: dict[str, object]) -> None:
    local_variables |= {"group": "console_scripts", "name": "talk", "spec": "hello==1"}
    script = _Template("the template of setuptools") % local_variables
    assert "from hello.talk import main" in script


def test_code_for_the_workspace_interpreter_runs_on_python_3_8() -> None:
    """The workspace's interpreter may be older than forge's."""
    ast.parse(Path(setup_install.__file__).read_text(encoding="utf-8"), feature_version=(3, 8))
