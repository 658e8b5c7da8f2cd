"""`forge build` from the command line, on packages that cost little to build."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from forge.base.layout import docs_url
from tests.conftest import Forge, Tree, Variables
from tests.packages import manifest_text
from tests.testable import cmake_package


@pytest.fixture
def workspace(tree: Tree) -> Path:
    """Return a workspace in which b needs a and c needs b."""
    return tree(
        {
            **cmake_package("a"),
            **cmake_package("b", needs="<depend>a</depend>"),
            **cmake_package("c", needs="<depend>b</depend>"),
        }
    )


def test_a_workspace_is_built_in_order_into_the_colcon_layout(forge: Forge, workspace: Path) -> None:
    ran = forge("build", cwd=workspace)
    assert ran.code == 0, ran.err
    words = [line.split("[")[0].strip() for line in ran.out.splitlines()]
    order = ("a", "b", "c")
    assert words[:6] == [f"{word} {name}" for name in order for word in ("Starting >>>", "Finished <<<")]
    assert words[7] == "Summary: 3 packages finished"
    assert (workspace / "install/b/share/b/package.xml").is_file()
    assert (workspace / "install/.colcon_install_layout").read_text().strip() == "isolated"
    assert (workspace / "build/COLCON_IGNORE").exists()
    assert (workspace / "log/latest_build/a/stdout_stderr.log").is_file()
    assert forge("list", "-n", cwd=workspace).out == "a\nb\nc\n"


SEEMS_REQUIRED = {
    "comment": "#[[\nfind_package(rclcpp REQUIRED)\n]]",
    "string": 'message(STATUS "\nfind_package(rclcpp REQUIRED)\n")',
    "bracket": "message(STATUS [=[\nfind_package(rclcpp REQUIRED)\n]=])",
    "loop": "foreach(x IN LISTS NOTHING)\nfind_package(rclcpp REQUIRED)\nendforeach()",
    "branch": "if(NEVER)\nfind_package(rclcpp REQUIRED)\nendif()",
    "uncalled": "function(f)\nfind_package(rclcpp REQUIRED)\nendfunction()",
    "early": "if(TRUE)\nreturn()\nendif()\nfind_package(rclcpp REQUIRED)",
    "overridden": "macro(find_package)\nendmacro()\nfind_package(rclcpp REQUIRED)",
    "included": "include(own.cmake)\nfind_package(rclcpp REQUIRED)",
    "module": "list(APPEND CMAKE_MODULE_PATH ${CMAKE_SOURCE_DIR}/..)\nfind_package(rclcpp REQUIRED)",
    "unknown": "function(ament_target_dependencies)\nendfunction()\nament_target_dependencies(x rclcpp)",
}
"""Ways to mention a package that CMake does without."""


def test_an_ignored_dependency_is_not_reported_as_missing(forge: Forge, tree: Tree) -> None:
    root = tree({**cmake_package("rcl_a"), **cmake_package("warned", needs="<depend>rcl_a</depend>")})
    hint = "if the build needs it, remove it from --packages-ignore and --packages-ignore-regex"
    for arguments in (("--packages-ignore", "rcl_a"), ("--packages-ignore-regex", "rcl")):
        ran = forge("build", *arguments, cwd=root)
        assert ran.code == 0, ran.err
        assert "warning: 'warned' needs 'rcl_a', which is in the workspace, but ignored" in ran.err
        assert hint in ran.err
        shutil.rmtree(root / "build")


def test_possibly_optional_dependencies_do_not_stop_the_build(forge: Forge, tree: Tree) -> None:
    made: dict[str, str] = {"src/Findrclcpp.cmake": "set(rclcpp_FOUND TRUE)\n"}
    for name, more in SEEMS_REQUIRED.items():
        made |= cmake_package(name, needs="<depend>rclcpp</depend>")
        made[f"src/{name}/CMakeLists.txt"] = (
            f"cmake_minimum_required(VERSION 3.18)\nproject({name} NONE)\n"
            f"install(FILES package.xml DESTINATION share/{name})\n{more}\n"
        )
    made["src/included/own.cmake"] = "set(rclcpp_DIR ${CMAKE_SOURCE_DIR})\n"
    made["src/included/rclcppConfig.cmake"] = ""
    ran = forge("build", cwd=tree(made))
    assert ran.code == 0, ran.err
    assert f"Summary: {len(SEEMS_REQUIRED)} packages finished" in ran.out
    assert "need 'rclcpp', which is neither in the workspace nor" in ran.err


def test_options_can_locate_a_missing_package(forge: Forge, tree: Tree) -> None:
    root = tree(
        {**cmake_package("node", needs="<depend>rclcpp</depend>"), "elsewhere/rclcppConfig.cmake": ""}
    )
    tree({"src/node/CMakeLists.txt": "project(node NONE)\nfind_package(rclcpp REQUIRED)\ninstall()\n"})
    ran = forge("build", cwd=root)
    assert ran.code == 1
    assert "warning: 'node' needs 'rclcpp', which is neither in the workspace nor" in ran.err
    assert "hint: 'forge fetch' downloads it; or source a ROS installation that contains 'rclcpp'" in ran.err
    ran = forge("build", "--cmake-args", f"-Drclcpp_DIR={root / 'elsewhere'}", cwd=root)
    assert ran.code == 0, ran.err


def test_an_unbuilt_package_may_come_from_an_underlay(forge: Forge, tree: Tree) -> None:
    root = tree({f"under/{path}": text for path, text in cmake_package("a").items()})
    tree(
        {
            f"over/{p}": text
            for p, text in {**cmake_package("a"), **cmake_package("b", needs="<depend>a</depend>")}.items()
        }
    )
    assert forge("build", cwd=root / "under").code == 0
    sourced = {"CMAKE_PREFIX_PATH": str(root / "under/install/a")}
    ran = forge("build", "--packages-select", "b", cwd=root / "over", env=sourced)
    assert ran.code == 0, ran.err
    assert f"'a' of the workspace is not built yet; using the one in '{root}/under/install/a'" in ran.err
    again = forge("build", "--packages-select", "b", cwd=root / "over", env=sourced)
    assert "Starting" not in again.out


@pytest.mark.parametrize("number", ["-1", "x", "1.5"])
def test_negative_numbers_of_packages_are_rejected(forge: Forge, workspace: Path, number: str) -> None:
    ran = forge("build", f"--parallel-workers={number}", cwd=workspace)
    assert (ran.code, "is not a number of packages" in ran.err) == (2, True)


def test_cmake_definitions_do_not_affect_python_packages(forge: Forge, tree: Tree) -> None:
    manifest = manifest_text("p", build_type="ament_python")
    setup = "from setuptools import setup\nsetup(name='p', version='1')\n"
    root = tree({"src/p/package.xml": manifest, "src/p/setup.py": setup, **cmake_package("c")})
    assert forge("build", "--packages-select", "p", "--cmake-args", "-DX", cwd=root).code == 0
    assert forge("build", "--packages-select", "c", "--cmake-args", "-DX", cwd=root).code == 2


def test_dependencies_of_selected_packages_must_be_installed(forge: Forge, workspace: Path) -> None:
    ran = forge("build", "--packages-select", "c", cwd=workspace)
    assert ran.code == 2
    assert "error: 'c' needs 'a', 'b', which are not built yet" in ran.err
    assert "forge build --packages-up-to c" in ran.err
    assert forge("build", "--packages-up-to", "b", cwd=workspace).code == 0
    assert forge("build", "--packages-select", "c", cwd=workspace).code == 0


def test_warnings_are_not_repeated_if_nothing_is_built(forge: Forge, tree: Tree) -> None:
    workspace = tree(cmake_package("a", needs="<exec_depend>launch_ros</exec_depend>"))
    first = forge("build", cwd=workspace)
    assert first.code == 0
    assert "warning: 'a' needs 'launch_ros', which is neither" in first.err
    again = forge("build", cwd=workspace)
    assert (again.code, again.err) == (0, "")


def test_a_failure_is_reported_with_its_log_and_stops_the_build(forge: Forge, workspace: Path) -> None:
    lists = 'cmake_minimum_required(VERSION 3.16)\nproject(b NONE)\nmessage(FATAL_ERROR "no luck")\n'
    (workspace / "src/b/CMakeLists.txt").write_text(lists)
    ran = forge("build", cwd=workspace)
    assert ran.code == 1
    assert "Failed   <<< b" in ran.err
    assert "--- stderr: b\nCMake Error at src/b/CMakeLists.txt:3 (message):" in ran.err
    assert ran.err.count("CMake Error") == 1
    assert "\n  first error in step 'cmake': see above\n" in ran.err
    assert "  log: log/build_" in ran.err
    assert "  repeat: sh build/b/.forge/last_command\n" in ran.err
    argv = ("sh", "build/b/.forge/last_command")
    assert b"no luck" in subprocess.run(argv, cwd=workspace, capture_output=True, check=False).stderr
    below = forge("build", cwd=workspace / "src/b").err
    assert "  log: ../../log/build_" in below
    assert "  repeat: sh ../../build/b/.forge/last_command\n" in below
    assert "  1 package failed: b\n" in ran.out
    assert "  1 package not processed\n" in ran.out
    assert not (workspace / "install/b/share/b/package.sh").exists()


def test_a_definition_without_a_value_is_rejected_before_the_build(forge: Forge, workspace: Path) -> None:
    ran = forge("build", "--cmake-args", "-DBUILD_TESTING", cwd=workspace)
    assert (ran.code, ran.out) == (2, "")
    assert ran.err == (
        "error: --cmake-args contains '-DBUILD_TESTING' without a value\n"
        "hint: write -DBUILD_TESTING=ON, or another value\n"
    )


def test_continue_on_error_builds_independent_packages(forge: Forge, workspace: Path, tree: Tree) -> None:
    tree(cmake_package("d", 'message(FATAL_ERROR "x")'))
    ran = forge("build", "--continue-on-error", "--executor", "sequential", cwd=workspace)
    assert ran.code == 1
    assert "Finished <<< c" in ran.out


def test_force_starts_with_an_empty_build_folder(forge: Forge, workspace: Path) -> None:
    forge("build", "--packages-select", "a", cwd=workspace)
    left = workspace / "build/a/left.txt"
    left.touch()
    forge("build", "--packages-select", "a", "--force", cwd=workspace)
    assert " -C " in (workspace / "log/latest_build/a/command.log").read_text()
    assert not left.exists()


def built(forge: Forge, root: Path, *options: str, env: Variables | None = None) -> list[str]:
    """Build and return the packages that ran, in their order."""
    ran = forge("build", *options, cwd=root, env=env)
    assert ran.code == 0, ran.err
    return [line.split()[2] for line in ran.out.splitlines() if line.startswith("Finished <<<")]


def test_a_dry_run_prints_commands_without_running_them(forge: Forge, workspace: Path) -> None:
    before = sorted(workspace.rglob("*"))
    ran = forge("build", "--dry-run", cwd=workspace)
    assert "a: build, not built yet\n" in ran.out
    assert f"# a\ncd {workspace}/build/a && " in ran.out
    assert sorted(workspace.rglob("*")) == before


def test_a_dry_run_prints_the_same_warnings_as_a_build(forge: Forge, tree: Tree) -> None:
    root = tree(
        {
            "src/p/package.xml": manifest_text("p", "<depend>ros_thing_msgs</depend>", build_type="cmake"),
            "src/p/CMakeLists.txt": "cmake_minimum_required(VERSION 3.18)\nproject(p NONE)\n",
        }
    )
    dry, real = (forge("build", *options, cwd=root).err for options in (("--dry-run",), ()))
    assert "'ros_thing_msgs'" in dry
    assert dry == real


def test_the_log_level_controls_reasons_and_commands(forge: Forge, workspace: Path) -> None:
    assert "a: build, it was" not in forge("build", "--packages-select", "a", cwd=workspace).err
    assert "1 package: up to date\n" in forge("--log-level", "info", "build", cwd=workspace).err
    ran = forge("build", "--force", "--log-level", "10", cwd=workspace)
    assert f"cd {workspace}/build/a && " in ran.err
    assert forge("build", cwd=workspace, env={"COLCON_LOG_LEVEL": "INFO"}).err.startswith("3 packages: up")
    ran = forge("build", "--log-level", "chatty", cwd=workspace)
    assert (ran.code, "unknown log level 'chatty'" in ran.err) == (2, True)


def test_a_step_can_be_repeated_by_hand(forge: Forge, workspace: Path) -> None:
    (workspace / "src/a/CMakeLists.txt").write_text('project(a NONE)\nmessage(FATAL_ERROR "here")\n')
    forge("build", cwd=workspace)
    line = forge("build", "--print-command", "a", cwd=workspace).out
    again = subprocess.run(["sh", "-c", line], capture_output=True, text=True, check=False)
    assert again.returncode != 0
    assert "here" in again.stderr
    assert forge("build", "--print-command", "b", cwd=workspace).code == 2


def test_a_workspace_whose_packages_are_all_ignored_gets_a_hint(forge: Forge, workspace: Path) -> None:
    (workspace / "src/COLCON_IGNORE").touch()
    ran = forge("build", cwd=workspace)
    assert ran.code == 2
    assert "hint: packages are ignored; 'forge ignore' lists them" in ran.err


def test_an_empty_folder_gets_a_hint(forge: Forge, tmp_path: Path) -> None:
    ran = forge("build", cwd=tmp_path)
    assert ran.code == 2
    assert "no packages found below" in ran.err
    assert "forge pkg create" in ran.err
    assert "--base-paths" not in ran.err
    assert not (tmp_path / "build").exists()
    ran = forge("build", "--base-paths", "nowhere", cwd=tmp_path)
    assert ran.code == 2
    assert "warning: --base-paths: 'nowhere' does not exist" in ran.err


def test_event_handlers_of_colcon_are_supported(forge: Forge, workspace: Path) -> None:
    ran = forge(
        "build", "--packages-select", "a", "--event-handlers", "console_direct+", "summary-", cwd=workspace
    )
    assert "-- Configuring done" in ran.out
    assert "Summary" not in ran.out


def test_a_missing_dependency_is_reported_before_cmake_runs(forge: Forge, tree: Tree) -> None:
    root = tree(cmake_package("node", needs="<depend>rclcpp</depend>"))
    ran = forge("build", "--dry-run", cwd=root)
    assert ran.code == 0
    assert ran.err.startswith("src/node/package.xml:8:3: warning: 'node' needs 'rclcpp', which is neither")
    assert f"; see {docs_url('how-to/rclcpp.md')}\n" in ran.err


def test_a_single_package_workspace_stays_up_to_date(forge: Forge, tree: Tree) -> None:
    root = tree({name.removeprefix("src/a/"): text for name, text in cmake_package("a").items()})
    assert built(forge, root) == ["a"]
    assert built(forge, root) == []


def test_a_link_that_is_reinstalled_is_kept(forge: Forge, tree: Tree) -> None:
    """CMake neither installs nor lists a link again that points where it did."""
    root = tree({**cmake_package("a", "install(FILES link.txt DESTINATION share/a)"), "src/a/to.txt": "1"})
    (root / "src/a/link.txt").symlink_to(root / "src/a/to.txt")
    for number in range(3):
        (root / "src/a/other.txt").write_text(str(number))
        assert built(forge, root) == ["a"]
        assert (root / "install/a/share/a/link.txt").readlink() == root / "src/a/to.txt"


def test_the_next_build_completes_a_killed_build(forge: Forge, workspace: Path) -> None:
    assert forge("build", cwd=workspace).code == 0
    journal = workspace / "build/forge_journal.jsonl"
    lines = journal.read_text().splitlines(keepends=True)
    ended = max(number for number, line in enumerate(lines) if line == '{"ended": true}\n')
    journal.write_text("".join(lines[:ended]))
    (workspace / "install/setup.sh").unlink()
    drafts = [workspace / "install/.setup.sh.0a1b2c3d.forge-draft"]
    drafts += [workspace / "install/b/share/b/.package.sh.0a1b2c3d.forge-draft"]
    for draft in drafts:
        draft.touch()
    ran = forge("build", cwd=workspace)
    assert ran.code == 0
    assert "3 packages unchanged" in ran.out
    assert (workspace / "install/setup.sh").is_file()
    assert not any(draft.exists() for draft in drafts)
    assert journal.read_text().splitlines()[-1] != '{"ended": false}'


@pytest.mark.parametrize("generator", ["Ninja", "Unix Makefiles"])
def test_missing_targets_can_be_skipped(forge: Forge, tree: Tree, generator: str) -> None:
    touch = 'COMMAND "${CMAKE_COMMAND}" -E touch made'
    more = f"add_custom_target(say.it {touch})\nadd_custom_target(fail.it COMMAND false)"
    root = tree({**cmake_package("with", more), **cmake_package("without", "add_custom_target(say_it)")})
    options = ("--continue-on-error", "--cmake-args", "-G", generator, "--cmake-target")
    strict = forge("build", *options, "say.it", cwd=root)
    assert strict.code == 1
    assert "Failed   <<< without" in strict.err
    (root / "build/with/made").unlink()
    ran = forge("build", "--cmake-target-skip-unavailable", *options, "say.it", cwd=root)
    assert ran.code == 0, ran.err
    assert (root / "build/with/made").is_file()
    assert (root / "install/without/share/without/package.xml").is_file()
    ran = forge("build", "--cmake-target-skip-unavailable", *options, "fail.it", cwd=root)
    assert ran.code == 1
    assert "Failed   <<< with " in ran.err
    assert "Failed   <<< without" not in ran.err


INNER = """include(ExternalProject)
ExternalProject_Add(inner SOURCE_DIR ${CMAKE_CURRENT_SOURCE_DIR}/inner INSTALL_COMMAND ""
  BUILD_COMMAND ${CMAKE_COMMAND} -E touch ${CMAKE_CURRENT_BINARY_DIR}/built)"""


def test_the_newest_cmake_builds_projects_written_for_old_ones(forge: Forge, tree: Tree) -> None:
    """Those that a package builds itself are included."""
    package = cmake_package("a", INNER)
    package["src/a/CMakeLists.txt"] = package["src/a/CMakeLists.txt"].replace(
        "VERSION 3.18", "VERSION 2.8.12"
    )
    old = "cmake_minimum_required(VERSION 2.8.12)\nproject(inner NONE)\n"
    root = tree({**package, "src/a/inner/CMakeLists.txt": old})
    newest = str(Path(sys.executable).with_name("cmake"))
    ran = forge("build", cwd=root, env={"CMAKE_COMMAND": newest})
    assert ran.code == 0, ran.err
    assert (root / "build/a/built").is_file()
    # As in CMake, the user's value is used.
    ran = forge("build", cwd=root, env={"CMAKE_COMMAND": newest, "CMAKE_POLICY_VERSION_MINIMUM": "2.8"})
    assert ran.code == 1
    assert "CMake < 3.5" in ran.err


def test_an_unused_variable_is_reported_once(forge: Forge, tree: Tree) -> None:
    root = tree({**cmake_package("a", "message(STATUS ${USED})"), **cmake_package("b")})
    ran = forge("build", "--cmake-args", "-DUSED=1", "-DCMAKE_BUILD_TYP=1", cwd=root)
    assert ran.code == 0
    assert ran.err == ""
    unused = "  CMake variables not used by any package: CMAKE_BUILD_TYP\n"
    assert f"{unused}  hint: did you mean 'CMAKE_BUILD_TYPE' instead of 'CMAKE_BUILD_TYP'?\n" in ran.out
    assert "stderr" not in ran.out


def test_setup_scripts_are_updated_if_a_conditional_folder_appears(forge: Forge, tree: Tree) -> None:
    hook = "install(FILES local_setup.dsv DESTINATION share/b)"
    root = tree(
        {**cmake_package("b", hook), "src/b/local_setup.dsv": "prepend-non-duplicate-if-exists;PATH;tools\n"}
    )
    assert forge("build", cwd=root).code == 0
    script = root / "install/local_setup.sh"
    assert "/b/tools" not in script.read_text()
    cmake = root / "src/b/CMakeLists.txt"
    cmake.write_text(cmake.read_text() + "install(FILES package.xml DESTINATION tools)\n")
    assert forge("build", cwd=root).code == 0
    assert "/b/tools" in script.read_text()


def test_a_variable_used_only_by_an_unchanged_package_is_not_reported_as_unused(
    forge: Forge, tree: Tree
) -> None:
    root = tree({**cmake_package("a", "message(STATUS ${USED})"), **cmake_package("b")})
    assert forge("build", "--cmake-args", "-DUSED=1", cwd=root).code == 0
    with (root / "src/b/CMakeLists.txt").open("a") as lists:
        lists.write("# changed\n")
    ran = forge("build", "--cmake-args", "-DUSED=1", cwd=root)
    assert "Starting >>> b" in ran.out
    assert "not used" not in ran.out
    selected = forge("build", "--packages-select", "b", "--cmake-args", "-DUSED=2", cwd=root)
    assert "not used" not in selected.out


def test_missing_git_submodules_are_reported(forge: Forge, tree: Tree) -> None:
    root = tree({".gitmodules": '[submodule "up"]\n\tpath = src/up\n', "src/up/x": ""})
    (root / "src/up/x").unlink()
    ran = forge("build", cwd=root)
    assert ran.code == 2
    assert "hint: the submodule 'src/up' is not checked out: git submodule update --init src/up" in ran.err


def test_packages_still_running_after_a_failure_are_reported(forge: Forge, tree: Tree) -> None:
    """A step that runs is not killed; without a word, a long one would look like a hang."""
    slow = "add_custom_target(wait ALL COMMAND ${CMAKE_COMMAND} -E sleep 3)"
    late = "execute_process(COMMAND ${CMAKE_COMMAND} -E sleep 1)\nmessage(FATAL_ERROR no)"
    root = tree({**cmake_package("fails", late), **cmake_package("slow", slow)})
    ran = forge("build", "--parallel-workers", "2", cwd=root)
    assert ran.code == 1
    assert ran.err.count("waiting for the running step of 'slow'\n") == 1
    ran = forge("build", "--parallel-workers", "2", "--continue-on-error", cwd=root)
    assert ran.code == 1
    assert "waiting" not in ran.err


def test_downloads_are_announced_before_the_first_build(forge: Forge, tree: Tree) -> None:
    vendor = """include(FetchContent)
if(NEVER)
  ExternalProject_Add(y GIT_REPOSITORY https://x.org/y.git GIT_TAG 1)
  file(DOWNLOAD https://x.org/z.tar.gz z)
endif()
# FetchContent_Declare(no URL https://x.org/no)
set(doc "FetchContent_Declare(no URL https://x.org/no)")
FetchContent_Declare(local URL file:///x)"""
    root = tree({**cmake_package("vendor", vendor), **cmake_package("b", "message(STATUS https://x.org/no)")})
    first = forge("build", cwd=root)
    assert first.code == 0, first.err
    addresses = "https://x.org/y.git ('vendor'), https://x.org/z.tar.gz ('vendor')"
    assert f"note: this build may download from 2 URLs: {addresses}\n" in first.err
    with (root / "src/vendor/CMakeLists.txt").open("a") as lists:
        lists.write("# changed\n")
    assert "may download" not in forge("build", cwd=root).err
