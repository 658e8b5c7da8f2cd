"""ament_package(): what it installs, what it refuses, and how others find the result."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from .conftest import BUILD_TOOLS, EMBEDDED, Ament

pytestmark = [pytest.mark.newest_cmake, pytest.mark.needs("cmake"), pytest.mark.needs("ninja")]

PLAIN = "cmake_minimum_required(VERSION 3.12)\nproject(consumer NONE)\n"


def test_a_package_installs_manifest_config_environment_and_markers(ament: Ament) -> None:
    demo = ament("ament_package()").install()
    share = "share/demo"
    index = "share/ament_index/resource_index"
    assert demo.files() == {
        f"{share}/package.xml",
        f"{share}/package.dsv",
        *(f"{share}/local_setup.{shell}" for shell in ("bash", "sh", "zsh", "dsv")),
        *(
            f"{share}/environment/{hook}.{kind}"
            for hook in ("ament_prefix_path", "path")
            for kind in ("sh", "dsv")
        ),
        f"{share}/cmake/demoConfig.cmake",
        f"{share}/cmake/demoConfig-version.cmake",
        f"{index}/packages/demo",
        f"{index}/package_run_dependencies/demo",
        f"{index}/parent_prefix_path/demo",
    }
    assert demo.read(f"{index}/packages/demo") == ""


def test_run_dependencies_are_recorded_sorted_and_unique(ament: Ament) -> None:
    lines = "<depend>b</depend><exec_depend>a</exec_depend><test_depend>c</test_depend><depend>b</depend>"
    demo = ament("ament_package()", manifest=lines).install()
    assert demo.read("share/ament_index/resource_index/package_run_dependencies/demo") == "a;b;c"


def test_the_manifest_must_belong_to_the_project(ament: Ament) -> None:
    demo = ament("ament_package()")
    xml = demo.source / "package.xml"
    xml.write_text(xml.read_text(encoding="utf-8").replace("<name>demo", "<name>other"), encoding="utf-8")
    assert "names the package 'other', but project() says 'demo'" in demo.try_to_configure().flat


def test_statements_may_follow_ament_package(ament: Ament) -> None:
    demo = ament(
        "ament_package()\n"
        "ament_index_register_resource(kind CONTENT late)\n"
        "install(FILES package.xml DESTINATION share/demo/late)\n"
        "add_custom_target(late ALL)"
    ).install()
    assert demo.read("share/ament_index/resource_index/kind/demo") == "late"
    assert "share/demo/late/package.xml" in demo.files()


def test_manifest_conditions_are_evaluated_for_ros_2(ament: Ament) -> None:
    demo = ament(
        "ament_package_xml()\n"
        "foreach(name VERSION MAINTAINER BUILD_DEPENDS BUILD_EXPORT_DEPENDS EXEC_DEPENDS MEMBER_OF_GROUPS)\n"
        'message(STATUS "${name}=${demo_${name}}")\nendforeach()\n'
        'message(STATUS "at_least=${demo_BUILD_DEPENDS_one_VERSION_GTE}")',
        manifest="""
        <depend version_gte="1.5">one</depend>
        <build_depend condition="$ROS_VERSION == 1">old</build_depend>
        <exec_depend condition="$ROS_DISTRO == humble and ($ROS_PYTHON_VERSION == 3)">new</exec_depend>
        <member_of_group>group</member_of_group>""",
    )
    outcome = demo.configure()
    assert outcome.said("VERSION") == "1.2.3"
    assert outcome.said("MAINTAINER") == "Somebody <somebody@example.com>"
    assert outcome.said("BUILD_DEPENDS") == "one"
    assert outcome.said("BUILD_EXPORT_DEPENDS") == "one"
    assert outcome.said("EXEC_DEPENDS") == "one;new"
    assert outcome.said("MEMBER_OF_GROUPS") == "group"
    assert outcome.said("at_least") == "1.5"


def test_a_malformed_condition_is_reported(ament: Ament) -> None:
    demo = ament("ament_package()", manifest='<depend condition="$A = 1">one</depend>')
    assert "the condition '$A = 1' of <depend> is malformed" in demo.try_to_configure().flat


def test_preparsed_manifests_are_used_while_up_to_date(ament: Ament) -> None:
    demo = ament('ament_package_xml()\nmessage(STATUS "version=${demo_VERSION}")')
    handed_over = demo.source / "manifest.cmake"
    handed_over.write_text(
        "# the package.xml of 'demo'\nset(_AMENT_PACKAGE_NAME demo)\nset(demo_VERSION 9.9.9)\n",
        encoding="utf-8",
    )
    argument = f"-DFORGE_MANIFEST={handed_over}"
    assert demo.configure(argument).said("version") == "9.9.9"
    (demo.source / "package.xml").touch()
    assert demo.configure(argument).said("version") == "1.2.3"


def test_extras_run_in_order_with_the_callers_variables(ament: Ament) -> None:
    demo = ament(
        'set(greeting "hello; there")\nset(demo_CONFIG_EXTRAS "${CMAKE_CURRENT_SOURCE_DIR}/second.cmake")\n'
        "set(demo_CONFIG_EXTRAS_POST third.cmake)\n"
        "ament_package(CONFIG_EXTRAS first.cmake.in CONFIG_EXTRAS_POST fourth.cmake)",
        files={
            "first.cmake.in": 'message(STATUS "first=@greeting@ ${demo_VERSION}")\nset(trace 1)\n',
            "second.cmake": "list(APPEND trace 2)\n",
            "third.cmake": "list(APPEND trace 3)\n",
            "fourth.cmake": 'list(APPEND trace 4)\nmessage(STATUS "trace=${trace}")\n',
        },
    ).install()
    user = ament("find_package(demo REQUIRED)", name="user")
    outcome = user.configure()
    assert outcome.said("first") == "hello; there 1.2.3"
    assert outcome.said("trace") == "1;2;3;4"
    assert "share/demo/cmake/first.cmake" in demo.files()


def test_extensions_can_add_extras_and_environment_hooks(ament: Ament) -> None:
    ament(
        "ament_package(CONFIG_EXTRAS helper.cmake)\ninstall(FILES hook.cmake DESTINATION share/helper/cmake)",
        name="helper",
        files={
            "helper.cmake": "ament_register_extension(ament_package helper hook.cmake)\n"
            "ament_register_extension(ament_package helper hook.cmake)\n",
            "hook.cmake": 'file(WRITE "${CMAKE_CURRENT_BINARY_DIR}/more.cmake" "message(STATUS more=1)\\n")\n'
            'list(APPEND ${PROJECT_NAME}_CONFIG_EXTRAS "${CMAKE_CURRENT_BINARY_DIR}/more.cmake")\n'
            'ament_environment_hooks("${ament_cmake_package_templates_ENVIRONMENT_HOOK_LIBRARY_PATH}")\n',
        },
    ).install()
    demo = ament("find_package(helper REQUIRED)\nament_package()").install()
    assert "share/demo/environment/library_path.dsv" in demo.files()
    assert ament("find_package(demo REQUIRED)", name="user").configure().said("more") == "1"


def test_config_files_need_only_cmake_and_are_relocatable(ament: Ament, tmp_path: Path) -> None:
    ament("ament_export_include_directories(include/base)\nament_package()", name="base").install()
    demo = ament(
        "find_package(base REQUIRED)\nament_export_dependencies(base ament_cmake rosidl_default_runtime)\n"
        "ament_export_include_directories(include)\nament_export_definitions(ONE=1)\nament_package()"
    ).install()
    moved = tmp_path / "elsewhere with blanks"
    shutil.move(demo.prefix.parent, moved)
    plain = ament("", name="consumer")
    (plain.source / "CMakeLists.txt").write_text(
        PLAIN + "find_package(demo 1.2 REQUIRED)\nfind_package(demo REQUIRED)\n"
        "foreach(name INCLUDE_DIRS DEFINITIONS DEPENDENCIES RECURSIVE_DEPENDENCIES FOUND_AMENT_PACKAGE)\n"
        'message(STATUS "${name}=${demo_${name}}")\nendforeach()\n',
        encoding="utf-8",
    )
    outcome = replace(plain, prefixes=(moved / "demo", moved / "base")).configure()
    assert outcome.said("INCLUDE_DIRS") == f"{moved}/demo/include;{moved}/base/include/base"
    assert outcome.said("DEFINITIONS") == "ONE=1"
    assert outcome.said("DEPENDENCIES") == "base"
    assert outcome.said("FOUND_AMENT_PACKAGE") == "TRUE"
    assert outcome.text.count("Found demo: 1.2.3") == 1


def test_older_versions_are_compatible_and_newer_ones_are_not(ament: Ament) -> None:
    ament("ament_package()").install()
    user = ament(
        "foreach(version 2 1.3 0.9 1.2.3)\nfind_package(demo ${version} QUIET)\n"
        'message(STATUS "${version}=${demo_FOUND}")\nendforeach()',
        name="user",
    ).configure()
    assert [user.said(version) in ("1", "TRUE") for version in ("0.9", "1.2.3", "1.3", "2")] == [
        *(True, True),
        *(False, False),
    ]


def test_using_a_deprecated_package_gives_a_warning(ament: Ament) -> None:
    demo = ament("ament_package()")
    xml = demo.source / "package.xml"
    text = xml.read_text(encoding="utf-8").replace("<export>", "<export><deprecated>use 'x'</deprecated>")
    xml.write_text(text, encoding="utf-8")
    demo.install()
    assert (
        "the package 'demo' is deprecated: use 'x'"
        in ament("find_package(demo)", name="user").configure().flat
    )
    quiet = ament("set(demo_DEPRECATED_QUIET TRUE)\nfind_package(demo)", name="quiet")
    assert "is deprecated" not in quiet.configure().flat


def test_uninstall_leaves_an_empty_prefix(ament: Ament) -> None:
    demo = ament("ament_package()").install()
    demo.make("--target", "uninstall")
    assert list(demo.prefix.iterdir()) == []


def test_all_packages_provided_by_the_build_tools_are_found(ament: Ament) -> None:
    """One project for all names, with a version that ROS packages ask for."""
    texts = [(EMBEDDED / name / "package.xml").read_text(encoding="utf-8") for name in BUILD_TOOLS]
    names = [name for text in texts for name in re.findall("<forge_provides>(.*)</forge_provides>", text)]
    tools = re.compile(
        "ament_lint$|ament_lint_cmake$|ament_(?!cmake|lint|package)|.*_(?:introspection|fastrtps)_"
    )  # programs, and type supports without code: no CMake packages
    asked = [name for name in (*BUILD_TOOLS, *names) if not tools.match(name)]
    loop = f"foreach(name {' '.join(asked)})\nfind_package(${{name}} 0.10 REQUIRED)\n"
    check = 'if(NOT ${name}_FOUND_AMENT_PACKAGE)\nmessage(FATAL_ERROR "${name}")\nendif()\nendforeach()\n'
    use = "add_library(x INTERFACE)\n"
    use += "ament_target_dependencies(x INTERFACE rosidl_runtime_cpp rosidl_typesupport_cpp)"
    ament(f"{loop}{check}{use}").configure()
