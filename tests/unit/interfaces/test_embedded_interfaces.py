"""The embedded interface packages: complete, consistent and documented."""

import json
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import forge
from forge.base.distributions import DISTRIBUTIONS, embedded_definitions, up_to
from forge.interfaces.hashing import hashes
from forge.interfaces.model import (
    SECTIONS,
    Action,
    Constant,
    Field,
    Message,
    Named,
    Primitive,
    Value,
    element_of,
    sections_of,
)
from forge.interfaces.read.parsing import Parsed, parse_all, type_name
from forge.interfaces.read.sources import Library, read_folder
from forge.interfaces.resolve.resolution import resolve
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import DependencyKind, Manifest

EMBEDDED = Path(forge.__file__).parent / "embedded"
HASHES = Path(__file__).parents[2] / "data/embedded_hashes.json"
VALUES = Path(__file__).parents[2] / "data/embedded_values.json"
REFERENCE = Path(__file__).parents[3] / "docs/reference/embedded-interfaces.md"
NAMES = """
    action_msgs actionlib_msgs builtin_interfaces composition_interfaces diagnostic_msgs
    example_interfaces geometry_msgs lifecycle_msgs nav_msgs rcl_interfaces rosgraph_msgs
    sensor_msgs service_msgs shape_msgs statistics_msgs std_msgs std_srvs stereo_msgs tf2_msgs
    trajectory_msgs turtlesim type_description_interfaces unique_identifier_msgs visualization_msgs
""".split()
GROUP = "rosidl_interface_packages"


in_each_package = pytest.mark.parametrize("name", NAMES)


@cache
def _manifest(name: str) -> Manifest:
    path = EMBEDDED / name / "package.xml"
    return parse_manifest(path.read_bytes(), path, {})


@cache
def _parsed(name: str) -> tuple[Parsed, ...]:
    """Return the interfaces of a package in Humble."""
    return _of_distribution(name, "humble")


@cache
def _of_distribution(name: str, rosdistro: str) -> tuple[Parsed, ...]:
    present = embedded_definitions(EMBEDDED / name, rosdistro)
    return parse_all(read_folder(name, EMBEDDED / name, rosdistro)) if present else ()


def _everywhere(name: str) -> dict[Path, Parsed]:
    return {p.source.path: p for rosdistro in DISTRIBUTIONS for p in _of_distribution(name, rosdistro)}


def _messages(name: str) -> Iterator[Message]:
    for parsed in _everywhere(name).values():
        yield from sections_of(parsed.interface)


def _needs(name: str) -> set[str]:
    """Return the packages of referenced types, and action_msgs if there is an action."""
    types = [element_of(field.type) for message in _messages(name) for field in message.fields]
    packages = {type_.name.package for type_ in types if isinstance(type_, Named)}
    implied = {"action_msgs" for parsed in _everywhere(name).values() if isinstance(parsed.interface, Action)}
    return (packages | implied) - {name}


def test_the_embedded_interface_packages_are_complete() -> None:
    manifests = [_manifest(path.parent.name) for path in sorted(EMBEDDED.glob("*/package.xml"))]
    assert [manifest.name for manifest in manifests if GROUP in manifest.groups] == NAMES


@in_each_package
def test_embedded_manifests_declare_interface_packages(name: str) -> None:
    manifest = _manifest(name)
    assert manifest.warnings == ()
    assert manifest.format == 3
    assert manifest.name == name
    assert manifest.build_type == "ament_cmake"
    assert manifest.licenses == ("Apache-2.0",)
    assert manifest.groups == (GROUP,)
    assert manifest.names(frozenset({DependencyKind.BUILDTOOL})) == ("ament_cmake", "rosidl_core_generators")
    assert re.fullmatch(r"[A-Z][^.]{9,99}\.", manifest.description)


@in_each_package
def test_embedded_manifests_declare_all_dependencies(name: str) -> None:
    manifest = _manifest(name)
    needs = tuple(sorted(_needs(name)))
    assert manifest.names(frozenset({DependencyKind.BUILD})) == needs
    assert manifest.names(frozenset({DependencyKind.EXEC})) == (*needs, "rosidl_default_runtime")


def _table(path: Path, rosdistro: str) -> dict[str, object]:
    """Return the table of Humble with the changes up to a distribution; null means a removed type."""
    changes = json.loads(path.with_stem(f"{path.stem}_since").read_text(encoding="utf-8"))
    found = json.loads(path.read_text(encoding="utf-8"))
    for name in reversed(up_to(rosdistro)):
        found.update(changes.get(name, {}))
    return {type_: value for type_, value in found.items() if value is not None}


@pytest.mark.parametrize("rosdistro", DISTRIBUTIONS)
def test_type_hashes_match_ros(rosdistro: str) -> None:
    """The tables contain the hashes of the reference implementation and of an installed Jazzy."""
    library = Library(embedded=EMBEDDED, rosdistro=rosdistro)
    computed = {
        str(type_): digest
        for name in NAMES
        if (parsed := _of_distribution(name, rosdistro))
        for type_, digest in hashes(resolve(name, parsed, library)).items()
    }
    assert computed == _table(HASHES, rosdistro)


@pytest.mark.parametrize("rosdistro", DISTRIBUTIONS)
def test_constants_and_defaults_match_the_distribution(rosdistro: str) -> None:
    """Type hashes do not include them."""
    values: dict[str, dict[str, Value]] = {}
    interfaces = (parsed.interface for name in NAMES for parsed in _of_distribution(name, rosdistro))
    for message in (message for interface in interfaces for message in sections_of(interface)):
        members: list[Field | Constant] = [*message.constants, *message.fields]
        for member in members:
            value = member.value if isinstance(member, Constant) else member.default
            if value is not None:
                values.setdefault(str(message.name), {})[member.name] = value
    assert values == _table(VALUES, rosdistro)


def test_log_levels_are_bytes_in_humble_and_integers_later() -> None:
    """The tables do not contain types."""
    types = {
        rosdistro: {
            constant.type
            for parsed in _of_distribution("rcl_interfaces", rosdistro)
            if parsed.source.relative == "msg/Log.msg" and isinstance(parsed.interface, Message)
            for constant in parsed.interface.constants
        }
        for rosdistro in DISTRIBUTIONS
    }
    numbers = {rosdistro: {Primitive("uint8")} for rosdistro in DISTRIBUTIONS[1:]}
    assert types == {"humble": {Primitive("octet")}, **numbers}


def test_the_reference_has_a_row_for_each_package() -> None:
    rows = [line for line in REFERENCE.read_text(encoding="utf-8").splitlines() if line.startswith("| `")]
    expected = []
    for name in NAMES:
        manifest = _manifest(name)
        counts = [sum(type_name(p.source).kind == kind for p in _parsed(name)) for kind in SECTIONS]
        cells = [f"`{name}`", manifest.version, *(str(count or "") for count in counts), manifest.description]
        expected.append("|" + "".join(f" {cell} |" if cell else " |" for cell in cells))
    assert rows == expected
