"""The commands in the files of `forge init` work; they use other plugins."""

import json
import re
from pathlib import Path

import pytest

from tests.conftest import Forge, Ran, Tree
from tests.plugins.init.test_command import ALL, REQUIREMENT, scripts
from tests.testable import cmake_package


@pytest.fixture
def initialized(forge: Forge, tmp_path: Path) -> Path:
    root = tmp_path / "a team's workspace"
    root.mkdir()
    assert forge("init", *ALL, "--rosdistro", "jazzy", "--forge", REQUIREMENT, cwd=root).code == 0
    return root


@pytest.mark.needs("cmake", "ninja")
def test_the_commands_of_the_jobs_work_in_a_checkout(forge: Forge, initialized: Path, tree: Tree) -> None:
    tree({f"{initialized.name}/{path}": text for path, text in cmake_package("a").items()})
    env = {"FORGE_CACHE_DIR": str(initialized / ".forge-cache")}
    done = re.findall(r"^forge .*$", "\n".join(scripts(initialized)), re.MULTILINE)
    of_one = [
        "forge build --cache",
        "forge test --return-code-on-test-failure",
        "forge cache prune --size 2G",
    ]
    assert done == [*of_one, *of_one]
    for line in of_one:
        ran = forge(*line.split()[1:], cwd=initialized, env=env)
        assert (ran.code, ran.err) == (0, ""), line


@pytest.mark.needs("cmake", "ninja")
def test_the_editor_builds_in_separate_folders(forge: Forge, initialized: Path, tree: Tree) -> None:
    install = "add_executable(x x.cpp)\ninstall(TARGETS x DESTINATION lib/a)"
    lists = f"cmake_minimum_required(VERSION 3.16)\nproject(a CXX)\n{install}\n"
    tree({f"{initialized.name}/src/a/{name}": text for name, text in {"CMakeLists.txt": lists}.items()})
    (initialized / "src/a/x.cpp").write_text("int main() {}\n")
    tasks = json.loads((initialized / ".vscode/tasks.json").read_text())["tasks"]
    for line in (task["command"] for task in tasks):
        words, _, output = line.partition(" > ")
        ran: Ran = forge(*words.split()[1:], cwd=initialized)
        assert ran.code == 0, line
        if output:
            (initialized / output).write_text(ran.out)
    settings = json.loads((initialized / ".vscode/settings.json").read_text())
    folder = settings["clangd.arguments"][0].removeprefix("--compile-commands-dir=${workspaceFolder}/")
    assert (initialized / folder / "compile_commands.json").is_file()
    assert f"{initialized}/install-debug" in (initialized / ".env").read_text()
    launch = json.loads((initialized / ".vscode/launch.json").read_text())
    program = launch["configurations"][0]["program"]
    for name, value in {
        "workspaceFolder": str(initialized),
        "input:package": "a",
        "input:program": "x",
    }.items():
        program = program.replace(f"${{{name}}}", value)
    assert Path(program).is_file()
    labels = {task["label"] for task in tasks}
    assert {each["preLaunchTask"] for each in launch["configurations"]} <= labels
    assert not (initialized / "build").exists()
