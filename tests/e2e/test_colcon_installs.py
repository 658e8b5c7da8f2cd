"""forge and colcon build the same packages: the install trees and what their scripts do are the same.

docs/reference/from-colcon.md lists which files are meant to differ.
"""

import itertools
import os
import random
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Protocol

import pytest

from tests.conftest import Forge
from tests.listed_differences import ListedDifferences
from tests.packages import manifest_text
from tests.peers import Colcon
from tests.random_installs import TYPES, random_installs
from tests.snippets import ROOT

pytestmark = [pytest.mark.slow, pytest.mark.needs("colcon", "cmake", "ninja", "bash", "zsh")]

AMENT = """cmake_minimum_required(VERSION 3.18)
project(below NONE)
find_package(ament_cmake REQUIRED)
install(DIRECTORY lib DESTINATION .)
ament_export_libraries(below)
ament_package()
"""
FORMS = {"isolated": (), "merged": ("--merge-install",), "linked": ("--symlink-install",)}
LINKED = ("cmake", "ament_cmake")
"""The build types of which a linked tree can be compared; for Python colcon needs an old setuptools."""
CASES = (("isolated", 0), ("isolated", 1), ("merged", 2), ("linked", 3))
PAGE = ListedDifferences("Files of an install tree")


@pytest.fixture(scope="module")
def surroundings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Build an underlay with forge's own ament, and source it as people do."""
    root = tmp_path_factory.mktemp("under") / "below"
    for name, text in {
        "src/below/package.xml": manifest_text("below", "<depend>ament_cmake</depend>"),
        "src/below/CMakeLists.txt": AMENT,
        "src/below/lib/libbelow.so": "",
    }.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    home = tmp_path_factory.mktemp("home")
    variables = {"PATH": os.environ["PATH"], "HOME": str(home), "PYTHONDONTWRITEBYTECODE": "1"}
    built = subprocess.run(
        [sys.executable, "-m", "forge", "build"],
        cwd=root,
        env={**variables, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    return sourced(root / "install/setup.sh", "sh", variables)


class Both(Protocol):
    """What the fixture `both` gives."""

    def __call__(self, root: Path, *options: str) -> tuple[Path, Path]:
        """Build a workspace with both; returns the folders with the build and install folders of each."""


@pytest.fixture(scope="module")
def colcon(surroundings: dict[str, str]) -> Iterator[Colcon]:
    running = Colcon({**surroundings, "COLCON_LOG_PATH": "/dev/null"})
    yield running
    running.end()


@pytest.fixture
def both(colcon: Colcon, forge: Forge, surroundings: dict[str, str]) -> Both:
    def build(root: Path, *options: str) -> tuple[Path, Path]:
        homes = root / "ours", root / "theirs"
        for home in homes:
            argv = ["build", "--build-base", f"{home}/build", "--install-base", f"{home}/install", *options]
            if home == homes[0]:
                ran = forge(*argv, "--python", colcon.python, cwd=root, env=surroundings)
            else:
                ran = colcon(*argv, cwd=root)
            assert ran.code == 0, ran.err
        return homes

    return build


@pytest.mark.parametrize(("form", "seed"), CASES)
def test_install_trees_and_their_scripts_are_equivalent(
    both: Both, tmp_path: Path, form: str, seed: int
) -> None:
    # No blank in the path: colcon's own scripts cannot be sourced then.
    root = tmp_path / f"{form}{seed}"
    for name, text in random_installs(random.Random(seed), LINKED if form == "linked" else TYPES):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
        (root / name).chmod(0o755 if text.startswith("#!") else 0o644)
    ours, theirs = both(root, *FORMS[form])
    assert differing_files(ours / "install", theirs / "install") == []
    assert differing_variables(ours, theirs) == {}


def differing_files(ours: Path, theirs: Path) -> list[str]:
    """Return the files that one tree lacks or that say something else, but for those on the page."""
    found = contents(ours), contents(theirs)
    lines = []
    for name in sorted(found[0].keys() | found[1].keys()):
        texts = [texts.get(name) for texts in found]
        if name.endswith("/package.dsv"):
            # It names the hooks that there are.
            texts = [shared_lines(text or "", name, found) for text in texts]
        if texts[0] != texts[1]:
            who = "colcon" if texts[0] is None else "forge" if texts[1] is None else "both"
            if not PAGE.explain(name, who):
                lines.append(f"{name}: {who}")
    return lines


def contents(install: Path) -> dict[str, str]:
    """Return what each file says and if it can be run; the place of the tree is left out."""
    found = {}
    for path in install.rglob("*"):
        if path.is_file() and "__pycache__" not in path.parts:
            text = without_noise(path.read_text(errors="replace"))
            runs = "may run\n" if os.access(path, os.X_OK) else ""
            name = path.relative_to(install).as_posix()
            # SOURCES.txt of setuptools has the relative path of the build folder.
            home = install.parent
            found[name] = f"{runs}{text}".replace(str(home), "HOME").replace(f"/{home.name}/", "/HOME/")
    return found


def without_noise(text: str) -> str:
    """Return what counts of a file: not which interpreter, nor how an entry point is called."""
    text = re.sub(r"^#!/.*/python3?\n", "#!python\n", text)
    return text.partition("\n")[0] if text.startswith("#!python") and "sys.exit(" in text else text


def shared_lines(text: str, name: str, found: tuple[Mapping[str, str], Mapping[str, str]]) -> str:
    """Return the lines of a package.dsv that name files which both trees have."""
    prefix = name.partition("share/")[0]
    return "\n".join(
        line
        for line in text.splitlines()
        if all(f"{prefix}{line.partition(';')[2]}" in files for files in found)
    )


def test_documented_file_differences_exist() -> None:
    """Runs after the trees were compared: each line was needed by one of them."""
    if not PAGE.used:
        pytest.skip("the trees were not compared in this run")
    assert PAGE.unused == set()


def differing_variables(ours: Path, theirs: Path) -> dict[str, object]:
    """Return the variables that sourcing the two trees sets to different values, by script and shell."""
    found: dict[str, object] = {}
    for shell, name in itertools.product(("sh", "bash", "zsh"), ("setup", "local_setup")):
        pair = []
        for home in (ours, theirs):
            script = home / "install" / f"{name}.{shell}"
            seen = sourced(script, shell, {"PATH": os.environ["PATH"], "HOME": "/"})
            pair.append({key: value.replace(str(home), "HOME") for key, value in told(seen).items()})
        for key in sorted(pair[0].keys() | pair[1].keys()):
            values = [variables.get(key) for variables in pair]
            if values[0] != values[1]:
                found[f"{name}.{shell} {key}"] = values
    return found


def told(variables: Mapping[str, str]) -> dict[str, str]:
    """Return the variables without the two differences that the page tells of."""
    kept = {name: value for name, value in variables.items() if not name.startswith("SCRIPT_")}
    entries = [entry for entry in kept.pop("PKG_CONFIG_PATH", "").split(":") if os.path.isdir(entry)]  # noqa: PTH112
    return {**kept, "PKG_CONFIG_PATH": ":".join(entries)}


def sourced(script: Path, shell: str, variables: Mapping[str, str]) -> dict[str, str]:
    """Return what a shell exports once it has sourced a script."""
    argv = [shell, "-c", f". {shlex.quote(str(script))} && env -0"]
    text = subprocess.run(argv, env=variables, capture_output=True, text=True, check=True, cwd="/").stdout
    pairs = (line.partition("=") for line in text.split("\0") if line)
    return {name: value for name, _, value in pairs if name not in {"_", "SHLVL", "PWD", "OLDPWD"}}
