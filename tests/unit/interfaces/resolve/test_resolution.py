"""References between types: lookup, unknown types and cycles."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest

from forge.base.errors import InterfaceError
from forge.interfaces.model import Catalog, Source, TypeName
from forge.interfaces.read.parsing import Parsed, parse, parse_all, type_name
from forge.interfaces.resolve.resolution import dependency_catalogs, nested_messages, resolve


@dataclass
class Shelf:
    """The interfaces of other packages: their texts by 'package/kind/file'."""

    texts: Mapping[str, str]
    declared: frozenset[str] = frozenset()

    def find(self, name: TypeName) -> Parsed | None:
        path = f"{name}.{name.kind}"
        if path not in self.texts:
            return None
        source = Source(name.package, f"{name.kind}/{name.name}.{name.kind}", Path(path), self.texts[path])
        return Parsed(source, parse(source))

    def distribution_hint(self, name: TypeName) -> None:
        del name

    def declares(self, package: str) -> bool:
        return package in self.declared

    def names(self) -> Iterable[TypeName]:
        return [TypeName(*path.partition(".")[0].split("/")) for path in self.texts]


ROS = {
    "builtin_interfaces/msg/Time.msg": "int32 sec\nuint32 nanosec",
    "unique_identifier_msgs/msg/UUID.msg": "uint8[16] uuid",
    "std_msgs/msg/Header.msg": "builtin_interfaces/Time stamp\nstring frame_id",
    "action_msgs/msg/GoalInfo.msg": "unique_identifier_msgs/UUID goal_id\nbuiltin_interfaces/Time stamp",
    "action_msgs/msg/GoalStatus.msg": "GoalInfo goal_info\nint8 status",
    "action_msgs/msg/GoalStatusArray.msg": "GoalStatus[] status_list",
    "action_msgs/srv/CancelGoal.srv": "GoalInfo goal_info\n---\nGoalInfo[] goals_canceling",
}


def catalog(files: Mapping[str, str], shelf: Shelf | None = None) -> Catalog:
    sources = [Source("tour", relative, Path(relative), text) for relative, text in files.items()]
    return resolve("tour", parse_all(sources), shelf or Shelf(ROS))


def problems(files: Mapping[str, str], shelf: Shelf | None = None) -> list[str]:
    """Return location, message and hint of each problem of the package 'tour'."""
    with pytest.raises(InterfaceError) as caught:
        catalog(files, shelf)
    return [f"{p.location}: {p.message} ({p.hint})" for p in caught.value.problems]


def test_a_catalog_contains_all_referenced_messages() -> None:
    found = catalog({"msg/B.msg": "std_msgs/Header[] headers", "msg/A.msg": "B b"})
    assert [str(name) for name in found.interfaces] == ["tour/msg/A", "tour/msg/B"]
    assert sorted(map(str, found.known)) == [
        "builtin_interfaces/msg/Time",
        "std_msgs/msg/Header",
        "tour/msg/A",
        "tour/msg/B",
    ]
    assert [source.relative for source in found.sources.values()] == [
        "msg/A.msg",
        "msg/B.msg",
        "msg/Header.msg",
        "msg/Time.msg",
    ]


def test_an_action_includes_derived_types_and_their_dependencies() -> None:
    found = catalog({"action/Go.action": "---\n---\n"})
    names = {str(name) for name in found.known}
    assert {"tour/action/Go_SendGoal_Request", "tour/action/Go_FeedbackMessage"} <= names
    assert {"unique_identifier_msgs/msg/UUID", "builtin_interfaces/msg/Time"} <= names


def test_unknown_types_are_reported_with_a_suggestion() -> None:
    header = "did you mean 'std_msgs/Header'? add <depend>std_msgs</depend> to package.xml"
    assert problems({"msg/A.msg": "std_msg/Header a\nHeader b\nB c", "msg/Bb.msg": "nowhere/Thing a"}) == [
        f"msg/A.msg:1:1: unknown type 'std_msg/Header' ({header})",
        f"msg/A.msg:2:1: unknown type 'tour/Header' ({header})",
        "msg/A.msg:3:1: unknown type 'tour/B' (did you mean 'tour/Bb'?)",
        "msg/Bb.msg:1:1: unknown type 'nowhere/Thing' (add <depend>nowhere</depend> to package.xml)",
    ]


def test_header_without_a_package_suggests_std_msgs() -> None:
    shelf = Shelf({"own/msg/Header.msg": "int8 a"}, frozenset({"own"}))
    assert problems({"msg/A.msg": "Header h", "msg/Headers.msg": ""}, shelf) == [
        (
            "msg/A.msg:1:1: unknown type 'tour/Header' (did you mean 'std_msgs/Header'? "
            "add <depend>std_msgs</depend> to package.xml)"
        )
    ]


def test_suggestions_ignore_a_common_package_name() -> None:
    files = {"msg/A.msg": "Nope a", "msg/M9.msg": "int8 a", "msg/Other.msg": "int8 a"}
    assert problems(files, Shelf({})) == ["msg/A.msg:1:1: unknown type 'tour/Nope' (None)"]


def test_suggestions_prefer_types_of_declared_packages() -> None:
    texts = {"a_msgs/msg/Pose.msg": "int8 a", "b_msgs/msg/Pose.msg": "int8 a"}
    files = {"msg/A.msg": "Pose a\nb_msgs/Poze b\nnowhere/Thing c", "msg/MyPose.msg": "int8 a"}
    assert problems(files, Shelf(texts, frozenset({"b_msgs", "nowhere"}))) == [
        "msg/A.msg:1:1: unknown type 'tour/Pose' (did you mean 'b_msgs/Pose'?)",
        "msg/A.msg:2:1: unknown type 'b_msgs/Poze' (did you mean 'b_msgs/Pose'?)",
        "msg/A.msg:3:1: unknown type 'nowhere/Thing' (None)",
    ]
    assert problems(files, Shelf(texts))[0].endswith(
        "(did you mean 'a_msgs/Pose'? add <depend>a_msgs</depend> to package.xml)"
    )


def test_an_invalid_definition_of_another_package_is_reported_once() -> None:
    shelf = Shelf({"p/msg/A.msg": "foo a"})
    assert problems({"msg/A.msg": "p/A a\np/A b", "msg/B.msg": "p/A a"}, shelf) == [
        "p/msg/A.msg:1:1: unknown type 'foo' (None)"
    ]


def test_a_service_cannot_be_the_type_of_a_field() -> None:
    shelf = Shelf({"p/msg/A.msg": "int8 a", "p/srv/B.srv": "---"})
    assert problems({"msg/A.msg": "p/B b"}, shelf) == [
        "msg/A.msg:1:1: unknown type 'p/B' (did you mean 'p/A'?)"
    ]


def test_each_cycle_is_reported_once_with_its_path() -> None:
    files = {"msg/A.msg": "B b", "msg/B.msg": "int8 x\nA[] a", "msg/C.msg": "C c", "msg/D.msg": "A a\nC c"}
    found = problems(files)
    assert len(found) == 2
    assert any("tour/C -> tour/C" in text for text in found)
    assert any("tour/A -> tour/B -> tour/A" in text or "tour/B -> tour/A -> tour/B" in text for text in found)


def test_duplicate_names_and_output_files_are_errors() -> None:
    assert problems({"msg/A.msg": "", "more/msg/A.msg": ""}) == [
        "more/msg/A.msg: 'tour/msg/A' is also defined in 'msg/A.msg' (None)"
    ]
    found = problems({"msg/AB1.msg": "", "msg/Ab1.msg": "", "srv/Ab1.srv": "---"})
    assert len(found) == 1
    assert "'Ab1' and 'AB1' would both be generated into 'ab1'" in found[0]


def test_a_message_and_a_service_may_share_a_name() -> None:
    found = catalog({"msg/Empty.msg": "", "srv/Empty.srv": "---"})
    assert [str(name) for name in found.interfaces] == ["tour/msg/Empty", "tour/srv/Empty"]


def test_a_chain_of_thousands_of_messages_resolves() -> None:
    files = {f"msg/M{n}.msg": f"M{n + 1} next" for n in range(3000)} | {"msg/M3000.msg": "int8 last"}
    assert len(catalog(files).known) == 3001


def test_dependencies_of_generated_code_are_grouped_by_package() -> None:
    shelf = Shelf(ROS)
    others = dependency_catalogs(catalog({"msg/A.msg": "std_msgs/Header a"}, shelf), shelf)
    assert {each.package: list(map(str, each.interfaces)) for each in others} == {
        "builtin_interfaces": ["builtin_interfaces/msg/Time"],
        "std_msgs": ["std_msgs/msg/Header"],
    }
    others = dependency_catalogs(catalog({"action/Go.action": "---\n---"}, shelf), shelf)
    assert [each.package for each in others] == [
        "action_msgs",
        "builtin_interfaces",
        "unique_identifier_msgs",
    ]
    assert [name.name for name in others[0].interfaces] == [
        "GoalInfo",
        "GoalStatus",
        "GoalStatusArray",
        "CancelGoal",
    ]


def test_a_missing_dependency_of_generated_code_is_an_error() -> None:
    shelf = Shelf({path: text for path, text in ROS.items() if "CancelGoal" not in path})
    with pytest.raises(
        InterfaceError, match="cannot find 'action_msgs/srv/CancelGoal', which generated code requires"
    ):
        dependency_catalogs(catalog({"action/Go.action": "---\n---"}, shelf), shelf)


def test_messages_used_by_installed_interfaces_are_included() -> None:
    parsed = Shelf(ROS).find(TypeName("action_msgs", "srv", "CancelGoal"))
    assert parsed
    below = nested_messages(parsed, Shelf(ROS))
    assert TypeName("action_msgs", "msg", "GoalInfo") in below
    assert type_name(parsed.source) not in below
