"""When and how interface packages, and those with component nodes, are built faster."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from forge.build.build_types import OWN
from forge.build.tasks import StepKind
from forge.workspace.discovery import ROS_DEFAULTS
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import Package
from tests.packages import build_context, manifest_text, package

AMENT = OWN["ament_cmake"]
CONTEXT = replace(build_context(Path("/w s")), generator_launcher=("/my python", "client.py", "--generator"))
PLAIN = replace(CONTEXT, generator_launcher=())
INTERFACES = Package(
    Path("src/i"),
    parse_manifest(
        manifest_text("i", "<member_of_group>rosidl_interface_packages</member_of_group>").encode(),
        Path("src/i/package.xml"),
        ROS_DEFAULTS,
    ),
)


def test_only_packages_with_interfaces_are_concerned() -> None:
    other = package("p")
    assert AMENT.recipe(other, CONTEXT) == AMENT.recipe(other, PLAIN)
    assert AMENT.options(other, CONTEXT) == AMENT.options(other, PLAIN)
    assert AMENT.recipe(INTERFACES, CONTEXT) != AMENT.recipe(INTERFACES, PLAIN)


def test_the_choice_is_an_input_and_configures_again() -> None:
    assert AMENT.options(INTERFACES, CONTEXT) != AMENT.options(INTERFACES, PLAIN)
    records = [AMENT.recipe(INTERFACES, context).steps[0].record for context in (CONTEXT, PLAIN)]
    assert records[0] != records[1]


def test_packages_that_register_nodes_get_a_file_of_their_own() -> None:
    nodes = package("p", "rclcpp_components")
    files = {path.name: text for path, text in AMENT.recipe(nodes, CONTEXT).files}
    assert 'include("${CMAKE_CURRENT_LIST_DIR}/component_nodes.cmake")' in files["project.cmake"]
    assert "target_precompile_headers" in files["component_nodes.cmake"]
    assert AMENT.options(nodes, CONTEXT) != AMENT.options(nodes, PLAIN)


def test_another_place_of_forge_changes_no_input() -> None:
    moved = replace(CONTEXT, generator_launcher=("/elsewhere", "client.py"))
    assert AMENT.options(INTERFACES, CONTEXT) == AMENT.options(INTERFACES, moved)


def test_cmake_gets_the_files_and_paths_are_quoted() -> None:
    recipe = AMENT.recipe(INTERFACES, CONTEXT)
    files = {path.name: text for path, text in recipe.files}
    include = "/w s/build/i/.forge/project.cmake"
    assert f'set(CMAKE_PROJECT_INCLUDE "{include}" CACHE' in files["initial_cache.cmake"]
    assert 'include("${CMAKE_CURRENT_LIST_DIR}/fast_rosidl.cmake")' in files["project.cmake"]
    assert "RULE_LAUNCH_CUSTOM \"'/my python' client.py --generator\"" in files["fast_rosidl.cmake"]
    assert (
        "'/w s/build/i/.forge/compile_generated.sh' '/w s/build/i/.forge_units_failed'"
        in files["fast_rosidl.cmake"]
    )
    build = next(step for step in recipe.steps if step.kind is StepKind.BUILD)
    assert build.argv[:2] == ("sh", "-c")
    assert build.argv[3:] == ("/w s/build/i/.forge_units_failed", "/usr/bin/cmake", "--build", "/w s/build/i")
