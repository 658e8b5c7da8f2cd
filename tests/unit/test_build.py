"""`forge build` from the command line, on packages that cost little to build."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.packages import manifest_text

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Forge, Tree

CMAKE = """cmake_minimum_required(VERSION 3.18)
project({name} NONE)
file(WRITE ${{CMAKE_CURRENT_BINARY_DIR}}/{name}.txt "{name}\\n")
install(FILES ${{CMAKE_CURRENT_BINARY_DIR}}/{name}.txt DESTINATION share/{name})
{more}
"""


def files(name: str, *lines: str, more: str = "") -> dict[str, str]:
    """Return a plain CMake package."""
    return {
        f"src/{name}/package.xml": manifest_text(name, *lines, build_type="cmake"),
        f"src/{name}/CMakeLists.txt": CMAKE.format(name=name, more=more),
    }


@pytest.fixture
def workspace(tree: Tree) -> Path:
    """Return a workspace in which b needs a and c needs b."""
    return tree({**files("a"), **files("b", "<depend>a</depend>"), **files("c", "<depend>b</depend>")})


def test_a_workspace_is_built_in_order_into_colcons_layout(forge: Forge, workspace: Path) -> None:
    ran = forge("build", cwd=workspace)
    assert ran.code == 0, ran.err
    words = [line.split("[")[0].strip() for line in ran.out.splitlines()]
    order = ("a", "b", "c")
    assert words[:6] == [f"{word} {name}" for name in order for word in ("Starting >>>", "Finished <<<")]
    assert words[7] == "Summary: 3 packages finished"
    assert (workspace / "install/b/share/b/b.txt").read_text() == "b\n"
    assert (workspace / "install/.colcon_install_layout").read_text().strip() == "isolated"
    assert (workspace / "build/COLCON_IGNORE").exists()
    assert (workspace / "log/latest_build/a/stdout_stderr.log").is_file()
    assert forge("list", "-n", cwd=workspace).out == "a\nb\nc\n"


def test_selected_packages_need_theirs_installed(forge: Forge, workspace: Path) -> None:
    ran = forge("build", "--packages-select", "c", cwd=workspace)
    assert ran.code == 2
    assert "error: 'c' needs 'a', 'b', which are not built yet" in ran.err
    assert "forge build --packages-up-to c" in ran.err
    assert forge("build", "--packages-up-to", "b", cwd=workspace).code == 0
    assert forge("build", "--packages-select", "c", cwd=workspace).code == 0


def test_a_merged_install_and_back_is_refused(forge: Forge, workspace: Path) -> None:
    assert forge("build", "--merge-install", "--packages-select", "a", cwd=workspace).code == 0
    assert (workspace / "install/share/a/a.txt").is_file()
    ran = forge("build", "--packages-select", "a", cwd=workspace)
    assert ran.code == 2
    assert "--merge-install" in ran.err


def test_a_failure_is_told_with_its_place_and_stops_the_rest(forge: Forge, workspace: Path) -> None:
    (workspace / "src/b/CMakeLists.txt").write_text('project(b NONE)\nmessage(FATAL_ERROR "no luck")\n')
    ran = forge("build", cwd=workspace)
    assert ran.code == 1
    assert "Failed   <<< b" in ran.err
    assert "first error in step 'cmake':\n    CMake Error at CMakeLists.txt:2 (message):" in ran.err
    assert f"log: {workspace}/log/build_" in ran.err
    assert f"repeat: cd {workspace}/build/b && " in ran.err
    assert "  1 package failed: b\n" in ran.out
    assert "  1 package not processed\n" in ran.out
    assert not (workspace / "install/b/share/b/package.sh").exists()


def test_going_on_after_a_failure(forge: Forge, workspace: Path, tree: Tree) -> None:
    tree(files("d", more='message(FATAL_ERROR "x")'))
    ran = forge("build", "--continue-on-error", "--executor", "sequential", cwd=workspace)
    assert ran.code == 1
    assert "Finished <<< c" in ran.out


def test_nothing_is_configured_twice_and_a_change_of_options_configures_again(
    forge: Forge, workspace: Path
) -> None:
    def steps() -> str:
        return (workspace / "log/latest_build/a/command.log").read_text()

    forge("build", "--packages-select", "a", cwd=workspace)
    assert " -C " in steps()
    forge("build", "--packages-select", "a", cwd=workspace)
    assert " -C " not in steps()
    forge("build", "--packages-select", "a", "--cmake-args", "-DX=1", "-Wno-dev", cwd=workspace)
    assert " -DX=1 -Wno-dev " in steps()


def test_an_empty_folder_is_told_what_to_do(forge: Forge, tmp_path: Path) -> None:
    ran = forge("build", cwd=tmp_path)
    assert ran.code == 2
    assert "there is no package below" in ran.err
    assert "forge pkg create" in ran.err
    assert not (tmp_path / "build").exists()


def test_event_handlers_are_colcons(forge: Forge, workspace: Path) -> None:
    ran = forge(
        "build", "--packages-select", "a", "--event-handlers", "console_direct+", "summary-", cwd=workspace
    )
    assert "-- Configuring done" in ran.out
    assert "Summary" not in ran.out
    ran = forge("build", "--event-handlers", "console_drect+", cwd=workspace)
    assert (ran.code, "did you mean 'console_direct'?" in ran.err) == (2, True)


def test_a_need_that_nobody_provides_is_told_before_cmake_runs(forge: Forge, tree: Tree) -> None:
    root = tree(files("node", "<depend>rclcpp</depend>"))
    ran = forge("build", cwd=root)
    assert ran.code == 2
    assert ran.err.startswith("src/node/package.xml: error: 'node' needs 'rclcpp', which is neither")
    assert not (root / "build").exists()


def test_links_into_the_sources(forge: Forge, tree: Tree) -> None:
    more = "install(FILES data.txt DESTINATION share/a)"
    root = tree({**files("a", more=more), "src/a/data.txt": "one"})
    assert forge("build", "--symlink-install", cwd=root).code == 0
    assert (root / "install/a/share/a/data.txt").is_symlink()
