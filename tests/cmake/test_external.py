"""Packages that build a foreign project with the make that builds them."""

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text

LISTS = """\
cmake_minimum_required(VERSION 3.18)
project({name} C)
include(ExternalProject)
externalproject_add(foreign
  SOURCE_DIR "${{CMAKE_CURRENT_SOURCE_DIR}}/foreign"
  CONFIGURE_COMMAND ""
  BUILD_COMMAND $(MAKE) -f <SOURCE_DIR>/rules all
  INSTALL_COMMAND "")
install(FILES "${{CMAKE_CURRENT_BINARY_DIR}}/foreign-prefix/src/foreign-build/made" DESTINATION share/{name})
"""


@pytest.mark.newest_cmake
@pytest.mark.needs("cmake", "ninja", "make", "gcc")
def test_vendored_makefiles_build_alongside_ninja_packages(forge: Forge, tree: Tree) -> None:
    root = tree(
        {
            "src/vendor/package.xml": manifest_text("vendor", build_type="cmake"),
            "src/vendor/CMakeLists.txt": LISTS.format(name="vendor"),
            "src/vendor/foreign/rules": "all:\n\techo $(MAKELEVEL) > made\n",
            "src/plain/package.xml": manifest_text("plain", build_type="cmake"),
            "src/plain/CMakeLists.txt": "cmake_minimum_required(VERSION 3.18)\nproject(plain C)\n",
        }
    )
    ran = forge("build", cwd=root, env={"CMAKE_GENERATOR": None})
    assert ran.code == 0, ran.out
    assert (root / "install/vendor/share/vendor/made").is_file()
    assert (root / "build/plain/build.ninja").is_file()
    ran = forge("build", "--cmake-force-configure", cwd=root, env={"CMAKE_GENERATOR": None})
    assert ran.code == 0, ran.out
