"""The ROS distribution is an input of the embedded package that interface packages learn it from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from forge.build.build_types import OWN
from forge.workspace.discovery import discover_embedded
from tests.packages import build_context, package

AMENT = OWN["ament_cmake"]
HUMBLE = build_context(Path("/ws"))
JAZZY = replace(HUMBLE, rosdistro="jazzy")


def test_only_the_embedded_generators_have_it_among_their_inputs() -> None:
    embedded = [each for each in discover_embedded("jazzy").values() if each.build_type == "ament_cmake"]
    own = package("rosidl_default_generators")
    concerned = [
        each for each in (*embedded, own) if AMENT.options(each, HUMBLE) != AMENT.options(each, JAZZY)
    ]
    assert [(each.name, each.embedded) for each in concerned] == [("rosidl_default_generators", True)]
    assert "--rosdistro=jazzy" in AMENT.options(concerned[0], JAZZY)
    files = {path.name: text for path, text in AMENT.recipe(concerned[0], JAZZY).files}
    assert 'set(FORGE_ROSDISTRO "jazzy" CACHE STRING' in files["initial_cache.cmake"]


def test_a_distribution_has_the_packages_that_it_has_interfaces_of() -> None:
    present = {name: discover_embedded(name).keys() for name in ("humble", "jazzy", "rolling")}
    assert present["jazzy"] - present["humble"] == {"type_description_interfaces"}
    assert present["jazzy"] - present["rolling"] == {"actionlib_msgs"}


def test_a_package_may_have_services_only_in_newer_distributions() -> None:
    assert discover_embedded("jazzy")["type_description_interfaces"].has_services
