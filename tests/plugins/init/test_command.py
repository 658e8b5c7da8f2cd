"""`forge init` writes valid files, and never over a file."""

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

from forge.base.formats import read_toml
from forge.plugins.init import command
from tests.conftest import Forge, Tree

ALL = ("--vscode", "--github", "--gitlab", "--devcontainer")
VSCODE = {f".vscode/{name}.json" for name in ("settings", "tasks", "launch", "extensions")}
CI = {".github/workflows/build.yml", ".gitlab-ci.yml"}
CONTAINER = {".devcontainer/devcontainer.json", ".devcontainer/Dockerfile"}
EVERYTHING = {"forge.toml", ".gitignore", *VSCODE, *CI, *CONTAINER}
REQUIREMENT = "ros-forge[cmake] @ git+https://example.org/forge.git@v1.0"


def files(root: Path) -> set[str]:
    return {path.relative_to(root).as_posix() for path in root.rglob("*") if not path.is_dir()}


@pytest.fixture
def root(tmp_path: Path) -> Path:
    root = tmp_path / "a team's workspace"
    root.mkdir()
    return root


@pytest.fixture
def initialized(forge: Forge, root: Path) -> Path:
    ran = forge("init", *ALL, "--rosdistro", "jazzy", "--forge", REQUIREMENT, cwd=root)
    assert (ran.code, ran.err) == (0, "")
    assert ran.out == "".join(f"creating {line.split()[1]}\n" for line in ran.out.splitlines())
    assert files(root) == {line.split()[1] for line in ran.out.splitlines()} == EVERYTHING
    return root


def test_only_requested_files_are_written(forge: Forge, root: Path) -> None:
    assert forge("init", cwd=root).out == "creating forge.toml\ncreating .gitignore\n"
    assert forge("init", "--vscode", cwd=root).code == 0
    assert files(root) == {"forge.toml", ".gitignore", *VSCODE}


def test_files_are_written_at_the_root_of_the_workspace(forge: Forge, root: Path) -> None:
    (root / "src").mkdir()
    assert "creating ../.gitlab-ci.yml\n" in forge("init", "--gitlab", cwd=root / "src").out
    assert files(root) == {"forge.toml", ".gitignore", ".gitlab-ci.yml"}


@pytest.mark.parametrize("existing", ["forge.toml", ".gitlab-ci.yml", ".devcontainer"])
def test_an_existing_file_is_an_error_and_nothing_is_written(forge: Forge, root: Path, existing: str) -> None:
    (root / existing).write_text("# mine\n")
    ran = forge("init", *(() if existing == "forge.toml" else ALL), cwd=root)
    assert ran.code == 2
    assert f"'{existing}" in ran.err
    assert "nothing was written" in ran.err
    assert files(root) == {existing}
    assert [path.name for path in root.iterdir()] == [existing]
    assert (root / existing).read_text() == "# mine\n"


def test_all_existing_files_are_reported_in_one_error(forge: Forge, initialized: Path) -> None:
    before = {name: (initialized / name).read_bytes() for name in EVERYTHING}
    ran = forge("init", *ALL, cwd=initialized)
    assert ran.code == 2
    assert ran.err.count("error: ") == 1
    assert all(f"'{name}'" in ran.err for name in EVERYTHING - {"forge.toml", ".gitignore"})
    assert {name: (initialized / name).read_bytes() for name in EVERYTHING} == before


def test_a_dangling_link_counts_as_a_file(forge: Forge, root: Path) -> None:
    (root / "forge.toml").symlink_to("../elsewhere.toml")
    assert forge("init", cwd=root).code == 2
    assert not (root.parent / "elsewhere.toml").exists()


def test_a_dry_run_prints_what_would_be_written(forge: Forge, root: Path, tree: Tree) -> None:
    ran = forge("init", *ALL, "--dry-run", "--forge", REQUIREMENT, cwd=root)
    assert (ran.code, ran.err, files(root)) == (0, "", set())
    assert set(re.findall(r"^--- (.*)$", ran.out, re.MULTILINE)) == EVERYTHING


def test_the_files_are_valid_and_name_the_distribution(initialized: Path) -> None:
    settings = read_toml((initialized / "forge.toml").read_bytes(), initialized / "forge.toml")
    assert settings["build"] == {"rosdistro": "jazzy"}
    assert settings["profiles"]["debug"]["build"]["mixin"] == ["debug"]
    for name in (*VSCODE, ".devcontainer/devcontainer.json"):
        json.loads((initialized / name).read_text())
    container = json.loads((initialized / ".devcontainer/devcontainer.json").read_text())
    assert container["name"] == "a team's workspace"
    github, gitlab = jobs(initialized)
    assert (github["container"], gitlab["image"]) == ("ros:jazzy", "ros:jazzy")
    assert (initialized / ".devcontainer/Dockerfile").read_text().startswith("FROM ros:jazzy\n")
    for name in (*CI, ".devcontainer/Dockerfile"):
        text = (initialized / name).read_text()
        assert text.count(f"'{REQUIREMENT}'") == 1
        assert "humble" not in text
        assert not re.search(r"\n\n|[ \t]$|{%|{{ [^g]", text, re.MULTILINE), name


def jobs(root: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    github = yaml.safe_load((root / ".github/workflows/build.yml").read_text())["jobs"]["build"]
    return github, yaml.safe_load((root / ".gitlab-ci.yml").read_text())["build"]


def scripts(root: Path) -> list[str]:
    github, gitlab = jobs(root)
    lists = [gitlab[key] for key in ("before_script", "script", "after_script")]
    return [*(step["run"] for step in github["steps"] if "run" in step), *("\n".join(each) for each in lists)]


def test_scripts_are_valid_for_the_shell(initialized: Path) -> None:
    container = json.loads((initialized / ".devcontainer/devcontainer.json").read_text())
    docker = (initialized / ".devcontainer/Dockerfile").read_text().replace("\\\n", "")
    steps = re.findall(r"^RUN (.*)$", docker, re.MULTILINE)
    assert len(steps) == 3
    for script in (*scripts(initialized), *steps, container["postCreateCommand"]):
        subprocess.run(["bash", "-n", "-c", script], check=True)


def test_jobs_install_forge_from_the_origin_of_the_running_one(
    forge: Forge, root: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Without --forge, the jobs install the commit that runs; from a folder, a placeholder says so."""
    ran = forge("init", "--gitlab", "--dry-run", cwd=root)
    assert f"pip install '{command.PLACEHOLDER}'" in ran.out
    assert "warning: replace URL_OF_FORGE and COMMIT" in ran.err
    info = tmp_path / "site/ros_forge-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Name: ros-forge\nVersion: 1.0\n")
    origin = {"url": "https://example.org/f.git", "vcs_info": {"vcs": "git", "commit_id": "a1b2"}}
    (info / "direct_url.json").write_text(json.dumps(origin))
    monkeypatch.syspath_prepend(info.parent)
    ran = forge("init", "--gitlab", "--dry-run", cwd=root)
    assert "pip install 'ros-forge[cmake] @ git+https://example.org/f.git@a1b2'" in ran.out
    assert ran.err == ""


@pytest.mark.parametrize("text", ["x y", "x; python_version < '3'", ""])
def test_a_requirement_must_be_valid(forge: Forge, root: Path, text: str) -> None:
    ran = forge("init", "--github", "--forge", text, cwd=root)
    assert ran.code == 2
    assert "argument --forge: " in ran.err
    assert files(root) == set()


def test_ci_files_outside_the_repository_root_give_a_warning(forge: Forge, root: Path) -> None:
    (root.parent / ".git").mkdir()
    ran = forge("init", "--gitlab", "--forge", REQUIREMENT, cwd=root)
    assert f"'.gitlab-ci.yml' must be in '{root.parent}', the top folder of the repository" in ran.err


def test_a_file_that_a_task_would_replace_gives_a_warning(forge: Forge, root: Path) -> None:
    (root / ".env").write_text("TOKEN=1\n")
    assert ".env" not in forge("init", "--github", cwd=root).err
    ran = forge("init", "--vscode", cwd=root)
    assert (ran.code, ".env: warning: the task 'forge: environment'" in ran.err) == (0, True), ran.err
    assert (root / ".env").read_text() == "TOKEN=1\n"


def test_an_existing_gitignore_is_kept_and_missing_lines_are_listed(forge: Forge, root: Path) -> None:
    (root / ".gitignore").write_text("*.o\n")
    ran = forge("init", cwd=root)
    assert ran.err.startswith(
        ".gitignore: warning: git does not ignore forge's output folders\nhint: add /build/, "
    )
    assert (root / ".gitignore").read_text() == "*.o\n"
