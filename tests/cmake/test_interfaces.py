"""rosidl_generate_interfaces(): what it generates, installs, exports and refuses, and when it runs again."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

from .conftest import PYTHON_VERSION, Ament, Project, projects_in

pytestmark = [pytest.mark.needs("cmake"), pytest.mark.needs("ninja")]
cxx = pytest.mark.needs("g++")
SITE = f"lib/python{PYTHON_VERSION}/site-packages"

MEMBER = "<member_of_group>rosidl_interface_packages</member_of_group>"
GENERATORS = "find_package(rosidl_default_generators REQUIRED)\n"
DEFINITIONS = {
    "msg/HTTPStatus.msg": "uint8 OK=1\nstd_msgs/Header header\nuint8 code\n",
    "srv/Move.srv": "# how far\nfloat32 distance\n---\nfloat32 pose\n",
    "action/Walk.action": "float32 distance\n---\nfloat32 pose\n---\nfloat32 rest\n",
}
DEFINITIONS_INSTALLED = (
    *(f"share/motion/{path}" for path in DEFINITIONS),
    *(f"share/motion/{path.rsplit('.', 1)[0]}.{kind}" for path in DEFINITIONS for kind in ("idl", "json")),
)
MAIN = """\
#include "motion/action/walk.hpp"
#include "motion/msg/http_status.hpp"
#include "motion/srv/move.hpp"
int main() {
  motion::msg::HTTPStatus status;
  motion::srv::Move::Request request;
  motion::action::Walk::Goal goal;
  return status.code + static_cast<int>(request.distance + goal.distance);
}
"""
STATUS = "#include <motion/msg/http_status.hpp>\nint main() { return motion::msg::HTTPStatus().code; }\n"


@pytest.fixture
def rosidl(tmp_path: Path, embedded: Path, interfaces: Path) -> Ament:
    """Make projects that also see the standard interfaces."""
    return projects_in(tmp_path, embedded, interfaces)


@pytest.fixture(scope="module")
def motion(tmp_path_factory: pytest.TempPathFactory, embedded: Path, interfaces: Path) -> Project:
    """Install a package with a message, a service and an action; nobody declares action_msgs."""
    return projects_in(tmp_path_factory.mktemp("motion"), embedded, interfaces)(
        f"{GENERATORS}find_package(std_msgs REQUIRED)\n"
        "rosidl_generate_interfaces(${PROJECT_NAME}\n  msg/HTTPStatus.msg srv/Move.srv action/Walk.action\n"
        "  DEPENDENCIES std_msgs ADD_LINTER_TESTS)\nament_package()",
        name="motion",
        manifest=MEMBER,
        files=DEFINITIONS,
    ).install()


@pytest.fixture
def user(tmp_path: Path, embedded: Path, interfaces: Path, motion: Project) -> Ament:
    """Make projects that see that package."""
    return projects_in(tmp_path, embedded, interfaces, motion.prefix)


def test_interfaces_are_installed_in_the_ros_layout(motion: Project) -> None:
    files = motion.files()
    assert {file for file in files if file.startswith("include/")} == {
        "include/motion/motion/msg/rosidl_generator_c__visibility_control.h",
        "include/motion/motion/msg/rosidl_generator_cpp__visibility_control.hpp",
        *(
            f"include/motion/motion/{path}"
            for kind, name in (("msg", "http_status"), ("srv", "move"), ("action", "walk"))
            for path in (
                f"{kind}/{name}.h",
                f"{kind}/{name}.hpp",
                *(f"{kind}/detail/{name}__{part}.h" for part in ("struct", "functions", "type_support")),
                *(
                    f"{kind}/detail/{name}__{part}.hpp"
                    for part in ("struct", "builder", "traits", "type_support", "cdr")
                ),
            )
        ),
    }
    assert {
        *DEFINITIONS_INSTALLED,
        f"{SITE}/motion/__init__.py",
        f"{SITE}/motion/msg/_http_status.py",
        f"{SITE}/motion-1.2.3-py{PYTHON_VERSION}.egg-info/PKG-INFO",
        "share/motion/environment/pythonpath.dsv",
    } <= files
    assert motion.read("share/motion/srv/Move_Request.msg") == "# how far\nfloat32 distance\n"
    assert motion.read("share/motion/srv/Move_Response.msg") == "float32 pose\n"
    assert motion.read("share/ament_index/resource_index/rosidl_interfaces/motion") == "\n".join(
        [
            *("action/Walk.action", "action/Walk.idl", "msg/HTTPStatus.idl", "msg/HTTPStatus.msg"),
            *("srv/Move.idl", "srv/Move.srv", "srv/Move_Request.msg", "srv/Move_Response.msg"),
        ]
    )
    assert not any(file.endswith(".pyc") for file in files)


@cxx
def test_users_can_link_any_documented_target(user: Ament) -> None:
    project = user(
        "find_package(motion REQUIRED)\n"
        "add_executable(by_ament main.cpp)\nament_target_dependencies(by_ament motion)\n"
        "add_executable(by_target status.cpp)\n"
        "target_link_libraries(by_target motion::motion__rosidl_typesupport_cpp)\n"
        "add_executable(by_name status.cpp)\ntarget_link_libraries(by_name motion::motion)\n"
        "add_executable(by_list status.cpp)\ntarget_link_libraries(by_list ${motion_TARGETS})\n"
        "add_executable(classic status.cpp)\n"
        "target_include_directories(classic PRIVATE ${motion_INCLUDE_DIRS})\n"
        'message(STATUS "recursive=${motion_RECURSIVE_DEPENDENCIES}")\n'
        'message(STATUS "idl=${motion_IDL_FILES}")\nmessage(STATUS "interfaces=${motion_INTERFACE_FILES}")\n'
        'message(STATUS "kind=${motion_TARGETS__rosidl_generator_cpp}")',
        name="user",
        files={"main.cpp": MAIN, "status.cpp": STATUS},
    )
    outcome = project.configure("-DCMAKE_CXX_FLAGS=-Wall -Wextra -Wpedantic -Werror")
    assert {"std_msgs", "builtin_interfaces", "action_msgs"} <= set(outcome.said("recursive").split(";"))
    assert outcome.said("idl") == "msg/HTTPStatus.idl;srv/Move.idl;action/Walk.idl"
    assert outcome.said("interfaces") == "msg/HTTPStatus.msg;srv/Move.srv;action/Walk.action"
    assert outcome.said("kind") == "motion::motion__rosidl_generator_cpp"
    project.make()


@cxx
def test_the_aggregate_target_is_available_in_the_defining_project(rosidl: Ament) -> None:
    demo = rosidl(
        f"{GENERATORS}rosidl_generate_interfaces(demo msg/One.msg)\n"
        "add_executable(one one.cpp)\ntarget_link_libraries(one demo::demo)\n"
        "add_executable(two one.cpp)\ntarget_link_libraries(two demo::demo__rosidl_generator_cpp)\n"
        "ament_package()",
        manifest=MEMBER,
        files={
            "msg/One.msg": "uint8 a\n",
            "one.cpp": "#include <demo/msg/one.hpp>\nint main() { return demo::msg::One().a; }\n",
        },
    )
    demo.install()


@cxx
def test_a_library_may_have_the_name_of_a_project_with_interfaces(rosidl: Ament) -> None:
    demo = rosidl(
        f"{GENERATORS}rosidl_generate_interfaces(demo_interfaces msg/One.msg)\n"
        "add_library(demo one.cpp)\ninstall(TARGETS demo EXPORT export_demo)\n"
        "ament_export_targets(export_demo)\nament_package()",
        manifest=MEMBER,
        files={"msg/One.msg": "uint8 a\n", "one.cpp": "int one() { return 1; }\n"},
    )
    demo.install()
    user = rosidl(
        "find_package(demo REQUIRED)\nadd_executable(main main.cpp)\ntarget_link_libraries(main demo::demo)",
        name="user",
        files={"main.cpp": "int one();\nint main() { return one() - 1; }\n"},
    )
    user.configure()
    user.make()


@pytest.mark.needs("gcc")
def test_c_programs_can_link_the_c_targets(user: Ament) -> None:
    """In the project that defines the interfaces, and in one that uses them; no C++ is needed."""
    project = user(
        "enable_language(C)\nset(CMAKE_C_STANDARD 99)\nset(CMAKE_C_EXTENSIONS OFF)\n"
        f"{GENERATORS}find_package(motion REQUIRED)\n"
        "rosidl_generate_interfaces(more msg/Path.msg DEPENDENCIES motion)\n"
        "rosidl_get_typesupport_target(own more rosidl_typesupport_c)\n"
        "add_executable(inside main.c)\ntarget_link_libraries(inside ${own})\n"
        "add_executable(by_target other.c)\n"
        "target_link_libraries(by_target motion::motion__rosidl_generator_c)\n"
        "add_executable(by_ament other.c)\nament_target_dependencies(by_ament motion)\nament_package()",
        name="user",
        manifest=MEMBER,
        files={
            "msg/Path.msg": "motion/HTTPStatus[] statuses\n",
            "main.c": '#include "user/msg/path.h"\n'
            "int main(void) { user__msg__Path path; return !user__msg__Path__init(&path); }\n",
            "other.c": '#include "motion/action/walk.h"\n'
            "typedef motion__action__Walk_Goal Goal;\n"
            "int main(void) { Goal goal; return !motion__action__Walk_Goal__init(&goal); }\n",
        },
    )
    project.configure("-DCMAKE_C_FLAGS=-Wall -Wextra -Wpedantic -Werror")
    project.make("-j2")
    for program in ("inside", "by_target", "by_ament"):
        assert subprocess.run([project.build / program], check=False).returncode == 0


def test_installed_interfaces_can_be_imported_in_python(motion: Project) -> None:
    paths = os.pathsep.join(str(prefix / SITE) for prefix in (motion.prefix, *motion.prefixes))
    code = (
        "from motion.msg import HTTPStatus; from motion.action import Walk; print(HTTPStatus.OK, Walk.Goal())"
    )
    done = subprocess.run(
        [sys.executable, "-B", "-c", code],
        env={"PYTHONPATH": paths},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout == "1 motion.action.Walk_Goal(distance=0.0)\n", done.stderr


def test_third_party_generators_get_idl_definitions(rosidl: Ament) -> None:
    """While CMake configures, and again when a definition changes; types of other packages are known."""
    demo = rosidl(
        f"{GENERATORS}find_package(std_msgs REQUIRED)\n"
        "rosidl_write_generator_arguments(${CMAKE_CURRENT_BINARY_DIR}/a.json PACKAGE_NAME demo\n"
        "  NON_IDL_TUPLES ${CMAKE_CURRENT_SOURCE_DIR}:msg/One.msg ${CMAKE_CURRENT_SOURCE_DIR}:srv/Two.srv)\n"
        "rosidl_adapt_interfaces(tuples ${CMAKE_CURRENT_BINARY_DIR}/a.json TARGET other)\n"
        'message(STATUS "tuples=${tuples}")\nament_package()',
        files={"msg/One.msg": "std_msgs/Header head\n", "srv/Two.srv": "uint8 x\n---\n"},
    )
    outcome = demo.configure()
    tuples = outcome.said("tuples").split(";")
    assert [each.rpartition(":")[2] for each in tuples] == ["msg/One.idl", "srv/Two.idl"]
    written = Path(tuples[0].replace(":", "/"))
    assert "std_msgs::msg::Header head" in written.read_text(encoding="utf-8")
    (demo.source / "msg/One.msg").write_text("int8 fresh\n", encoding="utf-8")
    demo.make()
    assert "int8 fresh" in written.read_text(encoding="utf-8")


@cxx
def test_generated_headers_use_the_ros_include_layout(rosidl: Ament) -> None:
    """Some name the folder instead of linking a target; a change is seen in the same build."""
    demo = rosidl(
        f"{GENERATORS}rosidl_generate_interfaces(demo msg/One.msg)\n"
        "rosidl_generate_interfaces(more msg/Two.msg SKIP_INSTALL)\n"
        "add_executable(one one.cpp)\nadd_dependencies(one demo)\n"
        "target_include_directories(one PRIVATE ${CMAKE_CURRENT_BINARY_DIR}/rosidl_generator_cpp)\n"
        "target_link_libraries(one rosidl_runtime_cpp::rosidl_runtime_cpp)\n"
        "ament_package()",
        manifest=MEMBER,
        files={
            "msg/One.msg": "uint8 a\n",
            "msg/Two.msg": "uint8 b\n",
            "one.cpp": "#include <demo/msg/one.hpp>\nint main() { return demo::msg::One().a; }\n",
        },
    )
    demo.install()
    assert (demo.build / "rosidl_generator_c/demo/msg/one.h").is_file()
    assert (demo.build / "rosidl_generator_py/demo/msg/__init__.py").is_file()
    assert not (demo.build / "rosidl_generator_cpp/demo/msg/two.hpp").exists()
    assert "include/demo/demo/msg/one.hpp" in demo.files()

    (demo.source / "msg/One.msg").write_text("uint8 a\nuint8 c\n", encoding="utf-8")
    assert "one.cpp" in demo.make().text


@cxx
@pytest.mark.parametrize(
    "generator", ["Ninja", pytest.param("Unix Makefiles", marks=pytest.mark.needs("make"))]
)
def test_programs_of_the_same_project_depend_on_generated_code(rosidl: Ament, generator: str) -> None:
    demo = rosidl(
        f"{GENERATORS}rosidl_generate_interfaces(demo_interfaces msg/One.msg msg/Two.msg)\n"
        "rosidl_get_typesupport_target(typesupport demo_interfaces rosidl_typesupport_cpp)\n"
        "rosidl_get_typesupport_target(none demo_interfaces rosidl_typesupport_lisp)\n"
        'message(STATUS "typesupport=${typesupport}")\nmessage(STATUS "none=${none}")\n'
        "add_executable(one one.cpp)\ntarget_link_libraries(one ${typesupport})\n"
        "add_executable(two two.cpp)\nrosidl_target_interfaces(two demo_interfaces rosidl_typesupport_cpp)\n"
        "ament_package()",
        manifest=MEMBER,
        files={
            "msg/One.msg": "uint8 a\n",
            "msg/Two.msg": "uint8 b\n",
            "one.cpp": "#include <demo/msg/one.hpp>\nint main() { return demo::msg::One().a; }\n",
            "two.cpp": "#include <demo/msg/two.hpp>\nint main() { return demo::msg::Two().b; }\n",
        },
    )
    outcome = demo.configure("-G", generator)
    assert outcome.said("typesupport") == "demo_interfaces__rosidl_typesupport_cpp"
    assert outcome.said("none").endswith("-NOTFOUND")
    demo.make("-j2")
    quiet = demo.make().text
    assert "Generating the interfaces" not in quiet

    (demo.source / "msg/Two.msg").write_text("uint8 b\nuint8 c\n", encoding="utf-8")
    again = demo.make().text
    assert "Generating the interfaces" in again
    assert "two.cpp" in again
    assert "one.cpp" not in again
    assert "Building" not in demo.make().text


def test_a_changed_definition_of_a_dependency_regenerates_code(rosidl: Ament) -> None:
    base = rosidl(
        f"{GENERATORS}rosidl_generate_interfaces(base msg/X.msg)\nament_package()",
        name="base",
        manifest=MEMBER,
        files={"msg/X.msg": "uint8 a\n"},
    ).install()
    demo = rosidl(
        f"{GENERATORS}find_package(base REQUIRED)\n"
        "rosidl_generate_interfaces(demo msg/Y.msg DEPENDENCIES base)\nament_package()",
        manifest=MEMBER,
        files={"msg/Y.msg": "base/X x\n"},
    ).install()
    assert "Generating" not in demo.make().text
    changed = base.source / "msg/X.msg"
    changed.write_text("uint8 a\nuint8 b\n", encoding="utf-8")
    later = changed.stat().st_mtime + 2  # installed files are dated to the second
    os.utime(changed, (later, later))
    base.install()
    assert "Generating" in demo.make().text


def test_absolute_paths_and_other_target_names_work(rosidl: Ament) -> None:
    demo = rosidl(
        "add_subdirectory(test)\n",
        manifest=MEMBER,
        files={
            "msg/One.msg": "uint8 a\n",
            "far/msg/Two.msg": "uint8 b\n",
            "test/CMakeLists.txt": f"{GENERATORS}rosidl_generate_interfaces(test_interfaces ../msg/One.msg\n"
            '"${PROJECT_SOURCE_DIR}/far:msg/Two.msg" SKIP_INSTALL LIBRARY_NAME other)\n'
            "foreach(name TARGET IDL_TUPLES ABS_IDL_FILES SKIP_INSTALL LIBRARY_NAME)\n"
            'message(STATUS "${name}=${rosidl_generate_interfaces_${name}}")\nendforeach()\n'
            'message(STATUS "python=${PYTHON_INSTALL_DIR}")\n',
        },
    )
    outcome = demo.configure()
    output = f"{demo.build}/test/rosidl/test_interfaces"
    assert outcome.said("TARGET") == "test_interfaces"
    assert outcome.said("IDL_TUPLES") == f"{output}/idl/demo:msg/One.idl;{output}/idl/demo:msg/Two.idl"
    assert outcome.said("ABS_IDL_FILES") == f"{output}/idl/demo/msg/One.idl;{output}/idl/demo/msg/Two.idl"
    assert outcome.said("LIBRARY_NAME") == "other"
    assert outcome.said("python") == SITE
    demo.install()
    assert demo.files() == set()
    assert (demo.build / "test/rosidl/test_interfaces/idl/demo/msg/Two.idl").is_file()


def test_third_party_generators_and_type_supports_run(rosidl: Ament) -> None:
    rosidl(
        "install(FILES generate.cmake DESTINATION share/other/cmake)\n"
        "ament_package(CONFIG_EXTRAS register.cmake)",
        name="other",
        files={
            "register.cmake": (
                "ament_register_extension(rosidl_generate_idl_interfaces other generate.cmake)\n"
            ),
            "generate.cmake": "set(name ${rosidl_generate_interfaces_TARGET}__other)\n"
            "add_library(${name} INTERFACE)\ninstall(TARGETS ${name} EXPORT other_set)\n"
            "ament_export_targets(other_set)\nrosidl_export_typesupport_targets(other ${name})\n"
            'rosidl_write_generator_arguments("${CMAKE_BINARY_DIR}/args.json" PACKAGE_NAME ${PROJECT_NAME}\n'
            "  IDL_TUPLES ${rosidl_generate_interfaces_IDL_TUPLES} OUTPUT_DIR out)\n",
        },
    ).install()
    demo = rosidl(
        f"find_package(other REQUIRED)\n{GENERATORS}"
        "rosidl_generate_interfaces(demo msg/X.msg)\nament_package()",
        manifest=MEMBER,
        files={"msg/X.msg": ""},
    ).install()
    user = rosidl('find_package(demo REQUIRED)\nmessage(STATUS "other=${demo_TARGETS__other}")', name="user")
    assert user.configure().said("other") == "demo::demo__other"
    arguments = (demo.build / "args.json").read_text(encoding="utf-8")
    assert '"idl_tuples": [\n    "' in arguments
    assert '"output_dir": "out"' in arguments


@pytest.mark.parametrize(
    ("commands", "manifest", "complaint"),
    [
        ("rosidl_generate_interfaces(demo)", MEMBER, "was given no files for 'demo'"),
        ("rosidl_generate_interfaces(demo msg/None.msg)", MEMBER, "msg/None.msg', which does not exist"),
        (
            "rosidl_generate_interfaces(demo ${CMAKE_CURRENT_SOURCE_DIR}/msg/X.msg)",
            MEMBER,
            "takes an absolute path as BASE:NAMESPACE/NAME",
        ),
        ("rosidl_generate_interfaces(demo package.xml)", MEMBER, "is not a .msg, .srv, .action or .idl file"),
        (
            "rosidl_generate_interfaces(demo msg/X.msg DEPENDENCIES nowhere)",
            MEMBER,
            "depends on 'nowhere', which was not found",
        ),
        ("rosidl_generate_interfaces(demo msg/X.msg)", "", "<member_of_group>rosidl_interface_packages"),
        (
            "add_library(demo INTERFACE)\nrosidl_generate_interfaces(demo msg/X.msg)",
            MEMBER,
            "give the library or program another name",
        ),
        ("ament_package()\nrosidl_generate_interfaces(demo msg/X.msg)", MEMBER, "must be called before"),
        ("rosidl_get_typesupport_target(x none y)", MEMBER, "'none', which is not a target"),
        ("rosidl_adapt_interfaces(x y)", MEMBER, "takes a variable, a file and TARGET"),
        ("rosidl_target_interfaces(a b c)", MEMBER, "needs 'a', which is not a target"),
        ("rosidl_generate_interfaces(demo action/A.action)", MEMBER, "<depend>action_msgs</depend>"),
    ],
)
def test_invalid_calls_are_errors_with_a_reason(
    ament: Ament, commands: str, manifest: str, complaint: str
) -> None:
    files = {"msg/X.msg": "", "action/A.action": "---\n---\n"}
    outcome = ament(f"{GENERATORS}{commands}", manifest=manifest, files=files).try_to_configure()
    assert outcome.code != 0
    assert complaint in outcome.flat


def test_finding_the_generators_package_also_provides_ament_cmake(rosidl: Ament) -> None:
    demo = rosidl("", manifest=MEMBER, files={"msg/X.msg": "uint8 a\n"})
    (demo.source / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.5...3.25)\nproject(demo NONE)\n"
        f"{GENERATORS}rosidl_generate_interfaces(demo msg/X.msg)\nament_package()\n",
        encoding="utf-8",
    )
    demo.install()


def test_an_invalid_definition_fails_the_build_with_its_location(rosidl: Ament) -> None:
    demo = rosidl(
        f"{GENERATORS}rosidl_generate_interfaces(demo msg/X.msg)\nament_package()",
        manifest=MEMBER,
        files={"msg/X.msg": "uint7 a\n"},
    )
    demo.configure()
    outcome = demo.try_to_make()
    assert outcome.code != 0
    assert "msg/X.msg:1:1: error:" in outcome.text


def test_a_missing_forge_gives_a_clear_error(rosidl: Ament) -> None:
    demo = rosidl(
        f"{GENERATORS}rosidl_generate_interfaces(demo msg/X.msg)\nament_package()",
        manifest=MEMBER,
        files={"msg/X.msg": "uint8 a\n"},
    )
    outcome = demo.try_to_configure("-DFORGE_COMMAND=", "-DFORGE_EXECUTABLE=FORGE_EXECUTABLE-NOTFOUND")
    if outcome.code == 0:
        pytest.skip("an installed forge is on PATH")
    assert "put 'forge' on PATH" in outcome.flat


@pytest.mark.parametrize("name", ["rosidl_typesupport_introspection_cpp", "rosidl_typesupport_fastrtps_c"])
def test_missing_type_support_is_not_found(rosidl: Ament, name: str) -> None:
    """A package that links it hears the reason when it is configured, not of missing headers or targets."""
    demo = rosidl(f'find_package({name})\nmessage(STATUS "found=${{{name}_FOUND}}")')
    assert demo.configure().said("found") == "0"
    demo = rosidl(f"find_package({name} REQUIRED)")
    outcome = demo.try_to_configure()
    assert outcome.code != 0
    assert f"forge's embedded rosidl generates no code for {name}. Source a ROS" in outcome.flat
    assert "or add the repositories rosidl, rosidl_typesupport and" in outcome.flat


def test_python_extra_file_describes_the_interpreter(rosidl: Ament) -> None:
    """A package that finds PythonExtra needs no headers of Python, and hears of them where they are."""
    demo = rosidl(
        "find_package(python_cmake_module REQUIRED)\nfind_package(PythonExtra REQUIRED)\n"
        'message(STATUS "suffix=${PythonExtra_EXTENSION_SUFFIX}${PythonExtra_EXTENSION_EXTENSION}")\n'
        'message(STATUS "version=${PYTHON_VERSION_MAJOR}.${PYTHON_VERSION_MINOR}")\n'
        'message(STATUS "headers=${PythonExtra_INCLUDE_DIRS}")'
    )
    for _ in range(2):
        outcome = demo.configure()
        assert outcome.said("suffix") == sysconfig.get_config_var("EXT_SUFFIX")
        assert outcome.said("version") == sysconfig.get_python_version()
        headers = sysconfig.get_path("include", vars={"installed_base": sys.base_prefix})
        assert outcome.said("headers") == (headers if Path(headers).exists() else "")


def test_service_events_depend_on_the_distribution(rosidl: Ament) -> None:
    """Nobody declares service_msgs; the project pretends to be built for Jazzy."""
    project = rosidl(
        f"{GENERATORS}set_property(GLOBAL PROPERTY rosidl_distribution jazzy)\n"
        "set_property(GLOBAL PROPERTY rosidl_has_service_events TRUE)\n"
        "set_property(GLOBAL PROPERTY rosidl_describes_types TRUE)\n"
        "rosidl_generate_interfaces(${PROJECT_NAME} srv/Move.srv)\nament_package()",
        name="motion",
        manifest=MEMBER,
        files={"srv/Move.srv": DEFINITIONS["srv/Move.srv"]},
    ).install()
    assert "    Event = Move_Event\n" in project.read(f"{SITE}/motion/srv/_move.py")
    assert "motion__srv__Move_Event__init" in project.read(
        "include/motion/motion/srv/detail/move__functions.h"
    )
    assert "include/motion/motion/srv/detail/move__description.h" in project.files()
    exports = [file for file in project.files() if file.startswith("share/motion/cmake/")]
    assert any("service_msgs" in project.read(file) for file in exports)


def test_two_types_with_the_same_generated_files_are_rejected_before_the_build(rosidl: Ament) -> None:
    made = rosidl(
        f"{GENERATORS}rosidl_generate_interfaces(${{PROJECT_NAME}} msg/IMUData.msg msg/ImuData.msg)\n",
        name="clash",
        manifest=MEMBER,
        files={"msg/IMUData.msg": "int8 a\n", "msg/ImuData.msg": "int8 a\n"},
    )
    outcome = made.try_to_configure()
    assert outcome.code != 0
    assert "'ImuData' and 'IMUData' would both be generated into 'imu_data'" in " ".join(outcome.text.split())
