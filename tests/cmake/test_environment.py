"""Environment hooks: installed, described as data, and harmless in strict shells."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from .conftest import Project, projects_in

pytestmark = [pytest.mark.needs("cmake"), pytest.mark.needs("ninja")]

HOOKS = {
    "greet.sh.in": (
        "ament_append_value GREETING @PROJECT_NAME@\nament_append_unique_value GREETING @PROJECT_NAME@\n"
    ),
    "only.bash": "export ONLY_BASH=1\n",
    "data.dsv": "set;DATA;1\n",
}


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory, embedded: Path) -> Project:
    """Install a package with hooks of every sort."""
    return projects_in(tmp_path_factory.mktemp("hooks"), embedded)(
        'set(AMENT_CMAKE_ENVIRONMENT_HOOKS_DESC_greet "append-non-duplicate;GREETING;demo")\n'
        "ament_environment_hooks(greet.sh.in only.bash data.dsv)\n"
        'ament_environment_hooks("${ament_cmake_package_templates_ENVIRONMENT_HOOK_LIBRARY_PATH}")\n'
        'ament_environment_hooks("${ament_cmake_package_templates_ENVIRONMENT_HOOK_LIBRARY_PATH}")\n'
        "ament_package()\ninstall(FILES package.xml DESTINATION bin)",
        files=HOOKS,
    ).install()


def source(shell: str, project: Project, *, times: int = 1, first: str = "set -eu") -> dict[str, str]:
    """Source the package's setup file and return the environment."""
    file = project.prefix / "share/demo" / f"local_setup.{shell}"
    script = f"{first}\n" + f'. "{file}"\n' * times + "env -0"
    argv = [shell, "-c", script]
    done = subprocess.run(argv, env={"PATH": "/usr/bin:/bin"}, capture_output=True, text=True, check=True)
    return dict(line.split("=", 1) for line in done.stdout.split("\0") if "=" in line)


def test_hooks_are_installed_and_listed(demo: Project) -> None:
    folder = "share/demo/environment"
    assert demo.read(f"{folder}/greet.sh").startswith("ament_append_value GREETING demo")
    assert demo.read(f"{folder}/greet.dsv") == "append-non-duplicate;GREETING;demo\n"
    assert demo.read(f"{folder}/library_path.dsv") == "prepend-non-duplicate;LD_LIBRARY_PATH;lib\n"
    assert demo.read("share/demo/local_setup.dsv").splitlines() == [
        *(f"source;{folder}/{name}" for name in ("ament_prefix_path.sh", "greet.sh", "library_path.sh")),
        *(f"source;{folder}/{name}" for name in ("only.bash", "path.sh", "data.dsv")),
    ]
    shells = ("bash", "dsv", "sh", "zsh")
    assert demo.read("share/demo/package.dsv").splitlines() == [
        f"source;share/demo/local_setup.{s}" for s in shells
    ]


@pytest.mark.parametrize(
    "shell", [pytest.param(s, marks=pytest.mark.needs(s)) for s in ("sh", "bash", "zsh")]
)
def test_hooks_can_be_sourced_twice_in_strict_shells(demo: Project, shell: str) -> None:
    variables = source(shell, demo, times=2)
    prefix = str(demo.prefix)
    assert variables["AMENT_PREFIX_PATH"] == prefix
    assert variables["PATH"] == f"{prefix}/bin:/usr/bin:/bin"
    assert variables["LD_LIBRARY_PATH"] == f"{prefix}/lib"
    assert variables["GREETING"] == "demo:demo"
    assert ("ONLY_BASH" in variables) == (shell == "bash")
    assert not {name for name in variables if name.startswith("AMENT_")} - {"AMENT_PREFIX_PATH"}


@pytest.mark.needs("bash")
def test_hooks_can_be_collected_without_running_them(demo: Project) -> None:
    first = "AMENT_RETURN_ENVIRONMENT_HOOKS=1; export AMENT_ENVIRONMENT_HOOKS="
    hooks = source("sh", demo, first=first)["AMENT_ENVIRONMENT_HOOKS"]
    assert [path.rsplit("/", 1)[1] for path in hooks.split(":")] == [
        "ament_prefix_path.sh",
        "greet.sh",
        "library_path.sh",
        "path.sh",
    ]
