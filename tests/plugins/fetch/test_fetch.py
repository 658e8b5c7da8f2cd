"""`forge fetch` and `forge build` from an empty cache to an installed package, on a distribution on disk."""

import re
import shutil
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from forge.base.formats import read_toml, read_yaml, yaml_text
from tests.conftest import Forge
from tests.packages import manifest_text, write_files
from tests.plugins.fetch.ros import CMAKE, SERVER, Ros, depends

pytestmark = pytest.mark.needs("cmake", "git")

NEEDED = ["lib_vendor", "rclmini", "rmw_cyclonedds_cpp", "rmw_implementation"]


def new_workspace(root: Path, *lines: str) -> Path:
    """Write a workspace with one package that needs rclmini."""
    name = "hello"
    cmake = 'find_package(rclmini REQUIRED)\nmessage(STATUS "rclmini ${rclmini_VERSION}")'
    manifest = manifest_text(name, *(lines or depends("rclmini")), build_type="cmake")
    files = {"package.xml": manifest, "CMakeLists.txt": CMAKE.format(name=name, version="1", lines=cmake)}
    return write_files(root, {f"src/{name}/{path}": text for path, text in files.items()})


def locked(workspace: Path) -> dict[str, Any]:
    path = workspace / "forge.lock"
    return read_toml(path.read_bytes(), path)


def test_fetch_and_build_install_a_package_from_scratch(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "my ws"), ros.variables()
    ran = forge("fetch", cwd=workspace, env=env)
    assert (ran.code, ran.err) == (0, "")
    assert "ROS humble: 4 packages in 4 repositories, 4 to download" in ran.out
    lock = locked(workspace)
    assert [each["name"] for each in lock["package"]] == NEEDED
    assert lock["clone"][0]["packages"] == ["lib_vendor"]
    assert lock["system"] == ["libacl1-dev"]
    shutil.rmtree(tmp_path / "ros/repositories")
    shutil.rmtree(tmp_path / "ros/index")
    ran = forge("build", cwd=workspace, env=env)
    assert ran.code == 0, ran.err
    assert "building 4 packages of ROS humble" in ran.err
    (library,) = (tmp_path / "ros/user cache/forge/ros/underlays").glob("*/install/share/lib_vendor/lib.txt")
    assert library.read_text() == "the library\n"
    again = forge("build", cwd=workspace, env=env)
    assert "1 package unchanged" in again.out
    assert "building" not in again.err


def test_a_second_workspace_reuses_the_underlay(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    env = ros.variables()
    for name in ("one", "two"):
        # Another workspace that happens to be sourced is no reason to build the packages again.
        env["COLCON_PREFIX_PATH"] = str(tmp_path / "one/install")
        workspace = new_workspace(tmp_path / name)
        assert forge("fetch", cwd=workspace, env=env).code == 0
        ran = forge("build", cwd=workspace, env=env)
        assert ran.code == 0
        assert ("building 4 packages of ROS" in ran.err) == (name == "one")
    assert ran.err == ""
    logs = (tmp_path / "ros/user cache/forge/ros/underlays").glob("*/log/build_*")
    assert len([*logs]) == 1, "a second build would have a second log"


def test_new_clones_rebuild_nothing_and_are_used_by_later_builds(
    ros: Ros, forge: Forge, tmp_path: Path
) -> None:
    ros.commit("more", {"more.txt": "more\n"}, "v2")
    clone = f"""\
include(FetchContent)
FetchContent_Declare(more GIT_REPOSITORY {SERVER}more.git GIT_TAG v2)
FetchContent_Populate(more)"""
    ros.release("more_vendor", cmake=clone)
    one, two, env = tmp_path / "one", tmp_path / "two", ros.variables()
    for workspace, name in ((one, "lib_vendor"), (two, "more_vendor")):
        workspace.mkdir()
        assert forge("fetch", name, cwd=workspace, env=env).code == 0
    shutil.rmtree(tmp_path / "ros/repositories")
    # Some CI systems pass credentials so, other ones for each run.
    settings = {f"GIT_CONFIG_{name}_0": f"user.{name}".lower() for name in ("KEY", "VALUE")}
    for workspace in (one, two):
        ran = forge("build", cwd=workspace, env={**env, "GIT_CONFIG_COUNT": "1", **settings})
        assert ran.code == 0, ran.err
        settings["GIT_CONFIG_VALUE_0"] = "another one"
    (underlay,) = (tmp_path / "ros/user cache/forge/ros/underlays").glob("humble-*")
    assert {path.name for path in (underlay / "log/latest_build").glob("*_vendor")} == {"more_vendor"}
    for name in ("build", "install"):
        shutil.rmtree(underlay / name)
    (underlay / "built.json").unlink()
    ran = forge("build", cwd=one, env=env)
    assert ran.code == 0, ran.err
    assert (underlay / "install/share/lib_vendor/lib.txt").is_file()


CLONE = """\
include(FetchContent)
FetchContent_Declare({0} GIT_REPOSITORY {1} GIT_TAG {2})
FetchContent_Populate({0})
file(READ ${{{0}_SOURCE_DIR}}/lib.txt text)
file(WRITE ${{CMAKE_CURRENT_BINARY_DIR}}/text.txt "${{text}}")
install(FILES ${{CMAKE_CURRENT_BINARY_DIR}}/text.txt DESTINATION share/{3})"""


def test_packages_may_clone_different_tags_of_one_repository(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    ros.commit("lib", {"lib.txt": "the new library\n"}, "v2")
    for name, tag in (("old_vendor", "v1.2"), ("new_vendor", "v2")):
        ros.release(name, cmake=CLONE.format("lib", f"{SERVER}lib.git", tag, name))
    workspace, env = tmp_path / "ws", ros.variables()
    workspace.mkdir()
    assert forge("fetch", "old_vendor", "new_vendor", cwd=workspace, env=env).code == 0
    shutil.rmtree(tmp_path / "ros/repositories")
    ran = forge("build", cwd=workspace, env=env)
    assert ran.code == 0, ran.err
    (underlay,) = (tmp_path / "ros/user cache/forge/ros/underlays").glob("humble-*")
    texts = {
        name: (underlay / "install/share" / name / "text.txt").read_text()
        for name in ("old_vendor", "new_vendor")
    }
    assert texts == {"old_vendor": "the library\n", "new_vendor": "the new library\n"}


def test_a_tag_with_a_variable_is_pinned_if_the_file_sets_it_to_one_value(
    ros: Ros, forge: Forge, tmp_path: Path
) -> None:
    clone = f"""\
set(MINOR 2)
set(VERSION "1.${{MINOR}}")
if(FALSE)
  {CLONE.format("other", f"{SERVER}lib.git", "v${CMAKE_VERSION}", "careful_vendor")}
endif()
{CLONE.format("lib", f"{SERVER}lib.git", "v${VERSION}", "careful_vendor")}"""
    ros.release("careful_vendor", cmake=clone)
    workspace, env = tmp_path / "ws", ros.variables()
    workspace.mkdir()
    ran = forge("fetch", "careful_vendor", cwd=workspace, env=env)
    assert ran.code == 0
    computed = f"'careful_vendor' may clone '{SERVER}lib.git': CMake computes the tag 'v${{CMAKE_VERSION}}'"
    assert computed in ran.err
    assert [each["tag"] for each in locked(workspace)["clone"]] == ["v1.2"]
    shutil.rmtree(tmp_path / "ros/repositories")
    assert forge("build", cwd=workspace, env=env).code == 0


def test_a_missing_repository_that_may_be_cloned_gives_a_warning(
    ros: Ros, forge: Forge, tmp_path: Path
) -> None:
    clone = CLONE.format("gone", f"{SERVER}gone.git", "v1", "careful_vendor")
    ros.release("careful_vendor", cmake=f"if(FALSE)\n{clone}\nendif()")
    workspace, env = tmp_path / "ws", ros.variables()
    workspace.mkdir()
    ran = forge("fetch", "careful_vendor", cwd=workspace, env=env)
    assert ran.code == 0
    assert f"warning: 'careful_vendor' may clone '{SERVER}gone.git': " in ran.err
    assert forge("build", cwd=workspace, env=env).code == 0


def test_a_misspelled_dependency_gives_a_warning(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    workspace = new_workspace(tmp_path / "ws", *depends("rclmin", "libacl1-dev", "python3-yaml", "curl"))
    ran = forge("fetch", cwd=workspace, env=ros.variables())
    assert (ran.code, ran.err.count("warning: ")) == (0, 1)
    assert "src/hello/package.xml:" in ran.err
    assert "warning: ROS 'humble' has no package 'rclmin', which 'hello' needs\n" in ran.err
    assert "hint: did you mean 'rclmini'?" in ran.err


def test_another_distribution_gets_the_packages_that_were_requested(
    ros: Ros, forge: Forge, tmp_path: Path
) -> None:
    workspace, env = tmp_path / "ws", ros.variables()
    workspace.mkdir()
    assert forge("fetch", "turtle", "--rmw", "fastrtps", cwd=workspace, env=env).code == 0
    before = (workspace / "forge.lock").read_text()
    (workspace / "forge.lock").write_text(before.replace('"humble"', '"foxy"'))
    assert forge("fetch", "--rosdistro", "humble", cwd=workspace, env=env).code == 0
    assert (workspace / "forge.lock").read_text() == before


def test_named_packages_are_added_and_remembered(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", "turtle", cwd=workspace, env=env).code == 0
    assert forge("fetch", cwd=workspace, env=env).code == 0
    assert locked(workspace)["requested"] == ["turtle"]
    assert [each["name"] for each in locked(workspace)["package"]] == [*NEEDED, "turtle"]


def test_tests_and_other_middlewares_are_excluded_by_default(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", "--rmw", "fastrtps", "--test", cwd=workspace, env=env).code == 0
    expected = ["fastdds", "lib_vendor", "rclmini", "rmw_fastrtps_cpp", "rmw_implementation"]
    assert [each["name"] for each in locked(workspace)["package"]] == expected


def test_only_tests_of_the_workspace_are_followed(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    ros.release("own_test_tools", *depends("other_test_tools", tag="test_depend"))
    ros.release("other_test_tools")
    needs = (*depends("rclmini"), *depends("own_test_tools", tag="test_depend"))
    workspace, env = new_workspace(tmp_path / "ws", *needs), ros.variables()
    for options, expected in (((), NEEDED), (("--test",), sorted([*NEEDED, "own_test_tools"]))):
        assert forge("fetch", *options, cwd=workspace, env=env).code == 0
        assert [each["name"] for each in locked(workspace)["package"]] == expected


def test_dependencies_used_only_by_tests_are_excluded(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    ros.release("ament_cmake_flake8")
    ros.release("ament_cmake_pytest", *depends("python3-pytest"))
    linters = depends("ament_cmake_flake8", tag="exec_depend")
    ros.release("rosidl_generator_py", *depends("ament_cmake_pytest"), *linters)
    env = ros.variables()
    for options, expected in (((), 0), (("--test",), 1)):
        workspace = tmp_path / f"ws{expected}"
        workspace.mkdir()
        assert forge("fetch", "rosidl_generator_py", *options, cwd=workspace, env=env).code == 0
        lock = locked(workspace)
        names = [each["name"] for each in lock["package"]]
        assert names.count("ament_cmake_flake8") == expected
        assert lock["system"].count("python3-pytest") == expected
        assert {"ament_cmake_pytest", "rosidl_generator_py"} <= {*names}


def test_system_packages_for_tracing_are_not_needed(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    ros.release("tracetools", *depends("liblttng-ust-dev", "lttng-tools", "pkg-config"))
    workspace = tmp_path / "ws"
    workspace.mkdir()
    assert forge("fetch", "tracetools", cwd=workspace, env=ros.variables()).code == 0
    assert locked(workspace)["system"] == ["pkg-config"]


def test_the_lock_pins_versions_until_update(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    workspace = new_workspace(tmp_path / "ws")
    assert forge("fetch", cwd=workspace, env=ros.variables()).code == 0
    before = (workspace / "forge.lock").read_text()
    newer = ros.release("rclmini", *depends("rmw_implementation", "lib_vendor"), version="1.1.0")
    env = ros.variables()
    assert forge("fetch", cwd=workspace, env=env).code == 0
    assert (workspace / "forge.lock").read_text() == before
    assert forge("fetch", "--locked", cwd=workspace, env=env).code == 0
    assert forge("fetch", "--update", "rclmini", cwd=workspace, env=env).code == 0
    (updated,) = (each for each in locked(workspace)["package"] if each["name"] == "rclmini")
    assert (updated["version"], updated["commit"]) == ("1.1.0-1", newer)


def test_locked_rejects_a_workspace_with_new_dependencies(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", cwd=workspace, env=env).code == 0
    before = (workspace / "forge.lock").read_text()
    new_workspace(workspace, *depends("turtle"))
    ran = forge("fetch", "--locked", cwd=workspace, env=env)
    assert ran.code == 2
    assert "'forge.lock' is out of date" in ran.err
    assert (workspace / "forge.lock").read_text() == before


def test_a_moved_tag_is_rejected(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", cwd=workspace, env=env).code == 0
    ros.commit("rclmini-release", {"new": "content"}, "release/humble/rclmini/1.0.0-1")
    shutil.rmtree(tmp_path / "ros/user cache/forge/ros/sources")
    ran = forge("fetch", cwd=workspace, env=env)
    assert ran.code == 2
    assert "cannot download 'rclmini': the tag 'release/humble/rclmini/1.0.0-1'" in ran.err
    assert "hint: the tag was moved, or the lock was edited; to use the current commit" in ran.err


def test_a_lock_whose_commit_differs_from_the_tag_is_rejected(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", cwd=workspace, env=env).code == 0
    other = ros.commit("rclmini-release", {"new": "content"}, "other")
    lock = workspace / "forge.lock"
    (commit,) = (each["commit"] for each in locked(workspace)["package"] if each["name"] == "rclmini")
    edited = lock.read_text().replace(commit, other)
    lock.write_text(edited)
    for command in ("fetch", "build"):
        ran = forge(command, cwd=workspace, env=env)
        assert (ran.code, ran.err.count("error: ")) == (2, 1)
        assert f"is {commit}, not {other} as in the lock" in ran.err
        assert lock.read_text() == edited


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("format = 1\n= 3\n", "not well-formed TOML: Invalid statement (at line 2, column 1)"),
        ("format = 1\n", "malformed lock: distribution"),
        ("", "not a lock file of forge: 'format' is missing"),
        ("format = 99\n", "written by a newer forge"),
    ],
)
def test_a_damaged_lock_gives_one_error(
    ros: Ros, forge: Forge, tmp_path: Path, text: str, message: str
) -> None:
    workspace = new_workspace(tmp_path / "ws")
    (workspace / "forge.lock").write_text(text)
    for command in ("fetch", "build"):
        ran = forge(command, cwd=workspace, env=ros.variables())
        assert (ran.code, ran.err.count("error: ")) == (2, 1)
        assert message in ran.err
        assert "hint: " in ran.err


def test_packages_of_another_distribution_are_recognized(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    newer = Ros(tmp_path / "newer", "jazzy")
    newer.release("brand_new")
    env = ros.variables()
    (entry,) = read_yaml(Path(newer.publish()[7:]).read_bytes(), tmp_path)["distributions"].values()
    path = Path(env["ROSDISTRO_INDEX_URL"][7:])
    index = read_yaml(path.read_bytes(), path)
    folder = (newer.root / "index").as_uri()
    entry["distribution"] = [f"{folder}/jazzy/distribution.yaml"]
    index["distributions"]["jazzy"] = entry
    path.write_text(yaml_text(index))
    ran = forge("fetch", "brand_new", cwd=new_workspace(tmp_path / "ws"), env=env)
    assert ran.code == 2
    assert "ROS 'humble' has no package 'brand_new'\nhint: it is in jazzy; choose" in ran.err


def test_a_missing_repository_stops_only_its_packages(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    shutil.rmtree(tmp_path / "ros/repositories/rclmini-release.git")
    ran = forge("fetch", cwd=workspace, env=env)
    assert ran.code == 2
    assert "cannot read 'https://example.invalid/rclmini-release.git', which has 'rclmini'" in ran.err
    assert not (workspace / "forge.lock").exists()
    sources = tmp_path / "ros/user cache/forge/ros/sources"
    assert sorted(each.name for each in sources.iterdir()) == [each for each in NEEDED if each != "rclmini"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("trtle",), "ROS 'humble' has no package 'trtle'\nhint: did you mean 'turtle'?"),
        (("--rmw", "zenoh"), "middleware 'zenoh'\nhint: it has rmw_cyclonedds_cpp, rmw_fastrtps_cpp"),
        (("--rmw", "fastrtp"), "middleware 'fastrtp'\nhint: did you mean 'fastrtps'?"),
        (("--rosdistro", "jazzy"), "has no ROS 2 distribution 'jazzy'"),
        (("--offline",), "the index of 'humble' was not downloaded yet"),
        (("--index", "file:///nowhere/index.yaml"), "cannot read the index of ROS distributions"),
    ],
)
def test_invalid_arguments_give_one_error(
    ros: Ros, forge: Forge, tmp_path: Path, words: tuple[str, ...], message: str
) -> None:
    workspace = new_workspace(tmp_path / "ws")
    ran = forge("fetch", *words, cwd=workspace, env=ros.variables())
    assert ran.code == 2
    assert message in ran.err
    assert not (workspace / "forge.lock").exists()


def test_lock_entries_cannot_escape_the_cache(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", cwd=workspace, env=env).code == 0
    lock = workspace / "forge.lock"
    text = lock.read_text()
    for command, name in product(("fetch", "build"), ("version", "name")):
        lock.write_text(re.sub(rf'^{name} = ".*"$', f'{name} = "../../../x"', text, flags=re.M))
        ran = forge(command, cwd=workspace, env=env)
        assert ran.code == 2
        assert "malformed lock: invalid name or version" in ran.err


def test_embedded_packages_are_not_fetched(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    ros.release("std_msgs")
    workspace = new_workspace(tmp_path / "ws", *depends("std_msgs"))
    ran = forge("fetch", cwd=workspace, env=ros.variables())
    assert (ran.code, ran.out) == (0, "nothing to fetch: no package of ROS humble is missing\n")
    assert not (workspace / "forge.lock").exists()


def test_vendored_sources_become_workspace_packages(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", "--vendor", "src/ros", cwd=workspace, env=env).code == 0
    assert forge("list", "--names-only", cwd=workspace).out.split() == sorted(["hello", *NEEDED])
    assert not (workspace / "forge.lock").exists()
    assert "nothing to fetch" in forge("fetch", cwd=workspace, env=env).out
    new_workspace(workspace / "src/more", *depends("turtle"))
    (workspace / "src/ros/turtle").mkdir()
    ran = forge("fetch", "--vendor", "src/ros", cwd=workspace, env=env)
    assert ran.code == 2
    assert "src/ros/turtle' exists already" in ran.err
    assert [path.name for path in (workspace / "src/ros/turtle").iterdir()] == []


def test_the_lock_is_emptied_when_nothing_is_needed(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", cwd=workspace, env=env).code == 0
    new_workspace(workspace, *depends("libacl1-dev"))
    assert forge("fetch", cwd=workspace, env=env).code == 0
    assert "package" not in locked(workspace)


def test_exported_repositories_use_the_vcs_format(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", "--export", "ros.repos", cwd=workspace, env=env).code == 0
    entry = read_yaml((workspace / "ros.repos").read_bytes(), workspace)["repositories"]["rclmini"]
    url = "https://example.invalid/rclmini-release.git"
    assert entry == {"type": "git", "url": url, "version": "release/humble/rclmini/1.0.0-1"}
