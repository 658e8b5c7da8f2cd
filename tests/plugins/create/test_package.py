"""Files of created packages, and errors before any file is written."""

import ast
import html
import re
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.base.errors import ForgeError
from forge.plugins.create.package import BUILD_TYPES, LICENSES, NewPackage, render_package
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import DependencyKind, Person
from tests.conftest import Golden
from tests.hostile import hostile
from tests.unit.test_injection import quick

ADA = Person("Ada", "ada@example.org")
CASES = {
    "ament_cmake": NewPackage("walker", ADA, dependencies=("rclcpp", "std_msgs")),
    "ament_cmake-node": NewPackage("walker", ADA, dependencies=("std_msgs",), node="walk"),
    "ament_cmake-bare": NewPackage("walker", ADA, node="walk"),
    "ament_cmake-library": NewPackage(
        "walker", ADA, dependencies=("std_msgs",), node="walk", library="gait_planner", license="Apache-2.0"
    ),
    "interfaces": NewPackage(
        "walker_msgs",
        ADA,
        dependencies=("geometry_msgs",),
        interfaces=("Walk.action", "Gait.msg", "Step.msg"),
    ),
    "interfaces-alone": NewPackage("walker_msgs", ADA, interfaces=("Gait.msg", "SetGait.srv")),
    "cmake": NewPackage("walker", ADA, "cmake", format=2),
    "cmake-library": NewPackage(
        "walker", ADA, "cmake", dependencies=("eigen",), node="walk", library="gait", license="MIT"
    ),
    "ament_python": NewPackage("walker", ADA, "ament_python", dependencies=("rclpy",)),
    "ament_python-node": NewPackage(
        "walker",
        Person("Ada 'A' <Lovelace>", "ada@example.org"),
        "ament_python",
        description='Walks "far" & <wide>\nwith Ada\'s engine',
        node="walk",
        library="gait",
        license="BSD-3-Clause",
    ),
}

words = st.from_regex(r"[a-z][a-z0-9_]{0,9}", fullmatch=True)
lines = st.text(
    st.characters(exclude_categories=("Cc", "Cs", "Cn"), exclude_characters="\ufffe\uffff")
).filter(str.strip)
blueprints = st.builds(
    NewPackage,
    name=words.map("pkg_{}".format),
    maintainer=st.builds(Person, lines, st.just("ada@example.org")),
    build_type=st.sampled_from(BUILD_TYPES),
    format=st.sampled_from((2, 3)),
    description=st.lists(lines, min_size=1).map("\n".join),
    license=lines | st.sampled_from(tuple(LICENSES)),
    dependencies=st.lists(words.map("dep_{}".format), unique=True).map(tuple),
    node=st.none() | words.map("node_{}".format),
    library=st.none() | words.map("lib_{}".format),
)


def files_of(blueprint: NewPackage) -> dict[str, str]:
    return {path: text for path, text in render_package(blueprint).items() if text is not None}


@pytest.mark.parametrize("case", CASES)
def test_created_packages_match_the_golden_files(case: str, golden: Golden) -> None:
    folders = "".join(f"{path}/\n" for path, text in render_package(CASES[case]).items() if text is None)
    golden(f"pkg/{case}", {**files_of(CASES[case]), "folders.txt": folders})


@given(blueprints)
def test_every_created_manifest_has_the_requested_properties(blueprint: NewPackage) -> None:
    text = files_of(blueprint)["package.xml"]
    manifest = parse_manifest(text.encode(), Path("package.xml"), {})
    assert (manifest.name, manifest.version, manifest.format) == (blueprint.name, "0.0.0", blueprint.format)
    assert manifest.build_type == blueprint.build_type
    assert manifest.licenses == (blueprint.license.strip(),)
    assert manifest.maintainers == (replace(blueprint.maintainer, name=blueprint.maintainer.name.strip()),)
    assert html.unescape(manifest.description).split() == blueprint.description.split()
    assert manifest.names(frozenset({DependencyKind.EXEC})) == blueprint.dependencies


@pytest.mark.parametrize("license_", LICENSES)
def test_a_known_license_adds_a_license_file(license_: str) -> None:
    text = files_of(NewPackage("walker", ADA, license=license_))["LICENSE"]
    assert len(text) > 800
    assert "{{" not in text


@pytest.mark.parametrize(
    ("name", "build_type", "message"),
    [
        ("", "cmake", "invalid package name ''"),
        ("_walker", "ament_cmake", "invalid package name '_walker'"),
        ("my walker", "ament_cmake", "invalid package name 'my walker'"),
        ("../walker", "ament_cmake", "invalid package name '../walker'"),
        ("test", "ament_python", "a Python package cannot be named 'test'"),
        ("my-walker", "ament_python", "invalid Python package name 'my-walker'"),
        ("3d", "ament_python", "invalid Python package name '3d'"),
        ("import", "ament_python", "invalid Python package name 'import'"),
    ],
)
def test_names_that_cannot_be_built_are_rejected(name: str, build_type: str, message: str) -> None:
    with pytest.raises(ForgeError) as caught:
        NewPackage(name, ADA, build_type)
    assert [problem.message for problem in caught.value.problems] == [message]


@pytest.mark.parametrize("name", ["test", "my-walker", "3d", "import", "Walker", "a"])
def test_python_keywords_are_valid_cmake_package_names(name: str) -> None:
    assert files_of(NewPackage(name, ADA))["package.xml"]


def test_all_invalid_properties_are_reported_together() -> None:
    with pytest.raises(ForgeError) as caught:
        NewPackage(
            "walker",
            Person("Ada\nLovelace", "ada@home"),
            description=" ",
            license="a\x01b",
            dependencies=("walker", "std msgs"),
            node="clean",
            library="gait-planner",
        )
    assert [problem.message for problem in caught.value.problems] == [
        "package 'walker' cannot depend on itself",
        "invalid dependency name 'std msgs'",
        "invalid --node-name 'clean'",
        "invalid --library-name 'gait-planner'",
        "invalid email address 'ada@home'",
        "--description cannot be empty",
        "--license contains characters not allowed in XML: 'a\\x01b'",
        "--maintainer-name contains characters not allowed in XML: 'Ada\\nLovelace'",
    ]


def test_cpp_node_names_are_file_names() -> None:
    assert "src/walk-far.cpp" in files_of(NewPackage("walker", ADA, node="walk-far"))


@pytest.mark.parametrize(
    ("properties", "message"),
    [
        ({"interfaces": ("pose.msg",)}, "invalid interface file 'pose.msg'"),
        ({"interfaces": ("../Pose.msg",)}, "invalid interface file '../Pose.msg'"),
        ({"interfaces": ("Pose.idl",)}, "invalid interface file 'Pose.idl'"),
        ({"name": "my-msgs"}, "interfaces cannot be in a package named 'my-msgs'"),
        ({"build_type": "ament_python"}, "requires the build type ament_cmake"),
        ({"format": 2}, "requires the build type ament_cmake and package format 3"),
        ({"node": "walk"}, "cannot be combined with --node-name"),
        ({"interfaces": (), "node": "3walk"}, "invalid --node-name '3walk'"),
        ({"interfaces": (), "node": ""}, "invalid --node-name ''"),
        ({"interfaces": (), "build_type": "ament_python", "node": "walk-far"}, "invalid --node-name"),
        ({"interfaces": (), "build_type": "ament_python", "node": "class"}, "invalid --node-name 'class'"),
        ({"interfaces": (), "node": "walk", "library": "walk"}, "cannot both be named 'walk'"),
    ],
)
def test_properties_that_do_not_fit_together_are_rejected(
    properties: dict[str, object], message: str
) -> None:
    values = {"name": "walker_msgs", "maintainer": ADA, "interfaces": ("Pose.msg",), **properties}
    with pytest.raises(ForgeError, match=re.escape(message)):
        NewPackage(**values)  # type: ignore[arg-type]


@quick
@given(hostile(), hostile(), hostile(), st.sampled_from(BUILD_TYPES))
def test_created_packages_contain_the_given_strings(
    description: str, license_: str, name: str, build_type: str
) -> None:
    """Text from the command line never becomes code or markup."""
    person = Person(name, "a@b.cc")
    try:
        blueprint = NewPackage("pkg", person, build_type, description=description, license=license_)
    except ForgeError:
        return
    files = {path: text or "" for path, text in render_package(blueprint).items()}
    manifest = parse_manifest(files["package.xml"].encode(), Path("package.xml"), {})
    assert manifest.maintainers == (Person(" ".join(name.split(" ")).strip(), "a@b.cc"),)
    if build_type == "ament_python":
        call = next(
            node
            for node in ast.walk(ast.parse(files["setup.py"]))
            if isinstance(node, ast.Call) and node.keywords
        )
        said = {word.arg: word.value.value for word in call.keywords if isinstance(word.value, ast.Constant)}
        assert (said["maintainer"], said["description"], said["license"]) == (name, description, license_)
