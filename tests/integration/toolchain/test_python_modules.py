import sys
from pathlib import Path

import pytest

from forge.base.errors import HostError
from forge.toolchain.python_modules import install_command, require_modules
from tests.conftest import Tree

BIN = Path(sys.executable).parent


def test_missing_modules_give_one_error_with_a_command() -> None:
    require_modules(BIN / ".." / "bin" / "python3", ["json"])
    for path in (Path(sys.executable), BIN / ".." / "bin" / Path(sys.executable).name):
        with pytest.raises(HostError) as caught:
            require_modules(path, ["json", "no_such_one", "no_such_two"])
        assert str(caught.value) == (
            f"error: '{path}' lacks modules required by the build: 'no_such_one', 'no_such_two'\n"
            f"hint: {path} -m pip install no_such_one no_such_two"
        )


def test_other_interpreters_get_a_pip_command(tree: Tree) -> None:
    root = tree({"a b/pyvenv.cfg": "home = /usr/bin\n", "uv/pyvenv.cfg": "home = /usr/bin\nuv = 0.9\n"})
    older = Path("/usr/bin/python3.0")
    assert install_command(older, ["numpy"]) == f"{older} -m pip install numpy"
    spaced = root / "a b/bin/python3"
    assert install_command(spaced, ["em"]) == f"'{spaced}' -m pip install 'empy<4'"
    by_uv = root / "uv/bin/python3"
    assert install_command(by_uv, ["numpy"]) == f"uv pip install --python {by_uv} numpy"
    (root / "uv/lib/python3.12/site-packages/pip").mkdir(parents=True)
    assert install_command(by_uv, ["numpy"]) == f"{by_uv} -m pip install numpy"
