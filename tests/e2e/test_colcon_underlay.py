"""A workspace of forge above one of colcon, and the other way round: each is the other's underlay."""

import itertools
import os
import shlex
import subprocess
from pathlib import Path

import pytest

from forge.environment.sourcing import sourced_environment
from tests.conftest import Forge
from tests.e2e.test_colcon_installs import told
from tests.packages import manifest_text, write_files
from tests.peers import Colcon

pytestmark = [pytest.mark.slow, pytest.mark.needs("colcon", "cmake", "bash", "zsh", "dash", "fish")]

CMAKE = """cmake_minimum_required(VERSION 3.18)
project({name} NONE)
{find}
file(WRITE ${{CMAKE_BINARY_DIR}}/lib{name}.so "")
file(WRITE ${{CMAKE_BINARY_DIR}}/{name}-config.cmake "set({name}_WORD found)\\n")
install(FILES ${{CMAKE_BINARY_DIR}}/lib{name}.so DESTINATION lib)
install(FILES ${{CMAKE_BINARY_DIR}}/{name}-config.cmake DESTINATION lib/cmake/{name})
install(PROGRAMS package.xml DESTINATION bin RENAME {name}_tool)
install(FILES package.xml DESTINATION share/{name})
"""
SETUP = """from setuptools import setup
setup(name="{name}", version="0.1.0", py_modules=["{name}"], zip_safe=True, data_files=[
    ("share/ament_index/resource_index/packages", ["resource/{name}"]), ("share/{name}", ["package.xml"])])
"""
FIND = (
    'find_package(low REQUIRED)\nif(NOT low_WORD STREQUAL "found")\n  message(FATAL_ERROR "no low")\nendif()'
)
WORKSPACES = {
    "below": {
        "src/low/package.xml": manifest_text("low", build_type="cmake"),
        "src/low/CMakeLists.txt": CMAKE.format(name="low", find=""),
        "src/low_py/package.xml": manifest_text("low_py", "<depend>low</depend>", build_type="ament_python"),
        "src/low_py/setup.py": SETUP.format(name="low_py"),
        "src/low_py/low_py.py": "WORD = 'below'\n",
        "src/low_py/resource/low_py": "",
    },
    "above": {
        "src/top/package.xml": manifest_text(
            "top", "<depend>low</depend>", "<exec_depend>low_py</exec_depend>", build_type="cmake"
        ),
        "src/top/CMakeLists.txt": CMAKE.format(name="top", find=FIND),
        "src/top_py/package.xml": manifest_text("top_py", "<depend>top</depend>", build_type="ament_python"),
        "src/top_py/setup.py": SETUP.format(name="top_py"),
        "src/top_py/top_py.py": "from low_py import WORD\n",
        "src/top_py/resource/top_py": "",
    },
}
SHELLS = {
    "sh": ("dash", "-c"),
    "bash": ("bash", "-c"),
    "zsh": ("zsh", "-fc"),
    "fish": ("fish", "--no-config", "-c"),
}
_SHELL_S_OWN = {"_", "SHLVL", "PWD", "OLDPWD", "USER"}


def sourced(script: Path, shell: str, before: dict[str, str]) -> dict[str, str]:
    """Return what a shell that has sourced a script gives to programs."""
    word = "source" if shell == "fish" else "."
    argv = [
        *SHELLS[shell],
        f"{word} {shlex.quote(str(script))}; and env -0".replace("; and", ";" if shell == "fish" else " &&"),
    ]
    done = subprocess.run(argv, env=before, capture_output=True, text=True, check=True, cwd="/")
    assert done.stderr == ""
    pairs = (item.partition("=") for item in done.stdout.split("\0") if item)
    return {name: value for name, _, value in pairs if name not in _SHELL_S_OWN}


def build(tool: str, root: Path, variables: dict[str, str], forge: Forge) -> None:
    """Build a workspace with one of the two, in the environment of its underlay."""
    if tool == "forge":
        ran = forge("build", cwd=root, env=variables)
    else:
        colcon = Colcon({**variables, "COLCON_LOG_PATH": "/dev/null"})
        ran = colcon("build", cwd=root)
        colcon.end()
    assert ran.code == 0, ran.out + ran.err


def test_forge_and_colcon_workspaces_can_be_each_others_underlays(forge: Forge, tmp_path: Path) -> None:
    """For each pair of tools: shells see the same environment, and forge finds it unsourced."""
    plain = {"PATH": os.environ["PATH"], "HOME": str(tmp_path), "LOGNAME": "someone"}
    seen: dict[tuple[str, str, str], dict[str, str]] = {}
    for below, above in itertools.product(("forge", "colcon"), repeat=2):
        home = tmp_path / f"{above}_on_{below}"
        for workspace, files in WORKSPACES.items():
            write_files(home / workspace, files)
        build(below, home / "below", plain, forge)
        build(above, home / "above", sourced(home / "below/install/setup.sh", "sh", plain), forge)
        for shell in SHELLS:
            script = home / f"above/install/setup.{shell}"
            if shell == "fish" and above == "colcon":
                continue
            after = sourced(script, shell, plain)
            if above == "forge":
                assert after == sourced_environment(home / "above/install", plain), shell
            seen[shell, below, above] = {k: v.replace(str(home), "ROOT") for k, v in told(after).items()}
            argv = ["python3", "-c", "import top_py; print(top_py.WORD)"]
            said = subprocess.run(argv, env=after, capture_output=True, text=True, check=True)
            assert said.stdout == "below\n"
    expected = seen["bash", "forge", "forge"]
    assert expected["COLCON_PREFIX_PATH"] == "ROOT/above/install:ROOT/below/install"
    assert [line for key, after in seen.items() for line in differing(" ".join(key), after, expected)] == []


def differing(who: str, after: dict[str, str], expected: dict[str, str]) -> list[str]:
    """Return a line for each variable that is not as expected."""
    names = sorted(after.keys() | expected.keys())
    return [
        f"{who} {name}: {after.get(name)}, not {expected.get(name)}"
        for name in names
        if after.get(name) != expected.get(name)
    ]
