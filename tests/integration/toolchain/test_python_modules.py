import os
import sys
from pathlib import Path

import pytest

from forge.base.errors import HostError
from forge.toolchain.python_modules import install_command, require_modules
from tests.conftest import Tree

BIN = Path(sys.executable).parent
SUDO = "" if os.geteuid() == 0 else "sudo "


def test_missing_modules_give_one_error_with_a_command() -> None:
    require_modules(BIN / ".." / "bin" / "python3", ["json"])
    for path in (Path(sys.executable), BIN / ".." / "bin" / Path(sys.executable).name):
        with pytest.raises(HostError) as caught:
            require_modules(path, ["json", "no_such_one", "no_such_two"])
        assert str(caught.value) == (
            f"error: '{path}' lacks modules required by the build: 'no_such_one', 'no_such_two'\n"
            f"hint: {path} -m pip install no_such_one no_such_two"
        )


@pytest.mark.needs("/usr/bin/python3")
@pytest.mark.parametrize(
    ("system", "modules", "command"),
    [
        ({"ID": "ubuntu", "ID_LIKE": "debian"}, ["numpy", "em"], "apt install python3-numpy python3-empy"),
        ({"ID": "mint", "ID_LIKE": "ubuntu debian"}, ["pytest"], "apt install python3-pytest"),
        ({"ID": "openEuler"}, ["numpy", "yaml"], "dnf install python3-numpy python3-pyyaml"),
        ({"ID": "rocky", "ID_LIKE": "rhel centos fedora"}, ["numpy"], "dnf install python3-numpy"),
    ],
)
def test_system_pythons_get_a_system_package_command(
    system: dict[str, str], modules: list[str], command: str
) -> None:
    """pip refuses to install into it."""
    assert install_command(Path("/usr/bin/python3"), modules, system) == SUDO + command


@pytest.mark.needs("/usr/bin/python3")
def test_system_pythons_get_a_virtual_environment_command_for_other_modules() -> None:
    """The hint includes the package with the usual name, which may exist."""
    assert install_command(Path("/usr/bin/python3"), ["numpy", "Foo_Bar"], {"ID": "debian"}) == (
        f"{SUDO}apt install python3-numpy python3-foo-bar; if there is no such package: "
        "/usr/bin/python3 -m venv --system-site-packages .venv && . .venv/bin/activate "
        "&& pip install numpy Foo_Bar"
    )


def test_other_interpreters_get_a_pip_command(tree: Tree) -> None:
    root = tree({"a b/pyvenv.cfg": "home = /usr/bin\n", "uv/pyvenv.cfg": "home = /usr/bin\nuv = 0.9\n"})
    debian, python = {"ID": "debian"}, Path("/usr/bin/python3")
    assert install_command(python, ["numpy"], {"ID": "plan9"}) == f"{python} -m pip install numpy"
    older = Path("/usr/bin/python3.0")
    assert install_command(older, ["numpy"], debian) == f"{older} -m pip install numpy"
    spaced = root / "a b/bin/python3"
    assert install_command(spaced, ["em"], debian) == f"'{spaced}' -m pip install 'empy<4'"
    by_uv = root / "uv/bin/python3"
    assert install_command(by_uv, ["numpy"], debian) == f"uv pip install --python {by_uv} numpy"
    (root / "uv/lib/python3.12/site-packages/pip").mkdir(parents=True)
    assert install_command(by_uv, ["numpy"], debian) == f"{by_uv} -m pip install numpy"
