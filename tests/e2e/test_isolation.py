"""forge builds packages that are called like its own modules and libraries, and is not led astray by them."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import forge
from tests.conftest import Tree
from tests.packages import manifest_text

HOME = Path(forge.__file__).parents[1]
COMMAND = Path(sys.executable).with_name("forge")
FOREIGN = "raise SystemExit('a module of the workspace, not of forge')\n"
NAMES = ("forge", "installer", "pyproject_hooks", "jinja2", "lark")

_SETUP = """{first}
from setuptools import setup
setup(name="{name}", version="0.1.0", packages=["{name}"], data_files=[
    ("share/ament_index/resource_index/packages", ["resource/{name}"]), ("share/{name}", ["package.xml"])])
"""
_INTERFACES = """cmake_minimum_required(VERSION 3.18)
project(said NONE)
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
rosidl_generate_interfaces(said "msg/Word.msg")
ament_package()
"""


def python_package(name: str, *depends: str, text: str = FOREIGN, first: str = "") -> dict[str, str]:
    needs = (f"<depend>{need}</depend>" for need in depends)
    return {
        f"src/{name}/package.xml": manifest_text(name, *needs, build_type="ament_python"),
        f"src/{name}/setup.py": _SETUP.format(name=name, first=first),
        f"src/{name}/resource/{name}": "",
        f"src/{name}/{name}/__init__.py": text,
    }


def interfaces(*depends: str) -> dict[str, str]:
    lines = (
        *(f"<depend>{need}</depend>" for need in depends),
        "<buildtool_depend>ament_cmake</buildtool_depend>",
        "<buildtool_depend>rosidl_default_generators</buildtool_depend>",
        "<member_of_group>rosidl_interface_packages</member_of_group>",
    )
    return {
        "src/said/package.xml": manifest_text("said", *lines),
        "src/said/CMakeLists.txt": _INTERFACES,
        "src/said/msg/Word.msg": "string word\n",
    }


def run(root: Path, *argv: str, python_path: Path | str = "", **more: str) -> str:
    """Run a program that must succeed; return what it printed."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment |= {"PYTHONPATH": str(python_path), **more} if python_path else more
    done = subprocess.run(argv, cwd=root, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.mark.needs("cmake", "ninja")
def test_packages_can_have_the_names_of_forge_and_its_libraries(tree: Tree) -> None:
    uses = python_package("uses", *NAMES, "told", text="x = 1\n", first="import told, sys; told.tell()")
    tells = "def tell():\n    import pathlib; pathlib.Path('../../told').touch()\n"
    files = {
        **{path: text for name in NAMES for path, text in python_package(name).items()},
        **python_package("told", text=tells),
        **uses,
        **interfaces(*NAMES),
    }
    root = tree({f"ws/{path}": text for path, text in files.items()}) / "ws"
    run(root, str(COMMAND), "build")
    assert (root / "told").is_file(), "the setup.py of a package sees the packages that it needs"
    run(root, "sh", "-c", f'. install/setup.sh; "{COMMAND}" build --force')
    word = "from said.msg import Word; print(Word(word='well'))"
    assert "well" in run(root, "sh", "-c", f'. install/setup.sh; "{sys.executable}" -c "{word}"')


@pytest.fixture
def foreign(tree: Tree) -> Path:
    return tree({f"foreign/{name}/__init__.py": FOREIGN for name in NAMES}) / "foreign"


@pytest.mark.needs("cmake", "ninja")
def test_modules_in_PYTHONPATH_and_the_working_folder_are_ignored(tree: Tree, foreign: Path) -> None:
    files = {**interfaces(), **python_package("own", text="x = 1\n")}
    root = tree({f"ws/{path}": text for path, text in files.items()}) / "ws"
    for name in NAMES:
        (root / name).symlink_to(foreign / name)
        (root / f"build/own/{name}").parent.mkdir(parents=True, exist_ok=True)
        (root / f"build/own/{name}").symlink_to(foreign / name)
    (root / "build/own/.forge").mkdir()  # the mark of forge's build folders
    run(root, str(COMMAND), "build", python_path=f"{foreign}:")
    said = run(root, str(COMMAND), "interface", "show", "std_msgs/msg/String", python_path=foreign)
    assert "string data" in said


def test_a_client_without_a_worker_starts_the_same_forge(tmp_path: Path, foreign: Path) -> None:
    client = str(HOME / "forge/execution/worker_client.py")
    run(foreign, sys.executable, "-S", "-E", client, "--version", python_path=foreign)
    gone = str(tmp_path / "gone")
    said = run(
        foreign, sys.executable, "-S", "-E", client, "--version", python_path=foreign, FORGE_WORKER=gone
    )
    assert said == f"forge {forge.__version__}\n"


SHOW = "import sys, _ros_forge; _ros_forge.own_modules_first(); print(*sys.path, sep='\\n')"


def order(root: Path, python_path: str, *options: str) -> list[str]:
    """Return the folders of modules when forge has put them in order."""
    return run(root, sys.executable, *options, "-c", SHOW, python_path=python_path).splitlines()


def test_PYTHONPATH_folders_come_last(tmp_path: Path, foreign: Path) -> None:
    found = order(tmp_path, f"{foreign}:{tmp_path / 'other'}")
    plain = run(tmp_path, sys.executable, "-c", "import sys; print(*sys.path[1:], sep='\\n')").splitlines()
    assert found == [*plain, str(foreign), str(tmp_path / "other")]


def test_a_forge_found_in_PYTHONPATH_uses_its_own_libraries(tmp_path: Path, foreign: Path) -> None:
    """As after 'pip install --target'."""
    for name in ("forge", "_ros_forge.py"):
        (tmp_path / "target").mkdir(exist_ok=True)
        (tmp_path / "target" / name).symlink_to(HOME / name)
    found = order(tmp_path, f"{foreign}:{tmp_path / 'target'}", "-S")
    assert found[-2:] == [str(tmp_path / "target"), str(foreign)]
    start = str(tmp_path / "target/_ros_forge.py")
    assert "forge" in run(
        tmp_path, sys.executable, start, "--version", python_path=f"{foreign}:{tmp_path / 'target'}"
    )


def test_the_environment_of_child_processes_is_unchanged(tmp_path: Path, foreign: Path) -> None:
    words = f"{SHOW}; import os; print(os.environ['PYTHONPATH'])"
    said = run(tmp_path, sys.executable, "-c", words, python_path=f"{foreign}:").splitlines()
    assert said[-1] == f"{foreign}:"


def test_an_interrupt_while_forge_starts_leaves_no_traceback(tmp_path: Path) -> None:
    """Even before it has imported what handles signals."""
    (tmp_path / "forge").mkdir()
    (tmp_path / "forge/__init__.py").write_text("import signal\nsignal.raise_signal(signal.SIGINT)\n")
    shutil.copy(HOME / "_ros_forge.py", tmp_path)
    ran = subprocess.run(
        [sys.executable, tmp_path / "_ros_forge.py", "build"], capture_output=True, text=True, check=False
    )
    assert (ran.returncode, ran.stderr) == (130, "")
