"""Scripts that a real ament runs at configure time: in forge's worker, with the same result."""

import os
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from tests.conftest import Tree
from tests.packages import manifest_text, write_files
from tests.rosidl import DEBIAN, interface_package, underlay

pytestmark = [pytest.mark.slow, pytest.mark.needs(str(DEBIAN), "g++", "strace")]

CMAKE = """cmake_minimum_required(VERSION 3.10)
project({0} NONE)
set(cmd [[sed s/\\./$x/]])
set(_cmd "${{cmd}}")
find_package(ament_cmake REQUIRED)
set(before "${{_python_interpreter}}")
set(_python_interpreter "")
set(empty "${{_python_interpreter}}")
{1}
find_package(ament_cmake_python REQUIRED)
ament_package()
set(own "${{_python_interpreter}} ${{before}} ${{cmd}}")
file(WRITE "${{CMAKE_BINARY_DIR}}/seen" "${{PROJECT_NAME}} ${{{0}_VERSION}} ${{{0}_MAINTAINER}} ${{own}}")
"""
FILES = {
    **{
        f"src/{name}/CMakeLists.txt": CMAKE.format(name, call)
        for name, call in (("one", ""), ("two", "ament_package_xml()"))
    },
    **{
        f"src/{name}/package.xml": manifest_text(
            name, '<author>A; "B" $C \\D</author>', "<buildtool_depend>ament_cmake</buildtool_depend>"
        )
        for name in ("one", "two")
    },
    **interface_package("three", {"msg/A.msg": "int32 a\n"}),
}
SCRIPT = re.compile(r'\["[^"]*python[^"]*", "[^"]*/((?:package_xml|templates)_2_cmake\.py)"')
RESULTS = ("seen", "ament_cmake_core/package.cmake", "ament_cmake_package_templates/templates.cmake")


def started_scripts(root: Path, *options: str) -> Counter[str]:
    """Build; return how many processes of their own the scripts had."""
    forge = (sys.executable, "-m", "forge", "build", "--python", sys.executable, *options)
    trace = root / "trace"
    argv = ("strace", "-f", "-qq", "-s", "4096", "-o", str(trace), "-e", "trace=execve", *forge)
    variables = {**os.environ, **underlay()}
    done = subprocess.run(argv, cwd=root, env=variables, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done
    text = trace.read_text(encoding="utf-8", errors="replace")
    return Counter(SCRIPT.findall(text))


@pytest.fixture(scope="module")
def fast(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a workspace in which no script had a process of its own."""
    root = write_files(tmp_path_factory.mktemp("fast"), FILES)
    assert not started_scripts(root)
    return root


def test_ament_scripts_run_in_the_worker_with_the_same_result(fast: Path, tree: Tree) -> None:
    slow = tree(FILES)
    assert started_scripts(slow, "--no-fast-rosidl") == {
        "package_xml_2_cmake.py": 3,
        "templates_2_cmake.py": 3,
    }
    for name in ("one", "two", "three"):
        for result in RESULTS[name == "three" :]:
            both = [(root / "build" / name / result).read_text(encoding="utf-8") for root in (fast, slow)]
            assert both[0] == both[1]


def test_embedded_ament_cmake_needs_no_launcher_for_scripts(tree: Tree) -> None:
    root = tree({path: text for path, text in FILES.items() if path.startswith("src/one/")})
    argv = (sys.executable, "-m", "forge", "build", "--python", sys.executable)
    subprocess.run(argv, cwd=root, check=True, capture_output=True)
    assert (root / "build/one/.forge/project.cmake").exists()
    assert not (root / "build/one/.forge/ament_scripts.cmake").exists()


def test_without_forge_ament_scripts_run_unchanged(fast: Path) -> None:
    package = fast / "build/one/ament_cmake_core/package.cmake"
    before = package.read_text(encoding="utf-8")
    package.unlink()
    variables = {**os.environ, **underlay()}
    subprocess.run(("cmake", fast / "build/one"), env=variables, check=True, capture_output=True)
    assert package.read_text(encoding="utf-8") == before
