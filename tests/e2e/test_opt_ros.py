"""Workspaces on a ROS that is installed as from binary packages, in one read-only prefix."""

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from forge.base.layout import Layout
from forge.cli.preparation import build_variables
from forge.environment.prefixes import find_underlays
from tests.opt_ros import DIST, SITE, install
from tests.packages import manifest_text, write_files
from tests.rosidl import DEBIAN, interface_package

pytestmark = pytest.mark.needs(str(DEBIAN), "cmake", "g++")

FILES = {
    **interface_package("opt_msgs", {"msg/Status.msg": "uint8 FAULT=1\nuint8 status 1\nstring text\n"}),
    "src/opt_cpp/package.xml": manifest_text(
        "opt_cpp", "<depend>opt_msgs</depend><buildtool_depend>ament_cmake</buildtool_depend>"
    ),
    "src/opt_cpp/CMakeLists.txt": """cmake_minimum_required(VERSION 3.10)
project(opt_cpp CXX)
find_package(ament_cmake REQUIRED)
find_package(rosidl_typesupport_introspection_cpp REQUIRED)
find_package(opt_msgs REQUIRED)
add_executable(talker talker.cpp)
target_link_libraries(talker opt_msgs::opt_msgs__rosidl_generator_cpp
  opt_msgs::opt_msgs__rosidl_typesupport_introspection_cpp)
install(TARGETS talker DESTINATION lib/${PROJECT_NAME})
if(BUILD_TESTING)
  add_test(NAME talks COMMAND talker)
endif()
ament_package()
""",
    "src/opt_cpp/talker.cpp": """#include <cstdio>
#include <opt_msgs/msg/status.hpp>
#include <rosidl_typesupport_introspection_cpp/message_introspection.hpp>
#include <rosidl_typesupport_introspection_cpp/message_type_support_decl.hpp>

int main() {
  using namespace rosidl_typesupport_introspection_cpp;
  const auto *type = get_message_type_support_handle<opt_msgs::msg::Status>();
  const auto *members = static_cast<const MessageMembers *>(type->data);
  std::printf("%s has %u members\\n", members->message_name_, members->member_count_);
  return opt_msgs::msg::Status{}.status == opt_msgs::msg::Status::FAULT ? 0 : 1;
}
""",
    "src/opt_py/package.xml": manifest_text(
        "opt_py",
        "<depend>opt_msgs</depend><test_depend>python3-pytest</test_depend>",
        build_type="ament_python",
    ),
    "src/opt_py/setup.cfg": "[install]\ninstall_scripts=$base/lib/opt_py\n",
    "src/opt_py/setup.py": """from setuptools import setup

setup(
    name="opt_py",
    version="1.0.0",
    packages=["opt_py"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/opt_py"]),
        ("share/opt_py", ["package.xml"]),
    ],
    entry_points={"console_scripts": ["reader = opt_py.reader:main"]},
)
""",
    "src/opt_py/resource/opt_py": "",
    "src/opt_py/opt_py/__init__.py": "",
    "src/opt_py/opt_py/reader.py": """import sys
from pathlib import Path

import ament_package
import rosidl_parser


def folders():
    return [str(Path(module.__file__).parents[1]) for module in (ament_package, rosidl_parser)]


def main():
    print(sys.executable, *folders())
""",
    "src/opt_py/test/test_reader.py": """from opt_py.reader import folders


def test_both_folders_of_the_underlay_are_on_the_path():
    assert [folder.split("/")[-1] for folder in folders()] == ["site-packages", "dist-packages"]
""",
}


@dataclass(frozen=True, slots=True)
class Built:
    """A workspace, what its build has printed, and the underlay with its files before it."""

    root: Path
    prefix: Path
    python: Path
    printed: str
    before: dict[str, tuple[int, ...]]


def states(prefix: Path) -> dict[str, tuple[int, ...]]:
    """Return what changes with each write, of all files and folders."""
    found = ((str(path), path.lstat()) for path in (prefix, *prefix.rglob("*")))
    return {path: (s.st_mode, s.st_size, s.st_mtime_ns, s.st_ctime_ns, s.st_ino) for path, s in found}


def shell(command: str, cwd: Path, **variables: str) -> str:
    """Run sh as in a new terminal and return what it prints; without bytecode, which Python itself caches."""
    program = Path(sys.executable).parent
    environment = {
        "HOME": str(cwd),
        "LC_ALL": "C.UTF-8",
        "PATH": f"{program}:{os.environ['PATH']}",
        "PYTHONDONTWRITEBYTECODE": "1",
        **variables,
    }
    argv = ["sh", "-c", command]
    done = subprocess.run(argv, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    """Build the workspace with the underlay sourced."""
    folder = tmp_path_factory.mktemp("machine")
    prefix, root = folder / "opt/ros/humble", folder / "ws"
    python = install(prefix, folder)
    write_files(root, FILES)
    before = states(prefix)
    printed = shell(f". {prefix}/setup.sh && forge build", root)
    return Built(root, prefix, python, printed, before)


def test_packages_use_the_tools_of_the_underlay(built: Built) -> None:
    """With its ament, rosidl and interpreter: nothing that forge embeds, and not forge's own Python."""
    assert "Summary: 3 packages finished" in built.printed
    log = (built.root / "log/latest_build/opt_msgs/stdout_stderr.log").read_text(encoding="utf-8")
    assert "forge: runs" not in log, "all generators ran in the worker"
    installed = {path.name for path in (built.root / "install").glob("[!.]*") if path.is_dir()}
    assert installed == {"opt_msgs", "opt_cpp", "opt_py"}


def test_programs_run_after_sourcing_the_workspace_alone(built: Built) -> None:
    """Its setup script sources the underlay, both folders of modules included."""
    printed = shell(
        ". install/setup.sh && install/opt_cpp/lib/opt_cpp/talker && install/opt_py/lib/opt_py/reader",
        built.root,
    )
    assert printed.splitlines() == [
        "Status has 2 members",
        f"{built.python} {built.prefix / SITE} {built.prefix / DIST}",
    ]


def test_tests_run_without_sourcing(built: Built) -> None:
    assert "2 tests, 0 errors, 0 failures, 0 skipped" in shell("forge test", built.root)


@pytest.mark.parametrize(
    ("sourced", "variables"),
    [
        ("true", ()),
        (". {}/setup.sh", ()),
        (". {}/local_setup.sh", ()),
        (". install/setup.sh", ()),
        ("true", ("AMENT_PREFIX_PATH",)),
    ],
)
def test_sourcing_causes_no_rebuild(built: Built, sourced: str, variables: tuple[str, ...]) -> None:
    command = sourced.format(built.prefix)
    printed = shell(f"{command} && forge build", built.root, **dict.fromkeys(variables, str(built.prefix)))
    assert "0 packages finished, 3 packages unchanged" in printed


@pytest.mark.parametrize("name", ["AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH"])
def test_AMENT_PREFIX_PATH_suffices_for_a_build(built: Built, name: str, tmp_path: Path) -> None:
    """As below `sudo -E` or in an editor: forge adds what the setup scripts would have set."""
    layout = Layout(tmp_path / "build", tmp_path / "install", None)
    variables = build_variables(layout, {name: str(built.prefix)})
    assert find_underlays(variables, layout.install).chain == (built.prefix,)
    told = shell(
        f'. {built.prefix}/setup.sh && echo "$PYTHONPATH" "$LD_LIBRARY_PATH" "$ROS_DISTRO"', tmp_path
    )
    assert [variables[name] for name in ("PYTHONPATH", "LD_LIBRARY_PATH", "ROS_DISTRO")] == told.split()


def test_the_underlay_is_never_modified(built: Built) -> None:
    """By none of the tests above; the permissions alone would not stop root."""
    assert states(built.prefix) == built.before
