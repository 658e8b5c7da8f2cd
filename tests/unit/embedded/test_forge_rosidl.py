"""The C type support of generated classes, as client libraries find it."""

import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

from tests.generated import catalog_of, generate, importable


class Extension(ModuleType):
    """A C extension that has everything; each entry is its own name."""

    def __getattr__(self, name: str) -> str:
        return name


@pytest.fixture(autouse=True)
def _extension(monkeypatch: pytest.MonkeyPatch) -> None:
    name = "probe.probe_s__rosidl_typesupport_c"
    monkeypatch.setitem(sys.modules, name, Extension(name))


def test_a_message_and_its_parts_have_type_supports(msg: ModuleType) -> None:
    metaclass = type(msg.Nested)
    metaclass.__import_type_support__()
    entries = (
        "_CREATE_ROS_MESSAGE",
        "_CONVERT_FROM_PY",
        "_CONVERT_TO_PY",
        "_DESTROY_ROS_MESSAGE",
        "_TYPE_SUPPORT",
    )
    assert [getattr(metaclass, entry) for entry in entries] == [
        "create_ros_message_msg__msg__nested",
        "convert_from_py_msg__msg__nested",
        "convert_to_py_msg__msg__nested",
        "destroy_ros_message_msg__msg__nested",
        "type_support_msg__msg__nested",
    ]
    assert _type_support(msg.Point) == "type_support_msg__msg__point"
    assert _type_support(import_module("std_msgs.msg").Header) is None


def test_a_service_its_request_and_its_response_have_type_supports(msg: ModuleType) -> None:
    assert msg
    service = import_module("probe.srv").Point
    type(service).__import_type_support__()
    assert _type_support(service) == "type_support_srv__srv__point"
    assert _type_support(service.Request) == "type_support_msg__srv__point__request"


def test_an_action_and_its_parts_have_type_supports(msg: ModuleType) -> None:
    assert msg
    action = import_module("probe.action").Act
    type(action).__import_type_support__()
    assert _type_support(action) == "type_support_action__action__act"
    assert _type_support(action.Goal) == "type_support_msg__action__act__goal"
    assert _type_support(action.Impl.SendGoalService) == "type_support_srv__action__act__send_goal"
    assert _type_support(action.Impl.FeedbackMessage) == "type_support_msg__action__act__feedback_message"


def _type_support(class_: type) -> object:
    return type(class_)._TYPE_SUPPORT  # type: ignore[attr-defined]


def test_a_class_with_the_same_name_is_not_mistaken_for_a_part(tmp_path: Path) -> None:
    """walk/msg/Point has a field of geometry_msgs/Point, and is what its own module calls Point."""
    generate(tmp_path, catalog_of("walk", {"msg/Point.msg": "geometry_msgs/Point at\n"}))
    with importable(tmp_path):
        messages = import_module("forge_rosidl.messages")
        found = messages._nested_messages(import_module("walk.msg").Point)
        assert found == [import_module("geometry_msgs.msg").Point]
