"""The example workspace: built in every way, and its programs agree with each other."""

import shutil
from pathlib import Path

import pytest

from tests.snippets import ROOT, shell

EXAMPLES = ROOT / "examples_ws"

pytestmark = pytest.mark.needs("bash", "cmake", "make", "g++")

MOVES = """\
service: asked for 2.000 m, stands at 1.992 m
action: goal -1.000 m accepted
"""


@pytest.fixture(
    scope="module",
    params=["", "--merge-install --symlink-install --executor sequential"],
    ids=["isolated", "merged-linked"],
)
def examples(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    """Build a copy of the examples and return its folder."""
    folder = tmp_path_factory.mktemp("examples") / "ws"
    shutil.copytree(EXAMPLES / "src", folder / "src")
    output = shell(f"forge build {request.param} || echo 'FAILED'", folder)
    assert "FAILED" not in output, output
    assert "Summary: 7 packages finished" in output
    return folder


def sourced(folder: Path, script: str) -> str:
    """Run a script after sourcing the workspace, and return what it printed."""
    return shell(f"source install/setup.bash && {script}", folder)


def test_cpp_and_python_programs_print_the_same_motion(examples: Path) -> None:
    """The C++ library and the Python module reach the same points by the same messages."""
    cpp = sourced(examples, "forge run robot_demo_cpp move_robot")
    assert cpp.startswith(MOVES)
    assert cpp.endswith("status: stopped\n")
    assert sourced(examples, "forge run robot_demo_py move_robot") == cpp


def test_python_reads_messages_printed_by_cpp(examples: Path) -> None:
    """A RobotPose survives the way through YAML: both programs report equal values."""
    report = sourced(examples, "forge run robot_demo_cpp print_pose --report")
    assert report.startswith("status 1, position (1.2500, -0.5000, 0.0000)")
    piped = sourced(examples, "forge run robot_demo_cpp print_pose | forge run robot_demo_py read_pose")
    assert piped == report


def test_every_workspace_package_is_listed_once(examples: Path) -> None:
    names = shell("forge list --names-only", examples).split()
    assert names == sorted(path.name for path in (EXAMPLES / "src").iterdir())


def test_installed_packages_are_found_by_forge_and_python(examples: Path) -> None:
    listed = sourced(examples, "forge pkg list").split()
    # A plain CMake package leaves no mark in the index.
    assert {"example_ros2_interfaces", "robot_configs", "robot_demo_cpp", "robot_demo_py"} <= set(listed)
    assert "plain_cmake_math" not in listed
    share = sourced(examples, "forge pkg prefix --share robot_configs").strip()
    python = "from ament_index_python.packages import get_package_share_directory as share"
    assert sourced(examples, f"python3 -c \"{python}; print(share('robot_configs'))\"").strip() == share


def test_a_consumer_links_the_exported_library(examples: Path, tmp_path: Path) -> None:
    """A project outside of the workspace finds library, headers and interfaces by one name."""
    (tmp_path / "main.cpp").write_text(
        "#include <robot_motion/robot.hpp>\nint main() { return robot_motion::Robot().arrived() ? 0 : 1; }\n",
        encoding="utf-8",
    )
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.22)\nproject(consumer)\nfind_package(robot_motion REQUIRED)\n"
        "add_executable(main main.cpp)\ntarget_link_libraries(main robot_motion::robot_motion)\n",
        encoding="utf-8",
    )
    build = f"cd '{tmp_path}' && cmake -B out . >/dev/null && cmake --build out >/dev/null"
    assert sourced(examples, f"{build} && out/main && echo 'linked and run'") == "linked and run\n"


def test_actions_build_their_implied_dependencies(examples: Path) -> None:
    """robot_control_interfaces does not name action_msgs; its types refer to it all the same."""
    manifest = EXAMPLES / "src/robot_control_interfaces/package.xml"
    assert "action_msgs</" not in manifest.read_text(encoding="utf-8")
    python = "from robot_control_interfaces.action import MoveRobot; print(MoveRobot.Impl.CancelGoalService)"
    assert "action_msgs.srv._cancel_goal.CancelGoal" in sourced(examples, f'python3 -c "{python}"')
