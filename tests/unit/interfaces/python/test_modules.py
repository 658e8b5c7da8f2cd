"""Use of generated Python: modules, messages, services and actions."""

import copy
import math
import pickle
from array import array
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from forge.interfaces.python import target as python
from tests.conftest import GOLDEN, Golden
from tests.generated import PROBE, catalog_of, generate, importable, refused


def test_packages_have_a_module_per_file_and_kind() -> None:
    catalog = catalog_of("probe", {"msg/UInt8.msg": "", "srv/DoIt.srv": "---", "msg/Vec3D.msg": ""})
    paths = sorted(file.path for file in python.files(catalog))
    assert [path for path in paths if not path.endswith((".pyi", "__cdr.py"))] == [
        "probe/__init__.py",
        "probe/msg/__init__.py",
        "probe/msg/_u_int8.py",
        "probe/msg/_vec3_d.py",
        "probe/py.typed",
        "probe/srv/__init__.py",
        "probe/srv/_do_it.py",
    ]


def test_only_the_main_name_is_exported(probe: Path) -> None:
    assert probe.is_dir()
    srv = import_module("probe.srv")
    assert srv.__all__ == ["Point"]
    with pytest.raises(AttributeError, match=r"'probe\.srv' has no attribute 'Point_Request'"):
        _ = srv.Point_Request


def test_classes_are_defined_in_the_module_of_their_file(msg: ModuleType) -> None:
    assert msg.Scalars.__module__ == "probe.msg._scalars"
    assert import_module("probe.srv").Point.Request.__module__ == "probe.srv._point"


def test_dir_and_star_imports_of_a_namespace_contain_its_classes(msg: ModuleType) -> None:
    assert {path.stem for path in PROBE.glob("msg/*.msg")} <= set(dir(msg))
    names: dict[str, Any] = {}
    exec("from probe.msg import *", names)
    assert names["Point"] is msg.Point
    assert set(msg.__all__) == {name for name in names if not name.startswith("_")}


def test_constants_can_be_read_on_class_and_instance(msg: ModuleType) -> None:
    for owner in (msg.Constants, msg.Constants()):
        assert (owner.YES, owner.RAW, owner.LETTER, owner.LOW) == (True, b"\n", 65, -128)
        assert (18446744073709551615, 3.5, math.inf) == (owner.HIGH, owner.PI, owner.INF)
        assert math.isnan(owner.NAN)
        assert (owner.WORD, owner.WIDE) == ("it's", "日本")


def test_constants_are_listed_without_defaults(msg: ModuleType) -> None:
    assert {"YES": True, "LOW": -128, "WORD": "it's"}.items() <= msg.Constants.get_constants().items()
    assert any(name.endswith("__DEFAULT") for name in dir(msg.Defaults))
    assert msg.Defaults().get_constants() == {}


def test_classes_know_their_definitions_and_units(tmp_path: Path) -> None:
    """Those of a service and its parts are one file."""
    wheel = '# A wheel, "round".\nfloat64 speed  # [m/s]\n\nfloat64 from  # over ground [m]\nWheel2 other'
    texts = {
        "msg/Wheel.msg": wheel,
        "msg/Wheel2.msg": "",
        "srv/Turn.srv": "float32 by  # [rad]\n---\n",
        "action/Go.action": "---\nint8 code\n---\nfloat32 left  # [\u00b5m]\n",
    }
    generate(tmp_path, catalog_of("units", texts))
    with importable(tmp_path):
        wheel_class, other = import_module("units.msg").Wheel, import_module("units.msg").Wheel2
        turn, go = import_module("units.srv").Turn, import_module("units.action").Go
        assert wheel_class.get_definition() == wheel_class().get_definition() == wheel
        assert wheel_class.get_units() == {"speed": "m/s", "from": "m"}
        assert (other.get_definition(), other.get_units()) == ("", {})
        for each in (turn, turn.Request, turn.Response()):
            assert each.get_definition() == texts["srv/Turn.srv"]
        assert (turn.Request.get_units(), turn.Response.get_units()) == ({"by": "rad"}, {})
        assert go.get_definition() == go.Feedback.get_definition() == texts["action/Go.action"]
        assert go.Feedback.get_units() == {"left": "\u00b5m"}


def test_constants_cannot_be_changed(msg: ModuleType) -> None:
    for owner in (msg.Constants, msg.Constants()):
        with pytest.raises(AttributeError, match="LOW"):
            owner.LOW = 1
        with pytest.raises(AttributeError, match="LOW"):
            del owner.LOW
    assert msg.Constants.LOW == -128


def test_classes_accept_additional_attributes(msg: ModuleType) -> None:
    msg.Hidden.note = "mine"
    msg.Hidden.note = "still mine"
    del msg.Hidden.note
    assert not hasattr(msg.Hidden, "note")


def test_defaults_can_be_read_but_not_changed(msg: ModuleType) -> None:
    assert msg.Defaults.WHOLE__DEFAULT == 0.0
    assert array("i", [1, 2]) == msg.Defaults().SOME__DEFAULT
    for name in ("WHOLE__DEFAULT", "SOME__DEFAULT"):
        with pytest.raises(AttributeError, match=name):
            setattr(msg.Defaults, name, None)
        with pytest.raises(AttributeError, match=name):
            setattr(msg.Defaults(), name, None)
    assert not hasattr(msg.Point, "X__DEFAULT")


@pytest.mark.parametrize("name", ["SOME__DEFAULT", "PAIR__DEFAULT", "FLAGS__DEFAULT"])
def test_class_defaults_are_copies_and_instance_defaults_are_shared(msg: ModuleType, name: str) -> None:
    assert getattr(msg.Defaults, name) is not getattr(msg.Defaults, name)
    assert getattr(msg.Defaults(), name) is getattr(msg.Defaults(), name)


def test_slots_are_exclusive_and_in_field_order(msg: ModuleType) -> None:
    assert msg.Nested.__slots__ == ["_header", "_point"]
    with pytest.raises(AttributeError):
        msg.Nested().other = 1
    assert not hasattr(msg.Nested(), "__dict__")


def test_field_types_are_spelled_as_rosidl_does(msg: ModuleType) -> None:
    assert msg.Nested.get_fields_and_field_types() == {"header": "std_msgs/Header", "point": "probe/Point"}
    types = {
        **msg.Scalars.get_fields_and_field_types(),
        **msg.Fixed.get_fields_and_field_types(),
        **msg.Bound.get_fields_and_field_types(),
    }
    assert types["flag"] == "boolean"
    assert (types["octet"], types["letter"], types["wide"], types["brief"]) == (
        "octet",
        "uint8",
        "wstring",
        "string<3>",
    )
    assert (types["single"], types["exact"]) == ("float", "double")
    assert (types["a_int8"], types["bytes"]) == ("int8[3]", "octet[2]")
    assert (types["numbers"], types["shorts"]) == ("sequence<int32, 3>", "sequence<string<3>, 2>")
    assert types["points"] == "sequence<probe/Point, 2>"


def test_slot_types_describe_the_fields(msg: ModuleType) -> None:
    definition = import_module("rosidl_parser.definition")
    point = definition.NamespacedType(["probe", "msg"], "Point")
    assert (
        definition.BoundedSequence(definition.BasicType("int32"), 3),
        definition.BoundedSequence(definition.UnboundedString(), 3),
        definition.BoundedSequence(definition.BoundedString(3), 2),
        definition.BoundedSequence(point, 2),
    ) == msg.Bound.SLOT_TYPES
    assert msg.Fixed.SLOT_TYPES[-1] == definition.Array(point, 2)
    assert msg.Loose().SLOT_TYPES[-1] == definition.UnboundedSequence(point)
    assert definition.UnboundedWString() in msg.Scalars.SLOT_TYPES
    assert msg.Nested.SLOT_TYPES[1].namespaces == ["probe", "msg"]


def test_constructors_accept_fields_and_check_fields_as_keywords(msg: ModuleType) -> None:
    with refused("Invalid arguments passed to constructor: a, z"):
        msg.Point(z=1, a=2, x=0.0, check_fields=True)
    with pytest.raises(TypeError):
        msg.Point(1.0)


def test_check_fields_does_not_disable_checks(msg: ModuleType) -> None:
    for wanted in (True, False):
        message = msg.Point(x=1.0, check_fields=wanted)
        assert message == msg.Point(x=1.0)
        with refused("The 'x' field must be of type 'float'"):
            message.x = 1


def test_messages_are_compared_by_fields(msg: ModuleType) -> None:
    assert msg.Point(x=1.0) == msg.Point(x=1.0)
    assert msg.Point(x=1.0) != msg.Point(x=2.0)
    assert msg.Point() != msg.Nothing()
    assert msg.Point() != 0
    assert msg.Nothing() == msg.Nothing()
    assert msg.Point(x=math.nan) != msg.Point(x=math.nan)


def test_arrays_differ_if_an_element_differs(msg: ModuleType) -> None:
    one, other = msg.Fixed(a_int8=[1, 2, 3]), msg.Fixed(a_int8=[1, 2, 4])
    assert one != other
    other.a_int8[2] = 3
    assert one == other


def test_messages_are_not_hashable_or_ordered(msg: ModuleType) -> None:
    with pytest.raises(TypeError):
        hash(msg.Point())
    with pytest.raises(TypeError):
        _ = msg.Point() < msg.Point()


def test_repr_returns_a_constructor_call(msg: ModuleType) -> None:
    assert repr(msg.Point(x=1.0)) == "probe.msg.Point(x=1.0, y=0.0)"
    assert repr(msg.Nothing()) == "probe.msg.Nothing()"
    shown = repr(msg.Bound(numbers=[1, 2], texts=["a'b"]))
    assert shown == 'probe.msg.Bound(numbers=[1, 2], texts=["a\'b"], shorts=[], points=[])'
    assert "a_int8=array([0, 0, 0], dtype=int8)" in repr(msg.Fixed())


@pytest.mark.parametrize("name", ["Scalars", "Fixed", "Loose", "Nested", "Nothing", "Defaults"])
def test_messages_can_be_copied_and_pickled(msg: ModuleType, name: str) -> None:
    values = {"nothing": 0.5} if name == "Defaults" else {}
    original = getattr(msg, name)(**values)
    for made in (copy.copy(original), copy.deepcopy(original), pickle.loads(pickle.dumps(original))):
        assert made == original
        assert made is not original


def test_the_metaclass_has_the_attributes_that_rclpy_uses(msg: ModuleType) -> None:
    metaclass = type(msg.Point)
    assert metaclass.__name__ == "Metaclass_Point"
    for name in "CREATE_ROS_MESSAGE CONVERT_FROM_PY CONVERT_TO_PY DESTROY_ROS_MESSAGE TYPE_SUPPORT".split():
        assert getattr(metaclass, f"_{name}") is None
    metaclass.__import_type_support__()
    assert metaclass._TYPE_SUPPORT is None


def test_docstrings_list_constants(msg: ModuleType) -> None:
    assert msg.Point.__doc__ == "Message class 'Point'."
    names = "YES RAW LETTER LOW HIGH PI NAN INF WORD WIDE"
    assert msg.Constants.__doc__.split() == f"Message class 'Constants'. Constants: {names}".split()


def test_an_empty_message_has_no_fields(msg: ModuleType) -> None:
    assert msg.Nothing.__slots__ == []
    assert msg.Nothing.SLOT_TYPES == ()
    assert msg.Nothing.get_fields_and_field_types() == {}
    # The placeholder beside another member is a field.
    assert list(msg.Hidden.get_fields_and_field_types()) == ["structure_needs_at_least_one_member", "other"]


def test_a_service_is_a_pair_of_messages(probe: Path) -> None:
    assert probe.is_dir()
    service = import_module("probe.srv").Point
    assert service.Request.__name__ == "Point_Request"
    assert (service.Request().a, service.Request.LIMIT) == (5, 3)
    assert repr(service.Response(why="x")) == "probe.srv.Point_Response(why='x', all=[])"
    with pytest.raises(NotImplementedError, match=r"^Service classes can not be instantiated$"):
        service()
    assert type(service)._TYPE_SUPPORT is None
    assert not hasattr(service, "Event")


def test_an_action_has_its_messages_and_services(probe: Path) -> None:
    assert probe.is_dir()
    action = import_module("probe.action").Act
    assert [part.__name__ for part in (action.Goal, action.Result, action.Feedback)] == [
        "Act_Goal",
        "Act_Result",
        "Act_Feedback",
    ]
    impl = action.Impl
    send = impl.SendGoalService.Request(goal=action.Goal())
    assert send.get_fields_and_field_types() == {
        "goal_id": "unique_identifier_msgs/UUID",
        "goal": "probe/Act_Goal",
    }
    assert impl.SendGoalService.Response(accepted=True).accepted is True
    assert impl.GetResultService.Response(status=4).result == action.Result()
    assert impl.FeedbackMessage(feedback=action.Feedback(part=0.5)).feedback.part == 0.5
    assert impl.CancelGoalService.__module__ == "action_msgs.srv._cancel_goal"
    assert impl.GoalStatusMessage.__module__ == "action_msgs.msg._goal_status_array"
    assert pickle.loads(pickle.dumps(send)) == send
    with pytest.raises(NotImplementedError, match=r"^Action classes can not be instantiated$"):
        action()
    type(action).__import_type_support__()
    assert type(action)._TYPE_SUPPORT is None


@pytest.mark.parametrize("case", sorted(path.name for path in (GOLDEN / "interfaces" / "python").iterdir()))
def test_generated_modules_match_the_reviewed_text(case: str, golden: Golden) -> None:
    source = GOLDEN / "interfaces" / "python" / case
    definitions = {
        path.relative_to(source).as_posix(): path.read_text(encoding="utf-8")
        for path in sorted(source.glob("*/*.*"))
        if "expected" not in path.parts
    }
    files = python.files(catalog_of("golden_msgs", definitions))
    golden(f"interfaces/python/{case}", {file.path: file.text for file in files if "__cdr" not in file.path})
