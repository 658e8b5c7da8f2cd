"""Scripts of entry points import their function, whichever release of setuptools writes them."""

from importlib.metadata import EntryPoint
from types import SimpleNamespace

import pytest

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
