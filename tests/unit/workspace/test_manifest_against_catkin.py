"""forge and catkin_pkg agree on each package.xml: on dependencies, exports, groups and errors."""

from dataclasses import dataclass, field
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from forge.base.errors import WorkspaceError
from forge.workspace.manifest import ConditionError, holds, parse_manifest
from forge.workspace.model import DependencyKind

catkin = pytest.importorskip("catkin_pkg.package", reason="catkin_pkg: pip install catkin_pkg")
conditions = pytest.importorskip("catkin_pkg.condition", reason="catkin_pkg: pip install catkin_pkg")

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")

VARIABLES = {"ROS_VERSION": "2", "ROS_DISTRO": "humble", "EMPTY": ""}

NAMES = st.sampled_from([*("a", "b", "lib-x", "c_d", "a__b", "X1") * 4, "self"])
VERSIONS = st.sampled_from(["1.2.3", "0.0.0", "01.2.3", "1.2", "1.2.3.4", "1.2.x", ""])
_TRUE = ("$ROS_VERSION == 2", "$EMPTY == ''", '$GONE == ""', "a == b or a == a and b == b", "and == and")
_FALSE = ("$ROS_VERSION == 1", "$ROS_DISTRO > humble", "(a == b or a == a) and b != b")
CONDITIONS = st.sampled_from([*(*_TRUE, *_FALSE) * 3, "a", "a = b", "", "()"])
_EVERY = ("build_depend", "buildtool_depend", "test_depend", "conflict", "replace")
_LATER = ("depend", "build_export_depend", "buildtool_export_depend", "exec_depend", "doc_depend")
TAGS = {
    "1": (*_EVERY * 3, *("run_depend",) * 4, "exec_depend"),
    "2": (*_EVERY * 2, *_LATER * 4, "run_depend"),
    "3": (*_EVERY * 2, *_LATER * 4, "run_depend"),
}
OPERATORS = st.sampled_from(["version_lt", "version_gte", "version_eq"])


@dataclass
class Line:
    tag: str
    text: str
    attributes: dict[str, str] = field(default_factory=dict)
    raw: bool = False

    def __str__(self) -> str:
        attributes = "".join(f" {name}={quoteattr(value)}" for name, value in self.attributes.items())
        return f"<{self.tag}{attributes}>{self.text if self.raw else escape(self.text)}</{self.tag}>"


@st.composite
def dependencies(draw: st.DrawFn, format_: str) -> Line:
    """Draw a dependency of any kind; few have an invalid attribute."""
    attributes = {}
    if draw(st.integers(0, 4)) == 0:
        attributes[draw(OPERATORS)] = "1.0.0"
    if draw(st.integers(0, 2 if format_ == "3" else 19)) == 0:
        attributes["condition"] = draw(CONDITIONS)
    return Line(draw(st.sampled_from(TAGS[format_])), draw(NAMES), attributes)


@st.composite
def others(draw: st.DrawFn) -> Line:
    """Draw another element, valid or almost valid."""
    attributes = {"condition": draw(CONDITIONS)} if draw(st.booleans()) else {}
    build_type = f"<build_type{_condition(attributes)}> ament_python </build_type>"
    return draw(
        st.sampled_from(
            [
                Line("group_depend", "g", attributes),
                Line("member_of_group", "g", attributes),
                Line("member_of_group", "h"),
                Line("url", "https://example.com", {"type": "website"}),
                Line("author", "Somebody", {"email": "some.body@example.com"}),
                Line("author", "Somebody", {"email": "nobody"}),
                Line("maintainer", "Another", {"email": "a@b.co"}),
                Line("maintainer", "Nobody"),
                Line("license", "MIT", {"file": "LICENSE"}),
                Line("license", " "),
                Line("export", build_type, raw=True),
                Line("export", "<deprecated/><x y='1'>z</x>", raw=True),
                Line("metapackage", ""),
                Line("depend", "<b/>", raw=True),
                Line("depend", "a", {"colour": "red"}),
                Line("depend", "a", {"x:colour": "red", "xmlns:x": "urn:x"}),
                Line("description", "twice"),
                Line("version", "1.0.0"),
            ]
        )
    )


def _condition(attributes: dict[str, str]) -> str:
    return f" condition={quoteattr(attributes['condition'])}" if attributes else ""


@st.composite
def manifests(draw: st.DrawFn) -> str:
    """Draw a package.xml that is mostly valid."""
    format_ = draw(st.sampled_from(["1", "2", "3", "3"]))
    written = format_ if draw(st.integers(0, 14)) else draw(st.sampled_from([None, "4", "x"]))
    version = draw(VERSIONS) if draw(st.integers(0, 5)) == 0 else "1.2.3"
    lines = [
        Line("name", draw(st.sampled_from([*["self"] * 12, "Self", "my.self", " self "]))),
        Line("version", version),
        Line("description", draw(st.sampled_from([*["text", "<b>x</b> y"] * 5, ""])), raw=True),
        Line("maintainer", "Me", {"email": "me@example.com"}),
        Line("license", "Apache-2.0"),
        *draw(st.lists(dependencies(format_), max_size=5)),
    ]
    if draw(st.integers(0, 2)) == 0:
        lines += draw(st.lists(others(), min_size=1, max_size=2))
    if draw(st.integers(0, 14)) == 0:
        lines.pop(draw(st.integers(0, 4)))
    attribute = f' format="{written}"' if written else ""
    return f"<package{attribute}>\n" + "\n".join(map(str, draw(st.permutations(lines)))) + "\n</package>\n"


_LISTS = {
    "build_depends": DependencyKind.BUILD,
    "buildtool_depends": DependencyKind.BUILDTOOL,
    "build_export_depends": DependencyKind.BUILD_EXPORT,
    "buildtool_export_depends": DependencyKind.BUILDTOOL_EXPORT,
    "exec_depends": DependencyKind.EXEC,
    "test_depends": DependencyKind.TEST,
    "doc_depends": DependencyKind.DOC,
}


def theirs(text: str) -> tuple[object, ...] | None:
    """Return catkin_pkg's result, None for an error."""
    try:
        package = catkin.parse_package_string(text, warnings=[])
        package.evaluate_conditions(VARIABLES)
        exports = [export for export in package.exports if export.evaluated_condition]
    except (catkin.InvalidPackage, AssertionError, ValueError, TypeError):
        return None
    return (
        package.name,
        package.version,
        frozenset(
            (kind.value, dependency.name)
            for attribute, kind in _LISTS.items()
            for dependency in getattr(package, attribute)
            if dependency.evaluated_condition
        ),
        frozenset(group.name for group in package.member_of_groups if group.evaluated_condition),
        frozenset(group.name for group in package.group_depends if group.evaluated_condition),
        tuple(f"{person.name} {person.email}" for person in package.maintainers),
        tuple(map(str, package.licenses)),
        tuple((export.tagname, (export.content or "").strip()) for export in exports),
    )


def ours(text: str) -> tuple[object, ...] | None:
    """Return forge's result, None for an error."""
    try:
        manifest = parse_manifest(text.encode(), Path("package.xml"), VARIABLES)
    except WorkspaceError:
        return None
    return (
        manifest.name,
        manifest.version,
        frozenset(
            (kind.value, dependency.name) for dependency in manifest.dependencies for kind in dependency.kinds
        ),
        frozenset(manifest.groups),
        frozenset(manifest.group_dependencies),
        tuple(f"{person.name} {person.email}" for person in manifest.maintainers),
        manifest.licenses,
        tuple((export.tag, export.content) for export in manifest.exports),
    )


REDUNDANT = """\
<package format="2">
<name>self</name><version>1.2.3</version><description>text</description>
<maintainer email="me@example.com">Me</maintainer><license>Apache-2.0</license>
<build_depend>a</build_depend><depend x:colour="red" xmlns:x="urn:x">a</depend>
</package>
"""
"""Attributes of other namespaces do not make a second dependency another one."""


@example(REDUNDANT)
@given(manifests())
@settings(max_examples=400, deadline=None)
def test_manifests_are_parsed_as_by_catkin_pkg(text: str) -> None:
    assert ours(text) == theirs(text)


@given(st.text(alphabet="$ab1_-'\"()=!<> \tand or", max_size=16))
@settings(max_examples=400, deadline=None)
def test_conditions_are_evaluated_as_by_catkin_pkg(condition: str) -> None:
    try:
        expected = conditions.evaluate_condition(condition, {"a": "b"})
    except ValueError:
        expected = None
    try:
        found: bool | None = holds(condition, {"a": "b"})
    except ConditionError:
        found = None
    assert found == expected
