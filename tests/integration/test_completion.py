"""Shells complete what is typed after `forge`."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from forge.cli import main as cli
from forge.cli.completion_words import main, package_names
from tests.packages import manifest_text

if TYPE_CHECKING:
    from tests.conftest import Forge, Tree

PROGRAM = Path(cli.__file__).with_name("completion_words.py")

BASH = """source ./script
COMP_WORDS=({words}) COMP_CWORD={last}
_forge
printf '%s\\n' "${{COMPREPLY[@]}}"
"""
ZSH = """compdef() {{ : }}
compadd() {{ shift; printf '%s\\n' "$@" }}
_files() {{ print files }}
source ./script
words=({words}) CURRENT={count}
_forge
"""
FISH = """source ./script
complete -C {line} | string split -f1 \\t
"""


@pytest.fixture
def workspace(tree: Tree) -> Path:
    """Return a workspace of two packages, and one that is ignored."""
    return tree(
        {
            "src/alpha/package.xml": manifest_text("alpha"),
            "src/group/folder/package.xml": manifest_text("beta"),
            "src/ignored/package.xml": manifest_text("gamma"),
            "src/ignored/COLCON_IGNORE": "",
            "src/plain/CMakeLists.txt": "# nothing\nProject( plain_cmake CXX)\n",
            "src/python/setup.py": "from setuptools import setup\n",
            ".git/x/package.xml": "<name>hidden</name>",
        }
    )


def offered(forge: Forge, folder: Path, shell: str, *words: str) -> list[str]:
    """Return what a shell offers for the last of the words."""
    (folder / "script").write_text(forge("completion", shell).out)
    words = ("forge", *words)
    quoted = " ".join(map(shlex.quote, words))
    text = {"bash": BASH, "zsh": ZSH, "fish": FISH}[shell].format(
        words=quoted, last=len(words) - 1, count=len(words), line=shlex.quote(" ".join(words))
    )
    options = {"bash": ["--norc"], "zsh": ["-f"], "fish": ["--no-config"]}[shell]
    variables = {**os.environ, "XDG_CACHE_HOME": str(folder / "cache")}
    done = subprocess.run(
        [shell, *options, "-c", text], cwd=folder, env=variables, capture_output=True, text=True, check=False
    )
    assert done.stderr == ""
    return [line for line in done.stdout.splitlines() if line and line.startswith(words[-1])]


NAMES = ["alpha", "beta", "plain_cmake", "python"]


@pytest.mark.parametrize(
    "shell", [pytest.param(shell, marks=pytest.mark.needs(shell)) for shell in ("bash", "zsh", "fish")]
)
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("comp",), ["completion"]),
        (("build", "--symlink-i"), ["--symlink-install"]),
        (("build", "--packages-select", ""), NAMES),
        (("build", "--packages-select", "alpha", "be"), ["beta"]),
        (("build", "--packages-select", "alpha", "--executor", ""), ["dask", "parallel", "sequential"]),
        (("--log-base", "build", "test-r"), ["test-result"]),
        (("clean", "st"), ["stale"]),
        (("clean", "packages", "alpha", "p"), ["plain_cmake", "python"]),
        (("clean", "workspace", "--base-select", ""), ["build", "install", "log"]),
        (("pkg", "cr"), ["create"]),
        (("pkg", "create", "--build-t"), ["--build-type"]),
        (("test", "--event-handlers", "console_s"), ["console_start_end-", "console_stderr-"]),
    ],
)
def test_the_words_that_fit_are_offered(
    forge: Forge, workspace: Path, shell: str, words: tuple[str, ...], expected: list[str]
) -> None:
    found = offered(forge, workspace, shell, *words)
    if not words[-1]:
        found = [word for word in found if not word.startswith("-")]
    assert sorted(found) == sorted(expected)


@pytest.mark.parametrize(
    "shell", [pytest.param(shell, marks=pytest.mark.needs(shell)) for shell in ("bash", "zsh", "fish")]
)
def test_what_is_installed_is_offered_to_run(
    forge: Forge, tree: Tree, monkeypatch: pytest.MonkeyPatch, shell: str
) -> None:
    root = tree(
        {
            "i/share/ament_index/resource_index/packages/walker": "",
            "i/lib/walker/walk": "#!/bin/sh\n",
            "i/lib/walker/notes": "",
        }
    )
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(root / "i"))
    assert offered(forge, root, shell, "run", "wal") == ["walker"]
    assert offered(forge, root, shell, "run", "walker", "wa") == ["walk"]
    assert offered(forge, root, shell, "pkg", "prefix", "wa") == ["walker"]


@pytest.mark.needs("bash")
def test_folders_are_the_shells_to_find(forge: Forge, workspace: Path) -> None:
    assert offered(forge, workspace, "bash", "build", "--build-base", "sr") == ["src"]
    assert offered(forge, workspace, "bash", "-C", "sr") == ["src"]


def test_names_are_those_of_today(workspace: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    assert sorted(package_names(workspace, cache)) == NAMES
    stamp = next(cache.iterdir()).stat().st_mtime_ns
    assert sorted(package_names(workspace, cache)) == NAMES
    assert next(cache.iterdir()).stat().st_mtime_ns == stamp
    (workspace / "src/alpha/package.xml").write_text(manifest_text("aleph"))
    (workspace / "src/python/setup.py").unlink()
    assert sorted(package_names(workspace, cache)) == ["aleph", "beta", "plain_cmake"]
    next(cache.iterdir()).write_text("torn\nx\ty\tz\n")
    assert sorted(package_names(workspace, cache)) == ["aleph", "beta", "plain_cmake"]
    assert sorted(package_names(workspace, workspace / "src/alpha/package.xml")) == [
        "aleph",
        "beta",
        "plain_cmake",
    ]
    assert sorted(package_names(workspace, None)) == ["aleph", "beta", "plain_cmake"]


def test_installed_names_and_programs_are_found(tree: Tree, capsys: pytest.CaptureFixture[str]) -> None:
    root = tree(
        {
            "i/share/ament_index/resource_index/packages/walker": "",
            "i/share/ament_index/resource_index/packages/.hidden": "",
            "i/lib/walker/walk": "#!/bin/sh\n",
            "i/lib/walker/.git/hook": "#!/bin/sh\n",
            "i/lib/walker/notes": "",
        }
    )
    variables = {"AMENT_PREFIX_PATH": f"{root}/i:/nowhere:"}
    assert main(["installed"], variables) == 0
    assert main(["executables", "walker"], variables) == 0
    assert capsys.readouterr().out == "walker\nwalk\n"


def test_packages_are_those_of_the_workspace_around(
    workspace: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(workspace / "src/group")
    (workspace / "src/loop").symlink_to(workspace / "src")
    (workspace / "src/broken").symlink_to(workspace / "gone")
    assert main(["packages"], {"HOME": str(workspace / "home")}) == 0
    assert capsys.readouterr().out.split() == NAMES
    assert main(["packages"], {"HOME": "nowhere"}) == 0
    assert capsys.readouterr().out.split() == NAMES


def test_unknown_completions_print_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([], {}) == 0
    assert main(["installed"], {"AMENT_PREFIX_PATH": "/nowhere"}) == 0
    assert capsys.readouterr().out == ""


def test_an_answer_takes_less_than_a_tenth_of_a_second(tree: Tree) -> None:
    """Measured as time of the processor, the best of three."""
    root = tree({f"src/g{n % 10}/p{n}/package.xml": manifest_text(f"p{n}") for n in range(200)})
    argv = [sys.executable, "-S", "-E", str(PROGRAM), "packages"]
    seconds = []
    for _ in range(3):
        before = os.times()
        started = time.monotonic()
        done = subprocess.run(
            argv,
            cwd=root,
            env={"XDG_CACHE_HOME": str(root / "cache")},
            capture_output=True,
            text=True,
            check=True,
        )
        after = os.times()
        assert len(done.stdout.split()) == 200
        used = after.children_user + after.children_system - before.children_user - before.children_system
        seconds.append(min(used, time.monotonic() - started))
    assert min(seconds) < 0.1
