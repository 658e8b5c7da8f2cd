"""What forge tells CMake is no reason for CMake to warn."""

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text

pytestmark = [pytest.mark.needs("cmake"), pytest.mark.needs("ninja")]

AMENT = "<buildtool_depend>ament_cmake</buildtool_depend>"
BEGIN = "cmake_minimum_required(VERSION 3.5...3.25)\nproject({name} NONE)\n"
PACKAGES = {
    "plain": ("cmake", ""),
    "with_ament": ("ament_cmake", "find_package(ament_cmake REQUIRED)\nament_package()\n"),
    "without_ament": ("ament_cmake", "install(FILES package.xml DESTINATION share/without_ament)\n"),
    "leaves_early": ("ament_cmake", "find_package(ament_cmake_core REQUIRED)\nreturn()\n"),
}


@pytest.mark.parametrize(
    "words",
    [
        pytest.param((), marks=pytest.mark.newest_cmake),
        ("--symlink-install", "--merge-install", "--test-result-base", "results"),
    ],
)
def test_unused_forge_variables_give_no_cmake_warnings(
    words: tuple[str, ...], forge: Forge, tree: Tree
) -> None:
    files = {}
    for name, (build_type, commands) in PACKAGES.items():
        files[f"src/{name}/package.xml"] = manifest_text(name, AMENT, build_type=build_type)
        files[f"src/{name}/CMakeLists.txt"] = BEGIN.format(name=name) + commands
    root = tree(files)
    for again in ((), ("--cmake-force-configure",)):
        assert forge("build", *words, *again, cwd=root).code == 0
        for log in root.glob("log/latest_build/*/stdout_stderr.log"):
            assert "Warning" not in log.read_text(encoding="utf-8"), log.read_text(encoding="utf-8")
