"""Loading definitions as classes at run time, without writing files."""

import copy
import pickle
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

import forge
from forge.base.errors import InterfaceError, SelectionError
from forge.interfaces import load
from tests.conftest import Tree
from tests.generated import reads_idl

LINE = "=" * 80


def test_a_folder_provides_its_classes_and_nested_ones(tree: Tree) -> None:
    folder = tree(
        {"tour/msg/A.msg": "std_msgs/Header header\nint8[] numbers [1, 2]", "tour/srv/B.srv": "A a\n---\n"}
    )
    types = load(folder / "tour")
    assert list(types) == ["tour/msg/A", "tour/srv/B", "builtin_interfaces/msg/Time", "std_msgs/msg/Header"]
    assert (len(types), "tour/msg/A" in types, "tour/msg/C" in types) == (4, True, False)
    assert repr(types).startswith("<types tour/msg/A, tour/srv/B, ")
    header = types["std_msgs/msg/Header"](frame_id="map")
    message = types["tour/msg/A"](header=header)
    assert repr(types["tour/srv/B"].Request(a=message).a) == (
        "tour.msg.A(header=std_msgs.msg.Header(stamp=builtin_interfaces.msg.Time(sec=0, nanosec=0), "
        "frame_id='map'), numbers=[1, 2])"
    )
    assert copy.deepcopy(message) == message == pickle.loads(pickle.dumps(message))
    assert sorted(path.name for path in folder.iterdir()) == ["tour"]


def test_embedded_packages_match_the_distribution(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tree({"far/msg/A.msg": "sensor_msgs/Range range", "far/srv/B.srv": "---\n"}) / "far"
    monkeypatch.setenv("ROS_DISTRO", "jazzy")
    types = load(folder)
    assert hasattr(types["far/msg/A"]().range, "variance")
    assert types["far/srv/B"].Event(request=[types["far/srv/B"].Request()]).info.event_type == 0
    older = load(folder, rosdistro="humble")
    assert not hasattr(older["far/msg/A"]().range, "variance")
    assert not hasattr(older["far/srv/B"], "Event")
    with pytest.raises(SelectionError, match="rosdistro: unknown ROS distribution 'hmble'"):
        load(folder, rosdistro="hmble")


def test_a_schema_provides_its_type_and_nested_types() -> None:
    header = f"{LINE}\nMSG: tour/Header\nuint32 sequence_number\nfar/Far[2] far\n"
    text = f"Header header\n{header}{LINE}\nMSG: far/Far\nint8 a\n"
    types = load(text, "tour/msg/A")
    assert list(types) == ["tour/msg/A", "tour/msg/Header", "far/msg/Far"]
    assert types["tour/msg/A"]().header.far == [types["far/msg/Far"](), types["far/msg/Far"]()]


def test_two_versions_of_a_type_coexist() -> None:
    old, new = load("int8 a", "tour/msg/A"), load("int16 a\nint8 b", "tour/msg/A")
    assert old["tour/msg/A"].get_fields_and_field_types() == {"a": "int8"}
    assert new["tour/msg/A"].get_fields_and_field_types() == {"a": "int16", "b": "int8"}
    assert load("int8 a", "tour/msg/A")["tour/msg/A"] is old["tour/msg/A"], (
        "the same definitions are the same"
    )


@reads_idl
def test_idl_files_and_actions_can_be_loaded(tree: Tree) -> None:
    idl = "module tour { module msg { struct A { @default (value=7) long a; }; }; };"
    assert load(f"{LINE}\nIDL: tour/msg/A\n{idl}", "tour/msg/A")["tour/msg/A"]().a == 7
    folder = tree({"action/Go.action": "int8 a\n---\nstd_msgs/Header header\n---\n"})
    go = load(folder, "tour")["tour/action/Go"]
    assert go.Impl.SendGoalService.Request().goal == go.Goal()
    assert go.Impl.GetResultService.Response().result.header.frame_id == ""


def test_invalid_arguments_are_reported() -> None:
    with pytest.raises(InterfaceError, match=r"tour/msg/A.msg:1:1: error: unknown type 'tour/B'"):
        load("B b", "tour/msg/A")
    with pytest.raises(InterfaceError, match="missing type name of the schema"):
        load("int8 a")
    with pytest.raises(InterfaceError, match="no interface definitions found in"):
        load(Path("nowhere"))
    with pytest.raises(KeyError):
        load("int8 a", "tour/msg/A")["tour/msg/B"]
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = forge.interfaces.nothing


def test_in_memory_modules_behave_like_modules() -> None:
    types = load("std_msgs/String text", "tour/msg/A")
    module: Any = import_module(types["tour/msg/A"].__module__)
    root = module.__name__.partition(".")[0]
    assert module.__spec__.origin == "in memory"
    assert "class A(" in module.__spec__.loader.get_source(module.__name__)
    assert import_module(f"{root}.std_msgs.msg").String is types["std_msgs/msg/String"]
    with pytest.raises(ModuleNotFoundError):
        import_module(f"{root}.tour.msg._nothing")
    assert module.A.__init__.__code__.co_filename == f"<{module.__name__}>"


def test_big_endian_bytes_are_read_into_in_memory_types() -> None:
    """The generic codec finds classes by name, including those of other packages."""
    load("int8 a", "tour/msg/A")
    forge_cdr = import_module("forge_cdr")
    types = load("std_msgs/Header header\nint16 a", "tour/msg/B")
    data = bytes.fromhex("00000000 00000001 00000002 00000004 6d617000 0003")
    message = forge_cdr.deserialize(data, types["tour/msg/B"])
    assert (message.header.stamp.sec, message.header.frame_id, message.a) == (1, "map", 3)
