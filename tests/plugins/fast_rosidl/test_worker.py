"""The worker for rosidl generators and ament scripts behaves like the commands themselves."""

import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from forge.execution import worker_client
from forge.plugins.fast_rosidl.generators import SCRIPTS
from forge.plugins.fast_rosidl.recipe import WORKER_VARIABLE, rosidl_worker
from tests.conftest import Tree
from tests.rosidl import MODULES, underlay

pytestmark = pytest.mark.needs(str(MODULES / "rosidl_parser"))

CLIENT = (sys.executable, "-S", "-E", worker_client.__file__, "--in", WORKER_VARIABLE)
REPORT = "import os, sys\nprint(os.getppid(), sys.argv[1:], os.getcwd(), os.environ['GREETING'])\n"
"""A program that tells who has started it: the worker, or this process."""


@pytest.fixture(scope="module")
def variables(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, str]]:
    """Start a worker; give the environment of clients."""
    environment = {**os.environ, **underlay(), "GREETING": "hello"}
    with rosidl_worker(Path(sys.executable), tmp_path_factory.mktemp("cache"), environment) as connection:
        yield {**environment, **connection}


@pytest.fixture(autouse=True)
def _files(tree: Tree) -> None:
    tree({"arguments.json": "{}", "report.py": REPORT})


def ask(
    root: Path, variables: Mapping[str, str], *argv: str, python: str = sys.executable
) -> subprocess.CompletedProcess[str]:
    """Run a command line as CMake's rules do."""
    words = (*CLIENT, python, *(argv or ("report.py", "--generator-arguments-file", "arguments.json")))
    return subprocess.run(words, cwd=root, env=variables, capture_output=True, text=True, check=False)


def in_worker(done: subprocess.CompletedProcess[str]) -> bool:
    """Tell whether the program ran in the worker, whose parent is no client of this process."""
    return int(done.stdout.split()[0]) != os.getpid()


def test_a_generator_runs_in_the_worker_with_its_own_environment(
    tmp_path: Path, variables: dict[str, str]
) -> None:
    done = ask(tmp_path, {**variables, "GREETING": "other"})
    assert (done.returncode, done.stderr) == (0, "")
    assert in_worker(done)
    assert done.stdout.split(maxsplit=1)[1] == (
        f"['--generator-arguments-file', 'arguments.json'] {tmp_path} other\n"
    )


@pytest.mark.parametrize("script", sorted(SCRIPTS))
def test_ament_scripts_run_in_the_worker(tmp_path: Path, variables: dict[str, str], script: str) -> None:
    (tmp_path / script).write_text(REPORT)
    for _ in range(3):  # from the second on, the worker has imported what they need
        done = ask(tmp_path, variables, script, "package.xml")
        assert (done.returncode, done.stderr) == (0, "")
        assert in_worker(done)
        assert done.stdout.split(maxsplit=1)[1] == f"['package.xml'] {tmp_path} hello\n"
    module = SCRIPTS[script].replace(".", "/")
    other = tmp_path / "other" / f"{module}.py"
    other.parent.mkdir(parents=True)
    (other.parent / "__init__.py").touch()
    other.touch()
    path = {"PYTHONPATH": f"{tmp_path}/other:{variables['PYTHONPATH']}"}
    done = ask(tmp_path, {**variables, **path}, script, "package.xml")
    assert (done.returncode, done.stderr) == (0, "")
    assert not in_worker(done)


@pytest.mark.parametrize(
    "argv",
    [
        ("report.py",),
        ("report.py", "--generator-arguments-file"),
        ("-c", REPORT),
    ],
    ids=["without arguments file", "without its name", "no file"],
)
def test_other_commands_run_unchanged(
    tmp_path: Path, variables: dict[str, str], argv: tuple[str, ...]
) -> None:
    done = ask(tmp_path, variables, *argv)
    assert (done.returncode, done.stderr) == (0, "")
    assert not in_worker(done)


def test_commands_run_without_a_worker(tmp_path: Path, variables: dict[str, str]) -> None:
    for address in ("", str(tmp_path / "gone")):
        done = ask(tmp_path, {**variables, WORKER_VARIABLE: address})
        assert (done.returncode, done.stderr) == (0, "")
        assert not in_worker(done)


@pytest.mark.parametrize(
    "changed", [{"PYTHONHASHSEED": "1"}, {"LC_ALL": "C"}, {"PYTHONPATH": "{root}/other"}], ids=str
)
def test_a_different_environment_is_declined(
    tmp_path: Path, variables: dict[str, str], changed: dict[str, str]
) -> None:
    assert in_worker(ask(tmp_path, variables))
    (tmp_path / "other").mkdir()
    (tmp_path / "other/em.py").write_text("")
    values = {name: value.format(root=tmp_path) for name, value in changed.items()}
    done = ask(tmp_path, {**variables, **values})
    assert done.returncode == 0
    assert not in_worker(done)
    assert done.stderr.startswith("forge: runs report.py in a separate process: it ")


def test_a_different_interpreter_is_declined(tmp_path: Path, variables: dict[str, str]) -> None:
    (tmp_path / "python").symlink_to(sys.executable)
    done = ask(tmp_path, variables, python=str(tmp_path / "python"))
    assert done.returncode == 0
    assert not in_worker(done)


def test_failed_commands_run_again_outside_the_worker(tmp_path: Path, variables: dict[str, str]) -> None:
    (tmp_path / "report.py").write_text("print('once')\nraise SystemExit(7)\n")
    done = ask(tmp_path, variables)
    assert (done.returncode, done.stdout) == (7, "once\n")
    assert done.stderr == "forge: runs report.py in a separate process: it ended with 7\n"


def test_commands_share_no_state(tmp_path: Path, variables: dict[str, str]) -> None:
    (tmp_path / "report.py").write_text(
        "import os, sys\nassert not hasattr(sys, 'left')\nsys.left = True\nos.environ['GREETING'] = 'left'\n"
    )
    assert [ask(tmp_path, variables).stderr for _ in range(2)] == ["", ""]


def test_ament_setup_py_runs_in_the_worker(tmp_path: Path, variables: dict[str, str]) -> None:
    (tmp_path / "setup.py").write_text(
        "import os\nfrom setuptools import setup\nprint(os.getppid())\n"
        "setup(name='p', version='1.0', packages=[])\n"
    )
    done = ask(tmp_path, variables, "setup.py", "egg_info")
    assert done.returncode == 0, done.stderr
    assert in_worker(done)
    assert (tmp_path / "p.egg-info/PKG-INFO").is_file()
