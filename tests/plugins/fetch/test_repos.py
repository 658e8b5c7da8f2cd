"""`forge fetch --import` and `--export`: repositories in files of vcs."""

import shutil
import subprocess
from pathlib import Path

import pytest

from forge.base.formats import yaml_text
from tests.conftest import Forge
from tests.packages import manifest_text, write_files
from tests.plugins.fetch.ros import CMAKE, SERVER, Ros, depends
from tests.plugins.fetch.test_fetch import NEEDED, locked, new_workspace

pytestmark = pytest.mark.needs("cmake", "git")


def package(folder: str, name: str, *lines: str, version: str = "2.0.0") -> dict[str, str]:
    """Return the files of a package in a folder of a repository."""
    files = {
        "package.xml": manifest_text(name, *lines, build_type="cmake").replace("0.1.0", version),
        "CMakeLists.txt": CMAKE.format(name=name, version=version, lines=""),
    }
    return {f"{folder}/{path}": text for path, text in files.items()}


def repos(folder: Path, **versions: str) -> str:
    entries = {
        name: {"type": "git", "url": f"{SERVER}{name}.git", **({"version": version} if version else {})}
        for name, version in versions.items()
    }
    write_files(folder, {"my.repos": yaml_text({"repositories": entries})})
    return "my.repos"


def entry(workspace: Path, name: str) -> dict[str, str]:
    (found,) = (each for each in locked(workspace)["package"] if each["name"] == name)
    return dict(found)


def test_import_is_the_inverse_of_export(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    env = ros.variables()
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
    words = ("fetch", "turtle", "--rmw", "fastrtps", "--export", "all.repos")
    assert forge(*words, cwd=tmp_path / "one", env=env).code == 0
    ran = forge("fetch", "--import", "../one/all.repos", cwd=tmp_path / "two", env=env)
    assert (ran.code, ran.err) == (0, "")
    assert (tmp_path / "two/forge.lock").read_text() == (tmp_path / "one/forge.lock").read_text()


@pytest.mark.parametrize("version", ["v2", "main"])
def test_imported_packages_replace_those_of_the_index(
    ros: Ros, forge: Forge, tmp_path: Path, version: str
) -> None:
    more = "<depend>not_released</depend>"
    files = {**package("libs/rclmini", "rclmini", more), **package("not_released", "not_released")}
    commit = ros.commit("rcl", files, "v2")
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    file = repos(workspace, rcl=version)
    ran = forge("fetch", "--import", file, cwd=workspace, env=env)
    assert ran.code == 0, ran.err
    assert entry(workspace, "rclmini") == {
        "name": "rclmini",
        "version": "2.0.0",
        "repository": f"{SERVER}rcl.git",
        "tag": "v2" if version == "v2" else commit,
        "commit": commit,
        "path": "libs/rclmini",
    }
    assert [each["name"] for each in locked(workspace)["package"]] == ["not_released", "rclmini"]
    # The lock holds it, also if the branch moves and on a machine without the sources.
    before = (workspace / "forge.lock").read_text()
    if version == "main":
        for number, same in enumerate((commit, "")):
            other = new_workspace(tmp_path / f"other {number}")
            assert forge("fetch", "--import", repos(other, rcl=same), cwd=other, env=env).code == 0
            assert (other / "forge.lock").read_text() == before
    ros.commit("rcl", package("libs/rclmini", "rclmini", version="3.0.0"), "v3")
    shutil.rmtree(ros.root / "user cache")
    assert forge("fetch", "--locked", cwd=workspace, env=env).code == 0
    assert forge("fetch", cwd=workspace, env=env).code == 0
    assert (workspace / "forge.lock").read_text() == before
    ran = forge("build", cwd=workspace, env=env)
    assert ran.code == 0, ran.err
    assert "rclmini 2.0.0" in "".join(
        path.read_text() for path in workspace.glob("log/latest/hello/stdout.log")
    )
    assert forge("fetch", "--update", cwd=workspace, env=env).code == 0
    assert [each["name"] for each in locked(workspace)["package"]] == NEEDED


def test_a_repository_of_several_packages_is_exported_once(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    files = {**package("a", "rclmini", *depends("other")), **package("b", "other")}
    ros.commit("rcl", files, "v2")
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    words = ("fetch", "--import", repos(workspace, rcl="v2"), "--export", "all.repos")
    assert forge(*words, cwd=workspace, env=env).code == 0
    assert (workspace / "all.repos").read_text() == (workspace / "my.repos").read_text()
    before = (workspace / "forge.lock").read_text()
    assert forge("fetch", "--import", "all.repos", cwd=workspace, env=env).code == 0
    assert (workspace / "forge.lock").read_text() == before


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "--import: 'my.repos' is not a file"),
        ("repositories: [", "my.repos:1:"),
        ("a: 1", "my.repos: error: not a list of repositories"),
        (
            "repositories: {a: {type: svn, url: x}}",
            "'a' is of type 'svn': forge imports only git",
        ),
        ("repositories: {a: {type: git}}", "my.repos: error: 'a' has no valid 'url'"),
        (
            f"repositories: {{a: {{type: git, url: '{SERVER}lib.git', version: v9}}}}",
            f"error: cannot import '{SERVER}lib.git': it has no tag or branch 'v9'",
        ),
        (
            f"repositories: {{a: {{url: '{SERVER}no.git'}}}}",
            f"error: cannot import '{SERVER}no.git'",
        ),
    ],
)
def test_invalid_repos_files_give_one_error(
    ros: Ros, forge: Forge, tmp_path: Path, text: str | None, message: str
) -> None:
    workspace = new_workspace(tmp_path / "ws")
    if text is not None:
        (workspace / "my.repos").write_text(text)
    ran = forge("fetch", "--import", "my.repos", cwd=workspace, env=ros.variables())
    assert (ran.code, ran.err.count("error: ")) == (2, 1)
    assert message in ran.err
    assert not (workspace / "forge.lock").exists()


def test_import_needs_the_network(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", cwd=workspace, env=env).code == 0
    ran = forge("fetch", "--offline", "--import", repos(workspace, lib=""), cwd=workspace, env=env)
    assert (ran.code, "not downloaded yet: 'my.repos'" in ran.err) == (2, True)


def test_exported_files_can_be_imported_with_git(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", "--export", "all.repos", cwd=workspace, env=env).code == 0
    for each in locked(workspace)["package"]:
        folder = tmp_path / each["name"]
        argv = ("git", "clone", "--quiet", "--branch", each["tag"], each["repository"], folder)
        subprocess.run(argv, check=True, capture_output=True, env={**env, "PATH": "/usr/bin:/bin"})
        assert (folder / "package.xml").is_file()
