"""Shells complete what is typed after `forge`."""

import os
import pty
import re
import select
import shlex
import subprocess
import sys
import time
from pathlib import Path

import pytest

from forge.plugins.completion.words import main, package_names
from tests.conftest import Forge, Tree
from tests.packages import manifest_text
from tests.snippets import ROOT

INDEX = "share/ament_index/resource_index"

BASH = (
    "source ./script\n",
    "COMP_WORDS=({words}) COMP_CWORD={last}\n_forge\nprintf '%s\\n' \"${{COMPREPLY[@]}}\"\n",
)
ZSH_STUBS = """compdef() { : }
compset() { : }
compadd() { shift; printf '%s\\n' "$@" }
_files() { print files }
"""
ZSH = (f"{ZSH_STUBS}source ./script\n", "words=({words}) CURRENT={count}\n_forge\n")
FISH = ("source ./script\n", "complete -C {line} | string split -f1 \\t\n")
"""What each shell has to read first, and for every question."""


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
            "forge.toml": "[profiles.robot.build]\n[profiles.simulation.build]\n",
            "home/.colcon/mixin/mine.mixin": "build:\n  release-fast: {}\ntest:\n  relaxed: {}\n",
            "install/.colcon_install_layout": "isolated\n",
            f"install/alpha/{INDEX}/packages/alpha": "",
            f"install/alpha/{INDEX}/rosidl_interfaces/alpha": "",
            "install/alpha/share/alpha/msg/Height.msg": "float32 metres\n",
            "install/alpha/share/alpha/srv/Raise.srv": "---\n",
            "install/alpha/share/alpha/srv/Raise_Request.msg": "",
            "install/alpha/lib/alpha/climb": "#!/bin/sh\n",
            "venv/pyvenv.cfg": "",
            "venv/x/package.xml": "<name>installed</name>",
            "web/node_modules/x/package.xml": "<name>installed</name>",
            "home/.colcon/mixin_repositories.yaml": "team: https://example.org\ntest-bench: file:///x\n",
        }
    )


def offered(forge: Forge, folder: Path, shell: str, *lines: tuple[str, ...]) -> list[list[str]]:
    """Return what a shell offers for the last word of each line, without the part up to '='."""
    (folder / "script").write_text(forge("completion", shell).out)
    text, question = {"bash": BASH, "zsh": ZSH, "fish": FISH}[shell]
    for line in lines:
        words = ["forge", *line]
        if shell == "bash":
            words = [part for word in words for part in re.split("(=)", word) if part or word == ""]
        quoted = shlex.join(words)
        text += question.format(
            words=quoted, last=len(words) - 1, count=len(words), line=shlex.quote(" ".join(words))
        )
        text += "echo END\n"
    options = {"bash": ["--norc"], "zsh": ["-f"], "fish": ["--no-config"]}[shell]
    variables = {**os.environ, "HOME": str(folder / "home")}
    done = subprocess.run(
        [shell, *options, "-c", text], cwd=folder, env=variables, capture_output=True, text=True, check=False
    )
    assert done.stderr == ""
    answers = [answer.split("\n") for answer in done.stdout.split("END\n")]
    values = ([word.rpartition("=")[2] for word in answer if word] for answer in answers)
    begins = (line[-1].rpartition("=")[2] for line in lines)
    return [
        sorted(word for word in words if word.startswith(begin))
        for begin, words in zip(begins, values, strict=False)
    ]


NAMES = ["alpha", "beta", "plain_cmake", "python"]


EVERY_SHELL = pytest.mark.parametrize(
    "shell", [pytest.param(shell, marks=pytest.mark.needs(shell)) for shell in ("bash", "zsh", "fish")]
)
PROFILES = ["asan", "debug", "release", "robot", "simulation", "tsan", "ubsan"]

OFFERS: dict[tuple[str, ...], list[str]] = {
    ("comp",): ["completion"],
    ("build", "--symlink-i"): ["--symlink-install"],
    ("build", "--packages-select", ""): NAMES,
    ("build", "--packages-select", "alpha", "be"): ["beta"],
    ("build", "--packages-select", "alpha", "--executor", ""): ["dask", "parallel", "sequential"],
    ("--log-base", "build", "test-r"): ["test-result"],
    ("clean", "st"): ["stale"],
    ("clean", "packages", "alpha", "p"): ["plain_cmake", "python"],
    ("clean", "workspace", "--base-select", ""): ["build", "install", "log"],
    ("pkg", "cr"): ["create"],
    ("mixin", "update", "te"): ["team", "test-bench"],
    ("pkg", "create", "--build-t"): ["--build-type"],
    ("pkg", "create", "--build-type", "ament_c"): ["ament_cmake"],
    ("test", "--event-handlers", "console_s"): ["console_start_end-", "console_stderr-"],
    ("interface", "show", "alpha/"): ["alpha/msg/Height", "alpha/srv/Raise"],
    ("interface", "hash", "std_srvs/srv/E"): ["std_srvs/srv/Empty"],
    ("interface", "package", "al"): ["alpha"],
    ("pkg", "xml", "al"): ["alpha"],
    ("run", "alpha", "cl"): ["climb"],
    ("build", "--mixin", "debug", "rele"): ["release", "release-fast"],
    ("test", "--mixin", "re"): ["relaxed"],
    ("build", "--profile", ""): PROFILES,
    ("build", "--profile=ro"): ["robot"],
    ("build", "--profile="): PROFILES,
    ("build", "--cmake-args", "-DX=1", "-DCMAKE_BUILD_TYPE=M"): ["MinSizeRel"],
    ("build", "--cmake-args", "-DX", "--mixin-"): ["--mixin-files"],
    ("build", "--cmake-args", "--job"): [],
    ("build", "--cmake-args", "--jobs", "-DX", "-DCMAKE_BUILD_TYPE=M"): ["MinSizeRel"],
    ("build", "--cmake-args", "-DX", "--merge-install", "--jo"): ["--jobs"],
    ("test", "--pytest-args", "--strict", "x", "--st"): [],
    ("test", "--pytest-args", "--strict", "--packages-select", "be"): ["beta"],
    ("test", "--pytest-args", "--strict", "--packages-select=be"): ["beta"],
}


@EVERY_SHELL
def test_matching_words_are_completed(forge: Forge, workspace: Path, shell: str) -> None:
    found = offered(forge, workspace, shell, *OFFERS)
    plain = [
        answer if words[-1] else [word for word in answer if not word.startswith("-")]
        for words, answer in zip(OFFERS, found, strict=True)
    ]
    assert dict(zip(OFFERS, plain, strict=True)) == OFFERS


@EVERY_SHELL
def test_installed_programs_are_completed_for_run(
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
    lines = (("run", "wal"), ("run", "walker", "wa"), ("pkg", "prefix", "wa"))
    assert offered(forge, root, shell, *lines) == [["walker"], ["walk"], ["walker"]]


ZSH_BEGIN = "autoload -Uz compinit; compinit -D -u; zstyle ':completion:*' insert-tab false\n"
STARTED = {"bash": (["bash", "--norc", "-i"], ""), "zsh": (["zsh", "-f", "-i"], ZSH_BEGIN)}


@pytest.mark.parametrize("first", ["alias", "script"])
@pytest.mark.parametrize("shell", [pytest.param(shell, marks=pytest.mark.needs(shell)) for shell in STARTED])
def test_an_alias_is_completed_in_a_terminal(forge: Forge, workspace: Path, shell: str, first: str) -> None:
    """`alias colcon=forge` may be defined before or after the script is read."""
    (workspace / "script").write_text(forge("completion", shell).out)
    argv, begin = STARTED[shell]
    lines = ["source ./script", "alias colcon=forge"]
    setup = "\n".join(lines if first == "script" else reversed(lines))
    typed = "colcon build --mixin release-\tx --profile=sim\ty\n"
    text = f"{begin}{setup}\nforge() {{ printf '<%s>' \"$@\"; }}\n{typed}"
    seen = in_terminal(argv, workspace, text, until="<y>")
    assert "<build><--mixin><release-fast><x><--profile=simulation><y>" in seen


@pytest.mark.needs("fish")
def test_an_alias_is_completed_in_fish(forge: Forge, workspace: Path) -> None:
    text = forge("completion", "fish").out
    (workspace / "script").write_text(f"{text}\nalias colcon=forge\ncomplete -C 'colcon buil'\n")
    argv = ["fish", "--no-config", "script"]
    done = subprocess.run(argv, cwd=workspace, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["build", "build", "the", "packages", "of", "a", "workspace"]


@pytest.mark.needs("bash")
def test_the_completion_of_a_real_colcon_is_kept(forge: Forge, workspace: Path) -> None:
    """Only an alias is completed as forge."""
    (workspace / "script").write_text(forge("completion", "bash").out)
    argv = ["bash", "--norc", "-c", "complete -W own colcon; source ./script; complete -p colcon"]
    done = subprocess.run(argv, cwd=workspace, capture_output=True, text=True, check=True)
    assert done.stdout == "complete -W 'own' colcon\n"


def in_terminal(argv: list[str], folder: Path, text: str, until: str) -> str:
    """Type a text into a shell and return what its terminal shows up to some words, within a minute."""
    ours, theirs = pty.openpty()
    variables = {**os.environ, "TERM": "dumb", "HOME": str(folder / "home"), "PS1": "> "}
    seen, end = b"", time.monotonic() + 60
    with subprocess.Popen(
        argv, cwd=folder, stdin=theirs, stdout=theirs, stderr=theirs, env=variables
    ) as shell:
        os.write(ours, text.encode())
        while until.encode() not in seen and time.monotonic() < end:
            if select.select([ours], [], [], 0.1)[0]:
                seen += os.read(ours, 65536)
        shell.kill()
    os.close(ours)
    os.close(theirs)
    return seen.decode(errors="replace")


@pytest.mark.needs("bash")
def test_paths_are_completed_by_the_shell(forge: Forge, workspace: Path) -> None:
    lines = (("build", "--build-base", "sr"), ("-C", "sr"), ("build", "--install-base=sr"))
    assert offered(forge, workspace, "bash", *lines) == [["src"], ["src"], ["src"]]


def test_completion_uses_current_package_names(workspace: Path) -> None:
    assert sorted(package_names(str(workspace))) == NAMES
    (workspace / "src/loop").symlink_to(workspace / "src")
    (workspace / "src/broken").symlink_to(workspace / "gone")
    (workspace / "src/alpha/package.xml").write_text(manifest_text("aleph"))
    (workspace / "src/python/setup.py").unlink()
    assert sorted(package_names(str(workspace))) == ["aleph", "beta", "plain_cmake"]


def test_programs_of_plain_packages_are_found(
    tree: Tree, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    root = tree(
        {
            "install/.colcon_install_layout": "isolated\n",
            "install/plain/share/colcon-core/packages/plain": "",
            "install/plain/bin/walk": "#!/bin/sh\n",
            "install/plain/lib/plain/run": "#!/bin/sh\n",
            "i/share/ament_index/resource_index/packages/walker": "",
        }
    )
    monkeypatch.chdir(root)
    variables = {"AMENT_PREFIX_PATH": f"{root}/i"}
    assert [main(words, variables) for words in (["runnable"], ["executables", "plain"])] == [0, 0]
    assert capsys.readouterr().out == "plain\nwalker\nrun\nwalk\n"
    assert main(["installed"], variables) == 0
    assert capsys.readouterr().out == "walker\n"


def test_packages_of_the_workspace_and_of_forge_are_completed(
    workspace: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(workspace / "src")
    variables = {"COLCON_HOME": str(workspace / "home/.colcon")}
    asked = {}
    for kind in ("installed", "interfaces", "interface_packages", "mixins", "profiles"):
        assert main([kind, "build"], variables) == 0
        asked[kind] = capsys.readouterr().out.split()
    assert asked["installed"] == ["alpha"]
    assert {"alpha/msg/Height", "alpha/srv/Raise", "std_msgs/msg/String"} <= set(asked["interfaces"])
    assert not any("_Request" in name for name in asked["interfaces"])
    assert {"alpha", "std_msgs"} <= set(asked["interface_packages"])
    assert "ament_cmake" not in asked["interface_packages"]
    assert {"debug", "release-fast"} <= set(asked["mixins"])
    assert sorted(asked["profiles"]) == PROFILES


CHANGES = """cd {root}/src/group
forge_cd beta && pwd
forge_cd && pwd
cd {other}
forge_cd alpha && pwd
forge_cd gamma || echo no gamma
"""


@EVERY_SHELL
def test_forge_cd_changes_to_packages_or_the_root(
    forge: Forge, workspace: Path, tmp_path_factory: pytest.TempPathFactory, shell: str
) -> None:
    other = tmp_path_factory.mktemp("elsewhere")
    script = forge("completion", shell).out
    # zsh completes only in a terminal.
    text = ("compdef() { :; }\n" if shell == "zsh" else "") + script
    text += CHANGES.format(root=shlex.quote(str(workspace)), other=shlex.quote(str(other)))
    options = {"bash": ["--norc"], "zsh": ["-f"], "fish": ["--no-config"]}[shell]
    bin_ = other / "bin"
    bin_.mkdir()
    program = bin_ / "forge"
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m forge "$@"\n')
    program.chmod(0o755)
    variables = {**os.environ, "PATH": f"{bin_}:{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [shell, *options, "-c", text], env=variables, capture_output=True, text=True, check=False
    )
    folders = (workspace / "src/group/folder", workspace, workspace / "src/alpha")
    assert done.stdout.splitlines() == [*map(str, folders), "no gamma"]
    assert "no package named 'gamma'" in done.stderr


def test_there_is_no_root_outside_of_a_workspace(
    workspace: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(workspace / "src/group")
    assert main(["root"], {}) == 0
    assert capsys.readouterr().out == f"{workspace}\n"
    monkeypatch.chdir("/")
    assert main(["root"], {}) == 0
    assert capsys.readouterr().out == ""
