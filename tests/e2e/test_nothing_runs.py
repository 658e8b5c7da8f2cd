"""Read-only commands run no code of the workspace; it runs only in its own build."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from forge.cli.main import COMMANDS
from tests.conftest import Tree
from tests.packages import manifest_text

pytestmark = pytest.mark.needs("git")

_PYTHON = """import pathlib
pathlib.Path({sprung!r}).write_text({name!r})
"""
_CMAKE = """execute_process(COMMAND touch "{sprung}")
cmake_minimum_required(VERSION 3.18)
project({name} NONE)
"""
_PROJECT = """[build-system]
requires = []
build-backend = "trap"
backend-path = ["."]
[project]
name = "projected"
version = "1"
[tool.pytest.ini_options]
addopts = "-p trap"
"""
_ENTITY = """<?xml version="1.0"?>
<!DOCTYPE package [<!ENTITY stolen SYSTEM "{secret}"> <!ENTITY a "aaaaaaaaa">
<!ENTITY b "&a;&a;&a;&a;&a;&a;">]>
<package format="3"><name>entity</name><version>1.0.0</version><description>&stolen;&b;</description>
<maintainer email="a@b.cc">A</maintainer><license>L</license></package>
"""
_IN_THE_WAY = (
    "sitecustomize",
    "usercustomize",
    "conftest",
    "json",
    "yaml",
    "argparse",
    "typing",
    "setuptools",
)
"""Modules that Python or pytest would import from where they stand, if anything was started there."""

_LOOKING = (
    "list",
    "list --json",
    "list -h",
    "list --packages-select-changed",
    "list --packages-above-changed --since HEAD~1",
    "graph --packages-select-changed --since main...",
    "list --packages-select-changed --since missing",
    "list --packages-select-changed --since --upload-pack=x",
    "graph",
    "graph --dot",
    "graph --json",
    "info",
    "info --json",
    "extensions",
    "mixin list",
    "interface list",
    "interface packages",
    "interface package msgs",
    "interface show msgs/msg/Trap",
    "interface proto msgs/msg/Trap",
    "interface schema msgs/msg/Trap",
    "interface hash msgs/msg/Trap",
    "interface hash --package msgs src/msgs",
    "interface generate src/msgs --package msgs --output generated --lang python --lang cpp --lang docs",
    "pkg list",
    "pkg executables",
    "pkg prefix installed",
    "pkg xml installed",
    "env",
    "completion bash",
    "completion zsh",
    "completion fish",
    "test-result",
    "test-result --all",
    "clean stale --yes",
    "clean workspace --yes",
)
_MORE = {
    "graph --html": "graph",
    "graph --svg": "graph",
    "graph --mermaid": "graph",
    "doctor": "doctor",
    "deps": "deps",
    "deps list": "deps",
    "deps --list": "deps",
}
"""What other forges may lack."""


def traps(sprung: Path) -> dict[str, str]:
    """Return a workspace in which every file that could run tells if it did."""
    trap = {name: _PYTHON.format(sprung=str(sprung), name=name) for name in (*_IN_THE_WAY, "setup", "trap")}
    shell = f"#!/bin/sh\ntouch '{sprung}'\n"
    files = {f"{name}.py": trap[name] for name in _IN_THE_WAY}
    for name, build_type in (
        ("py", "ament_python"),
        ("ament", "ament_cmake"),
        ("plain", "cmake"),
        ("msgs", "ament_cmake"),
    ):
        files[f"src/{name}/package.xml"] = manifest_text(name, build_type=build_type)
        files[f"src/{name}/CMakeLists.txt"] = _CMAKE.format(sprung=sprung, name=name)
        files |= {f"src/{name}/{module}.py": text for module, text in trap.items()}
        files |= {f"src/{name}/{name}/{module}.py": trap["trap"] for module in ("__init__", "__main__")}
        files[f"src/{name}/trap.pth"] = f"import os; os.system('touch {sprung}')\n"
        files[f"src/{name}/env_hook.sh.in"] = files[f"src/{name}/configure"] = shell
        files[f"src/{name}/Makefile"] = f"$(shell touch '{sprung}')\nall:\n\ttouch '{sprung}'\n"
    files["src/msgs/msg/Trap.msg"] = f"# $(touch '{sprung}')\nstring a \"`touch '{sprung}'`\"\n"
    files["src/setup_only/setup.py"] = (
        f"{trap['setup']}from setuptools import setup\nsetup(name='setup_only')\n"
    )
    files |= {"src/projected/pyproject.toml": _PROJECT, "src/projected/trap.py": trap["trap"]}
    files["src/cmake_only/CMakeLists.txt"] = _CMAKE.format(sprung=sprung, name="cmake_only")
    files["src/entity/package.xml"] = _ENTITY.format(secret=sprung.with_name("secret"))
    files["install/.colcon_install_layout"] = "merged\n"
    files["install/share/ament_index/resource_index/packages/installed"] = ""
    files["install/share/ament_index/resource_index/rosidl_interfaces/msgs"] = ""
    files["install/share/colcon-core/packages/installed"] = ""
    files["install/share/installed/package.xml"] = manifest_text("installed")
    files["install/share/installed/package.dsv"] = "prepend-non-duplicate;TRAP;$(touch /tmp/x)\n"
    files["install/share/installed/package.sh"] = files["install/lib/installed/program"] = shell
    files["install/share/msgs/msg/Trap.msg"] = files["src/msgs/msg/Trap.msg"]
    files["build/py/pytest.xml"] = '<testsuite tests="1" errors="0" failures="0"/>'
    files["colcon.meta"] = json.dumps({"names": {"py": {"cmake-args": [f"$(touch {sprung})"]}}})
    return files


def git(root: Path, *argv: str, config: bool = False) -> str:
    """Run git without the configuration of the repository, except if it is asked to change it."""
    who = ("-c", "user.name=t", "-c", "user.email=t@e.com", "-c", "init.defaultBranch=main")
    allow = () if config else ("-c", "protocol.file.allow=always")
    words = ("git", "-C", str(root), *who, *allow, *argv)
    return subprocess.run(words, check=True, capture_output=True, text=True).stdout.strip()


def configured_repository(root: Path, sprung: Path) -> None:
    """Make `root` a repository with a submodule, with changed files and programs in their configuration."""
    submodule = root.with_name("submodule")
    submodule.mkdir()
    (submodule / "package.xml").write_text(manifest_text("sub"))
    for top in (submodule, root):
        git(top, "init", "-q")
        git(top, "add", ".")
        git(top, "commit", "-qm", "one")
    git(root, "submodule", "--quiet", "add", str(submodule), "src/sub")
    git(root, "commit", "-qm", "two")
    trap = f"touch '{sprung}'; false"
    settings = {
        **dict.fromkeys(("filter.x.clean", "filter.x.smudge", "filter.x.process", "filter.a=b.clean"), trap),
        **dict.fromkeys(("diff.x.textconv", "diff.x.command", "diff.external", "merge.x.driver"), trap),
        **dict.fromkeys(("core.pager", "pager.ls-tree", "core.editor", "core.sshCommand"), trap),
        **dict.fromkeys(("core.askPass", "credential.helper", "core.alternateRefsCommand"), trap),
        **dict.fromkeys((f"alias.{name}" for name in ("ls-tree", "ls-files", "rev-parse")), f"!{trap}"),
        "core.fsmonitor": trap,
        "core.untrackedCache": "true",
        "filter.x.required": "true",
        "submodule.src/sub.update": f"!{trap}",
        "protocol.allow": "always",
        "protocol.ext.allow": "always",
        "remote.origin.url": f"ext::sh -c touch% {sprung}",
        "remote.origin.promisor": "true",
        "remote.origin.uploadpack": trap,
        "remote.local.url": str(root),
        "remote.local.promisor": "true",
        "remote.local.uploadpack": trap,
        "remote.helper.vcs": "trap",
        "remote.helper.url": "x",
        "core.repositoryFormatVersion": "1",
        "extensions.partialClone": "origin",
        "include.path": "included",
    }
    for top, folder in ((root, root / ".git"), (root / "src/sub", root / ".git/modules/src/sub")):
        for path in [*top.rglob("*.py"), *top.rglob("package.xml")]:
            path.write_text(path.read_text() + " \n")
        (folder / "info").mkdir(exist_ok=True)
        (folder / "info/attributes").write_text("* filter=x diff=x merge=x\n*.py filter=a=b\n")
        (folder / "included").write_text(f'[core]\n\thooksPath = "{folder}/hooks"\n')
        hooks = ("post-index-change", "reference-transaction", "fsmonitor-watchman", "query-watchman")
        for hook in hooks:
            (folder / "hooks").mkdir(exist_ok=True)
            (folder / "hooks" / hook).write_text(f"#!/bin/sh\n{trap}\n")
            (folder / "hooks" / hook).chmod(0o755)
        for name, value in settings.items():
            git(top, "config", name, value, config=True)
    # A tree that has to be fetched.
    tree = git(root, "rev-parse", "HEAD~1^{tree}")
    (root / ".git/objects" / tree[:2] / tree[2:]).unlink()


@pytest.mark.parametrize("words", ["status", "ls-tree HEAD~1", "diff"])
def test_repository_traps_detect_execution(words: str, tree: Tree, tmp_path: Path) -> None:
    sprung = tmp_path / "sprung"
    root = tree({"ws/a/x.py": "", "ws/a/package.xml": manifest_text("a")}) / "ws"
    configured_repository(root, sprung)
    assert not sprung.exists()
    subprocess.run(["git", "-C", root, *words.split()], capture_output=True, check=False)
    assert sprung.exists()


def test_read_only_commands_run_no_code_of_the_workspace(tree: Tree, tmp_path: Path) -> None:
    sprung = tmp_path / "traps" / "sprung"
    sprung.parent.mkdir()
    sprung.with_name("secret").write_text("a secret\n")
    root = tree({f"ws/{path}": text for path, text in traps(sprung).items()}) / "ws"
    configured_repository(root, sprung)
    variables = {
        "PATH": os.environ["PATH"],
        "HOME": str(tmp_path),
        "AMENT_PREFIX_PATH": str(root / "install"),
        "PYTHONDONTWRITEBYTECODE": "1",
        "PYTHONPATH": str(Path(__file__).parents[2]),
    }
    more = [words for words, command in _MORE.items() if command in COMMANDS]
    for words in (*_LOOKING, *more):
        done = subprocess.run(
            [sys.executable, str(Path(sys.executable).with_name("forge")), *words.split()],
            cwd=root,
            env=variables,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )
        assert not sprung.exists(), words
        assert done.returncode in {0, 1, 2}, (words, done.stderr)
        assert words in more or done.returncode != 2 or "invalid choice" not in done.stderr, (
            words,
            done.stderr,
        )
        assert "a secret" not in done.stdout + done.stderr, words


@pytest.mark.parametrize("kind", ["packages", "installed", "executables"])
def test_completion_runs_no_code_of_the_workspace(kind: str, tree: Tree, tmp_path: Path) -> None:
    sprung = tmp_path / "sprung"
    root = tree({f"ws/{path}": text for path, text in traps(sprung).items()}) / "ws"
    program = Path(__file__).parents[2] / "forge/plugins/completion/words.py"
    variables = {"HOME": str(tmp_path), "AMENT_PREFIX_PATH": str(root / "install")}
    argv = [sys.executable, "-S", "-E", str(program), kind, "installed"]
    done = subprocess.run(argv, cwd=root, env=variables, capture_output=True, text=True, check=True)
    assert done.stdout
    assert not sprung.exists()


@pytest.mark.needs("cmake")
def test_workspace_traps_detect_execution(tree: Tree, tmp_path: Path) -> None:
    """A test that no trap springs says nothing of traps that cannot."""
    sprung = tmp_path / "sprung"
    root = tree({f"ws/{path}": text for path, text in traps(sprung).items()}) / "ws"
    for argv in (
        [sys.executable, "setup.py"],
        [sys.executable, "-c", "import json"],
        ["cmake", "-S", ".", "-B", str(tmp_path / "build")],
        ["sh", "configure"],
    ):
        subprocess.run(argv, cwd=root / "src" / "py", capture_output=True, check=False)
        assert sprung.exists(), argv
        sprung.unlink()
