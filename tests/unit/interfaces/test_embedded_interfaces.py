"""The embedded interface packages: complete, consistent and documented."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import forge
from forge.base.distributions import DISTRIBUTIONS, up_to
from forge.base.standard_interfaces import has_definitions
from forge.interfaces.hashing import hashes
from forge.interfaces.model import Action, Constant, Message, Named, Primitive, Service, element_of
from forge.interfaces.read.parsing import SECTIONS, parse_all, type_name
from forge.interfaces.read.sources import Library, read_folder
from forge.interfaces.resolve.resolution import resolve
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import DependencyKind

if TYPE_CHECKING:
    from collections.abc import Iterator

    from forge.interfaces.model import Field, Interface, Value
    from forge.interfaces.read.parsing import Parsed
    from forge.workspace.model import Manifest

EMBEDDED = Path(forge.__file__).parent / "embedded"
HASHES = Path(__file__).parents[2] / "data/embedded_hashes.json"
VALUES = Path(__file__).parents[2] / "data/embedded_values.json"
REFERENCE = Path(__file__).parents[3] / "docs/reference/embedded-interfaces.md"
NAMES = [
    "action_msgs",
    "actionlib_msgs",
    "builtin_interfaces",
    "composition_interfaces",
    "diagnostic_msgs",
    "example_interfaces",
    "geometry_msgs",
    "lifecycle_msgs",
    "nav_msgs",
    "rcl_interfaces",
    "rosgraph_msgs",
    "sensor_msgs",
    "service_msgs",
    "shape_msgs",
    "statistics_msgs",
    "std_msgs",
    "std_srvs",
    "stereo_msgs",
    "tf2_msgs",
    "trajectory_msgs",
    "turtlesim",
    "type_description_interfaces",
    "unique_identifier_msgs",
    "visualization_msgs",
]
GROUP = "rosidl_interface_packages"

LISTS = """\
cmake_minimum_required(VERSION 3.18)
project({name} NONE)

find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{finds}
rosidl_generate_interfaces(${{PROJECT_NAME}}
{files}{needs})

ament_export_dependencies(rosidl_default_runtime)
ament_package()
"""

LISTS_OF_DISTRIBUTIONS = """\
cmake_minimum_required(VERSION 3.18)
project({name} NONE)

find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{finds}
rosidl_interfaces_of_distribution(interfaces)
rosidl_generate_interfaces(${{PROJECT_NAME}} ${{interfaces}}{needs})

ament_export_dependencies(rosidl_default_runtime)
ament_package()
"""

in_each_package = pytest.mark.parametrize("name", NAMES)


@cache
def _manifest(name: str) -> Manifest:
    path = EMBEDDED / name / "package.xml"
    return parse_manifest(path.read_bytes(), path, {})


@cache
def _parsed(name: str) -> tuple[Parsed, ...]:
    """Return a package's interfaces: messages, services, actions, each by name."""
    return _of_distribution(name, "humble")


@cache
def _of_distribution(name: str, rosdistro: str) -> tuple[Parsed, ...]:
    present = has_definitions(EMBEDDED / name, rosdistro)
    return parse_all(read_folder(name, EMBEDDED / name, rosdistro)) if present else ()


def _everywhere(name: str) -> dict[Path, Parsed]:
    """Return the definitions of all distributions by file."""
    return {p.source.path: p for rosdistro in DISTRIBUTIONS for p in _of_distribution(name, rosdistro)}


def _sections(interface: Interface) -> tuple[Message, ...]:
    match interface:
        case Message():
            return (interface,)
        case Service(_, request, response):
            return (request, response)
        case Action(_, goal, result, feedback):
            return (goal, result, feedback)


def _messages(name: str) -> Iterator[Message]:
    for parsed in _everywhere(name).values():
        yield from _sections(parsed.interface)


def _needs(name: str) -> set[str]:
    """Return the packages whose types the files name, and action_msgs where there is an action."""
    types = [element_of(field.type) for message in _messages(name) for field in message.fields]
    packages = {type_.name.package for type_ in types if isinstance(type_, Named)}
    implied = {"action_msgs" for parsed in _everywhere(name).values() if isinstance(parsed.interface, Action)}
    return (packages | implied) - {name}


def test_these_are_the_interface_packages() -> None:
    manifests = [_manifest(path.parent.name) for path in sorted(EMBEDDED.glob("*/package.xml"))]
    assert [manifest.name for manifest in manifests if GROUP in manifest.groups] == NAMES


@in_each_package
def test_the_manifest_says_what_a_package_of_interfaces_says(name: str) -> None:
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
def test_the_manifest_names_the_packages_whose_types_are_used(name: str) -> None:
    manifest = _manifest(name)
    needs = tuple(sorted(_needs(name)))
    assert manifest.names(frozenset({DependencyKind.BUILD})) == needs
    assert manifest.names(frozenset({DependencyKind.EXEC})) == (*needs, "rosidl_default_runtime")


def _dependencies_argument(needs: list[str], *, differs: bool) -> str:
    if not needs:
        return ""
    words = f"DEPENDENCIES {' '.join(needs)}"
    return f" {words}" if differs else f"  {words}\n"


@in_each_package
def test_the_build_file_lists_every_file_and_has_the_shape_of_all(name: str) -> None:
    needs = sorted(_needs(name))
    differs = (EMBEDDED / name / "since").is_dir()
    expected = (LISTS_OF_DISTRIBUTIONS if differs else LISTS).format(
        name=name,
        finds="".join(f"find_package({need} REQUIRED)\n" for need in needs),
        files="".join(f'  "{parsed.source.relative}"\n' for parsed in _parsed(name)),
        needs=_dependencies_argument(needs, differs=differs),
    )
    assert (EMBEDDED / name / "CMakeLists.txt").read_text(encoding="utf-8") == expected


@in_each_package
def test_nothing_lies_in_a_package_but_what_it_needs(name: str) -> None:
    root = EMBEDDED / name
    files = {path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file()}
    removed = {f"since/{rosdistro}/removed" for rosdistro in DISTRIBUTIONS} & files
    definitions = {path.relative_to(root).as_posix() for path in _everywhere(name)}
    assert files == {"package.xml", "CMakeLists.txt", *removed, *definitions}


def _table(path: Path, rosdistro: str) -> dict[str, object]:
    """Return the table of Humble with the changes up to a distribution; null stands for a removed type."""
    changes = json.loads(path.with_stem(f"{path.stem}_since").read_text(encoding="utf-8"))
    found = json.loads(path.read_text(encoding="utf-8"))
    for name in reversed(up_to(rosdistro)):
        found.update(changes.get(name, {}))
    return {type_: value for type_, value in found.items() if value is not None}


@pytest.mark.parametrize("rosdistro", DISTRIBUTIONS)
def test_the_type_hashes_are_those_of_ros(rosdistro: str) -> None:
    """The tables hold RIHS01 as the reference implementation, and an installed Jazzy, have it."""
    library = Library(embedded=EMBEDDED, rosdistro=rosdistro)
    computed = {
        str(type_): digest
        for name in NAMES
        if (parsed := _of_distribution(name, rosdistro))
        for type_, digest in hashes(resolve(name, parsed, library)).items()
    }
    assert computed == _table(HASHES, rosdistro)


@pytest.mark.parametrize("rosdistro", DISTRIBUTIONS)
def test_constants_and_defaults_are_those_of_the_distribution(rosdistro: str) -> None:
    """Type hashes leave them out, so they have a table of their own."""
    values: dict[str, dict[str, Value]] = {}
    interfaces = (parsed.interface for name in NAMES for parsed in _of_distribution(name, rosdistro))
    for message in (message for interface in interfaces for message in _sections(interface)):
        members: list[Field | Constant] = [*message.constants, *message.fields]
        for member in members:
            value = member.value if isinstance(member, Constant) else member.default
            if value is not None:
                values.setdefault(str(message.name), {})[member.name] = value
    assert values == _table(VALUES, rosdistro)


def test_log_levels_are_bytes_in_humble_and_numbers_later() -> None:
    """The values are the same, so the tables do not show it."""
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


@in_each_package
def test_every_file_begins_with_what_it_is_for(name: str) -> None:
    for parsed in _everywhere(name).values():
        assert re.match(r"# [A-Z].*\.\n", parsed.source.text), parsed.source.relative
        assert re.match(r"(#.*\n)+(\n|$)", parsed.source.text), "a blank line sets the heading apart"


@in_each_package
def test_a_comment_is_short(name: str) -> None:
    for message in _messages(name):
        assert len(message.doc) <= 6, message.name
        members: list[Field | Constant] = [*message.fields, *message.constants]
        for member in members:
            assert len(member.doc) <= 4, f"{message.name}.{member.name}"
    for parsed in _everywhere(name).values():
        assert max(map(len, parsed.source.text.splitlines())) <= 100
        comments = " ".join(line.partition("#")[2] for line in parsed.source.text.splitlines())
        assert all(len(sentence.split()) <= 40 for sentence in re.split(r"[.;:]\s|\s{2,}", comments))


@in_each_package
def test_brackets_in_the_comment_of_a_field_hold_its_unit(name: str) -> None:
    for message in _messages(name):
        for field in message.fields:
            assert "[" not in "".join(field.doc), f"{message.name}.{field.name}"
            assert field.unit is None or re.fullmatch(r"[A-Za-z0-9/^() ]{1,12}", field.unit)
        for constant in message.constants:
            assert "[" not in "".join(constant.doc), f"{message.name}.{constant.name}"


@in_each_package
def test_declarations_are_written_alike(name: str) -> None:
    """One blank between type and name, blanks around '=', two or more before a trailing comment."""
    shape = re.compile(r"|#( \S.*)?|---|[\w/]+(<=\d+)?(\[(<=)?\d*\])? \w+( = \S+| \S+)?( {2,}# \S.*)?")
    for parsed in _everywhere(name).values():
        odd = [line for line in parsed.source.text.splitlines() if not shape.fullmatch(line)]
        assert odd == [], parsed.source.relative


def test_the_reference_has_a_row_for_each_package() -> None:
    rows = [line for line in REFERENCE.read_text(encoding="utf-8").splitlines() if line.startswith("| `")]
    expected = []
    for name in NAMES:
        manifest = _manifest(name)
        counts = [sum(type_name(p.source).kind == kind for p in _parsed(name)) for kind in SECTIONS]
        cells = [f"`{name}`", manifest.version, *(str(count or "") for count in counts), manifest.description]
        expected.append("|" + "".join(f" {cell} |" if cell else " |" for cell in cells))
    assert rows == expected
