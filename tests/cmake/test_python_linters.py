"""Linters in tests of Python packages: run if installed, else skipped by name; those of ROS come first."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from .conftest import PYTHON_VERSION

pytestmark = [pytest.mark.needs("cmake"), pytest.mark.needs("ninja")]

COMPLAINT = '#!/bin/sh\nfor file; do :; done\necho "$file:3:1: too long"\nexit 1\n'
CALL = """
import sys, unittest
from importlib import import_module
try:
    print(getattr(import_module(sys.argv[1] + ".main"), sys.argv[2])(argv=sys.argv[3:]))
except unittest.SkipTest as skipped:
    print("skipped:", skipped)
"""


@pytest.fixture
def call(embedded: Path, tmp_path: Path) -> Callable[..., str]:
    """Call a function of a linter in a package with one file, as a test of the package does."""
    (tmp_path / "package/test").mkdir(parents=True)
    (tmp_path / "package/test/test_it.py").write_text("", encoding="utf-8")
    (tmp_path / "bin").mkdir()
    stand_ins = embedded / f"lib/python{PYTHON_VERSION}/site-packages"

    def run(*words: str, before: str = "", after: str = "") -> str:
        ran = subprocess.run(
            [sys.executable, "-c", CALL, *words],
            cwd=tmp_path / "package",
            env={"PATH": str(tmp_path / "bin"), "PYTHONPATH": f"{before}:{stand_ins}:{after}"},
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
        return ran.stdout.strip()

    return run


def program(path: Path, text: str) -> None:
    """Write an executable script."""
    path.write_text(text, encoding="utf-8")
    path.chmod(0o755)


@pytest.mark.parametrize(
    ("tool", "name"),
    [
        ("ament_copyright", "ament_copyright"),
        ("ament_flake8", "flake8"),
        ("ament_pep257", "pydocstyle"),
        ("ament_xmllint", "xmllint"),
        ("ament_black", "black"),
    ],
)
def test_missing_linters_skip_their_tests(call: Callable[..., str], tool: str, name: str) -> None:
    assert call(tool, "main", ".", "test") == f"skipped: {name} is not installed"


def test_an_installed_linter_runs_on_the_files_of_the_package(
    call: Callable[..., str], tmp_path: Path
) -> None:
    program(tmp_path / "bin/flake8", COMPLAINT)
    program(tmp_path / "bin/black", "#!/bin/sh\nexit 0\n")
    file = "test/test_it.py"
    assert call("ament_flake8", "main_with_errors", "--linelength", "120").endswith(
        f"(1, ['{file}:3:1: too long'])"
    )
    assert call("ament_flake8", "main", "test", "--exclude", file).endswith("0")
    assert call("ament_black", "main", ".", "--config", "black.toml").endswith("0")


def test_the_linter_of_ament_gets_the_same_arguments(call: Callable[..., str], tmp_path: Path) -> None:
    program(tmp_path / "bin/ament_copyright", '#!/bin/sh\necho "checks $@"\nexit 3\n')
    assert call("ament_copyright", "main", ".", "test") == "checks . test\n3"


@pytest.mark.parametrize("order", ["before", "after"])
def test_the_module_of_ament_takes_precedence(call: Callable[..., str], tmp_path: Path, order: str) -> None:
    real = tmp_path / "ros/ament_mypy"
    real.mkdir(parents=True)
    (real / "__init__.py").touch()
    (real / "main.py").write_text("def main(argv):\n    return 'real'\n", encoding="utf-8")
    assert call("ament_mypy", "main", **{order: str(tmp_path / "ros")}) == "real"
