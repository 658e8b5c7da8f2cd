"""What happens to the embedded ament when there is another one: it steps aside as a whole."""

import os
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text

pytestmark = [pytest.mark.needs("cmake"), pytest.mark.needs("ninja")]

LISTS = """\
cmake_minimum_required(VERSION 3.18)
project({name} NONE)
find_package(ament_cmake REQUIRED)
message(STATUS "ament=${{ament_cmake_DIR}}")
ament_package()
"""
OTHER_CONFIG = """\
set(ament_cmake_FOUND_AMENT_PACKAGE TRUE)
macro(ament_package)
  file(WRITE "${PROJECT_BINARY_DIR}/other" "")
  install(FILES "${PROJECT_BINARY_DIR}/other" DESTINATION "share/${PROJECT_NAME}")
endmacro()
"""
DEMO = {
    "src/demo/package.xml": manifest_text("demo", "<buildtool_depend>ament_cmake</buildtool_depend>"),
    "src/demo/CMakeLists.txt": LISTS.format(name="demo"),
}
OTHER = {
    "COLCON_IGNORE": "",
    "share/ament_cmake/cmake/ament_cmakeConfig.cmake": OTHER_CONFIG,
    "share/ament_cmake/package.xml": manifest_text("ament_cmake"),
    "share/ament_index/resource_index/packages/ament_cmake": "",
}


def _below(folder: str, files: Mapping[str, str]) -> dict[str, str]:
    return {f"{folder}/{path}": text for path, text in files.items()}


def test_ament_cmake_in_an_underlay_replaces_the_embedded_one(forge: Forge, built: Tree) -> None:
    """Neither CMake's cache nor what was installed leads to the embedded ament any more."""
    root = built({**DEMO, **_below("other", OTHER)})
    assert _ament_of(root).startswith(str(root / "install"))

    underlay = {name: str(root / "other") for name in ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH")}
    ran = forge("build", cwd=root, env=underlay)
    assert ran.code == 0, ran.out
    assert _ament_of(root) == str(root / "other/share/ament_cmake/cmake")
    assert list(root.glob("install/**/share/demo/other"))
    assert not list(root.glob("install/**/ament_cmakeConfig.cmake"))
    assert not (root / "build/ament_cmake").exists()


def test_ament_cmake_in_the_workspace_replaces_the_embedded_one(
    forge: Forge, tree: Tree, built: Tree
) -> None:
    """They come after a first build here, and bring the core only: the rest is missed, not mixed in."""
    root = built(DEMO)
    lists = "cmake_minimum_required(VERSION 3.18)\nproject(ament_cmake NONE)\n"
    own = {
        "package.xml": manifest_text("ament_cmake", build_type="cmake"),
        "CMakeLists.txt": f"{lists}install(DIRECTORY share DESTINATION .)\n",
        "share/ament_cmake/cmake/ament_cmakeConfig.cmake": OTHER_CONFIG,
    }
    tree(_below("src/ament_cmake", own))
    ran = forge("build", cwd=root)
    assert ran.code == 0, ran.out
    assert "embedded" not in ran.out
    assert (root / "install/demo/share/demo/other").is_file()

    manifest = manifest_text("more", "<buildtool_depend>ament_cmake_auto</buildtool_depend>")
    lists = LISTS.format(name="more").replace("find_package(ament_cmake ", "find_package(ament_cmake_auto ")
    tree({"src/more/package.xml": manifest, "src/more/CMakeLists.txt": lists})
    ran = forge("build", cwd=root)
    assert ran.code == 1
    assert "'more' needs 'ament_cmake_auto'" in ran.err


def _ament_of(root: Path) -> str:
    """Return where the package 'demo' found ament."""
    cache = (root / "build/demo/CMakeCache.txt").read_text(encoding="utf-8")
    line = next(line for line in cache.splitlines() if line.startswith("ament_cmake_DIR:"))
    return os.path.normpath(line.partition("=")[2])
