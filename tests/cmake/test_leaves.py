"""Python packages, version headers, ament_cmake_auto, ament_cmake_ros and vendored projects."""

import subprocess
import sys

import pytest

from .conftest import PYTHON_VERSION, Ament

pytestmark = [pytest.mark.newest_cmake, pytest.mark.needs("cmake"), pytest.mark.needs("ninja")]
SITE = f"lib/python{PYTHON_VERSION}/site-packages"
cxx = pytest.mark.needs("g++")


def test_a_python_package_is_installed_with_metadata_and_scripts(ament: Ament) -> None:
    demo = ament(
        "find_package(ament_cmake_python REQUIRED)\n"
        "ament_python_install_package(${PROJECT_NAME} SCRIPTS_DESTINATION lib/${PROJECT_NAME})\n"
        "ament_python_install_module(extra.py DESTINATION_SUFFIX sub)\n"
        "ament_python_install_module(another.py SKIP_COMPILE)\n"
        'ament_get_python_install_dir(dir)\nmessage(STATUS "dir=${dir}")\nament_package()',
        files={
            "demo/__init__.py": "",
            "demo/main.py": "def main():\n    print('hello')\n",
            "demo/data/x.txt": "",
            "demo/__pycache__/old.pyc": "",
            "extra.py": "",
            "another.py": "",
            "setup.cfg": "[options.entry_points]\nconsole_scripts =\n    hello = demo.main:main\n",
        },
    ).install()
    files = {file for file in demo.files() if file.startswith("lib/") and "__pycache__" not in file}
    info = f"{SITE}/demo-1.2.3-py{PYTHON_VERSION}.egg-info"
    assert files == {
        *(f"{SITE}/demo/{name}" for name in ("__init__.py", "main.py", "data/x.txt")),
        *(
            f"{info}/{name}"
            for name in ("PKG-INFO", "top_level.txt", "dependency_links.txt", "entry_points.txt")
        ),
        f"{SITE}/sub/extra.py",
        f"{SITE}/another.py",
        "lib/demo/hello",
    }
    assert any("/demo/__pycache__/main." in file for file in demo.files())
    assert not any("old" in file for file in demo.files())
    assert demo.read("share/demo/environment/pythonpath.dsv") == f"prepend-non-duplicate;PYTHONPATH;{SITE}\n"
    environment = {"PYTHONPATH": str(demo.prefix / SITE)}
    hello = [sys.executable, str(demo.prefix / "lib/demo/hello")]
    assert (
        subprocess.run(hello, env=environment, capture_output=True, text=True, check=True).stdout == "hello\n"
    )


@cxx
def test_version_headers_follow_the_manifest(ament: Ament) -> None:
    demo = ament(
        "add_library(demo SHARED demo.cpp)\ninstall(TARGETS demo EXPORT set DESTINATION lib)\n"
        "ament_export_targets(set)\nament_package()\nament_generate_version_header(demo)",
        files={
            "demo.cpp": '#include "demo/version.h"\n'
            "static_assert(DEMO_VERSION_GTE(1, 2, 3) && !DEMO_VERSION_GTE(1, 2, 4), DEMO_VERSION_STR);\n"
        },
    ).install()
    assert "#define DEMO_VERSION_MINOR (2)" in demo.read("include/demo/demo/version.h")
    user = ament(
        "find_package(demo REQUIRED)\nadd_library(user STATIC user.cpp)\n"
        "target_link_libraries(user demo::demo)",
        name="user",
        files={"user.cpp": "#include <demo/version.h>\n"},
    )
    user.install()


def test_a_higher_development_version_overrides_the_manifest(ament: Ament) -> None:
    ament("ament_export_development_version_if_higher_than_manifest(1.3.0)\nament_package()").install()
    user = ament('find_package(demo 1.3 REQUIRED)\nmessage(STATUS "version=${demo_VERSION}")', name="user")
    assert user.configure().said("version") == "1.3.0"


@cxx
def test_ament_cmake_auto_reads_the_manifest(ament: Ament) -> None:
    depend = (
        "<buildtool_depend>ament_cmake_auto</buildtool_depend><depend>{}</depend><depend>lib-dev</depend>"
    )
    auto = "find_package(ament_cmake_auto REQUIRED)\nament_auto_find_build_dependencies()\n"
    base = ament(
        f"{auto}ament_auto_add_library(base_lib SHARED DIRECTORY src)\n"
        "ament_auto_package(INSTALL_TO_SHARE launch)",
        name="base",
        manifest=depend.format("std_nothing"),
        files={
            "src/deep/base.cpp": '#include "base/base.hpp"\nint base() { return 1; }\n',
            "include/base/base.hpp": "int base();\n",
            "launch/x.py": "",
        },
    ).install()
    assert {"lib/libbase_lib.so", "include/base/base.hpp", "share/base/launch/x.py"} <= base.files()
    top = ament(
        f"{auto}ament_auto_add_executable(top main.cpp)\n"
        'message(STATUS "found=${top_FOUND_BUILD_DEPENDS}/${top_FOUND_BUILDTOOL_DEPENDS}")\n'
        "ament_auto_package()",
        name="top",
        manifest=depend.format("base"),
        files={"main.cpp": '#include "base/base.hpp"\nint main() { return base() - 1; }\n'},
    )
    assert top.configure().said("found") == "base/ament_cmake_auto"
    assert "lib/top/top" in top.install().files()
    assert '"base"' in top.read("share/top/cmake/topConfig.cmake")


def test_ament_cmake_auto_rejects_undeclared_requirements(ament: Ament) -> None:
    demo = ament(
        "find_package(ament_cmake_auto REQUIRED)\nament_auto_find_build_dependencies(REQUIRED other)"
    )
    assert "requires 'other', which package.xml does not name" in demo.try_to_configure().flat


@cxx
def test_ament_cmake_ros_builds_shared_libraries_by_default(ament: Ament) -> None:
    demo = ament(
        "add_library(above x.cpp)\nfind_package(ament_cmake_ros REQUIRED)\nadd_library(below x.cpp)\n"
        "foreach(t above below)\nget_target_property(type ${t} TYPE)\n"
        'message(STATUS "${t}=${type}")\nendforeach()\n'
        "ament_add_ros_isolated_pytest_test(one test_one.py)\n",
        files={
            "x.cpp": "const char * n = ROS_PACKAGE_NAME;\n",
            "test_one.py": "import os\n\ndef test_it():\n    assert os.environ['ROS_DOMAIN_ID']\n",
        },
    )
    outcome = demo.configure()
    assert (outcome.said("above"), outcome.said("below")) == ("STATIC_LIBRARY", "SHARED_LIBRARY")
    ran = demo.test()
    assert ran.code == 0, ran.text


def test_a_vendored_project_is_found_by_users_of_the_package(ament: Ament) -> None:
    demo = ament(
        "find_package(ament_cmake_vendor_package REQUIRED)\n"
        'ament_vendor(thing VCS_TYPE path VCS_URL "${CMAKE_CURRENT_SOURCE_DIR}/thing")\n'
        "ament_vendor(other VCS_URL none SATISFIED TRUE)\nament_export_dependencies(thing)\nament_package()",
        files={
            "thing/CMakeLists.txt": "cmake_minimum_required(VERSION 3.12)\nproject(thing NONE)\n"
            "install(FILES thing-config.cmake DESTINATION lib/cmake/thing)\n",
            "thing/thing-config.cmake": "message(STATUS thing=found)\n",
        },
    ).install()
    assert "opt/demo/lib/cmake/thing/thing-config.cmake" in demo.files()
    assert ament("find_package(demo REQUIRED)", name="user").configure().said("thing") == "found"
