"""Messages as dictionaries, YAML and CSV, and fields from dictionaries."""

from array import array
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import yaml


@pytest.fixture
def runtime(probe: Path) -> ModuleType:
    assert probe.is_dir()
    return import_module("rosidl_runtime_py")


@pytest.fixture
def names(probe: Path) -> ModuleType:
    assert probe.is_dir()
    return import_module("rosidl_runtime_py.utilities")


def test_a_dictionary_holds_plain_values_in_the_order_of_the_fields(
    msg: ModuleType, runtime: ModuleType
) -> None:
    message = msg.Defaults(brief="x")
    fields = runtime.message_to_ordereddict(message)
    assert list(fields) == list(message.get_fields_and_field_types())
    assert (fields["flag"], fields["raw"], fields["wide"]) == (True, "\xff", "Hellö")
    assert (fields["some"], fields["pair"], fields["letters"]) == ([1, 2], [1.0, 2.0], [0, 1, 127])
    assert fields["bytes"] == ["\0", "\xff"]
    assert {type(value) for value in fields["pair"]} == {float}


def test_nested_messages_become_dictionaries(msg: ModuleType, runtime: ModuleType) -> None:
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    assert runtime.message_to_ordereddict(msg.Nested()) == {"header": header, "point": {"x": 0.0, "y": 0.0}}
    message = msg.Loose(points=(msg.Point(x=1.0),))
    assert runtime.message_to_ordereddict(message)["points"] == ({"x": 1.0, "y": 0.0},)


def test_numpy_numbers_become_python_numbers(msg: ModuleType, runtime: ModuleType) -> None:
    value = runtime.message_to_ordereddict(msg.Point(x=np.float64(1.5)))["x"]
    assert type(value) is float


def test_long_values_are_truncated_at_every_level(msg: ModuleType, runtime: ModuleType) -> None:
    message = msg.Loose(a_int8=[1, 2, 3], texts=["abcd", "e", "f"], bytes=[b"xyz"])
    fields = runtime.message_to_ordereddict(message, truncate_length=2)
    assert fields["a_int8"] == [1, 2, "..."]
    assert fields["texts"] == ["ab...", "e", "..."]
    assert fields["bytes"] == ["xy..."]


def test_collections_and_strings_can_be_summarized(msg: ModuleType, runtime: ModuleType) -> None:
    fields = runtime.message_to_ordereddict(msg.Fixed(), no_arr=True)
    assert (fields["a_int8"], fields["texts"]) == ("<array type: int8[3]>", "<array type: string[2]>")
    assert fields["points"] == "<array type: probe/msg/Point[2]>"
    fields = runtime.message_to_ordereddict(msg.Bound(numbers=[1]), no_arr=True)
    assert fields["numbers"] == "<sequence type: int32[3], length: 1>"
    fields = runtime.message_to_ordereddict(msg.Loose(texts=["a"]), no_arr=True)
    assert fields["texts"] == "<sequence type: string, length: 1>"
    fields = runtime.message_to_ordereddict(msg.Scalars(text="abc"), no_str=True)
    assert (fields["text"], fields["wide"]) == ("<string length: <3>>", "<string length: <0>>")


def test_yaml_uses_block_style_in_field_order(msg: ModuleType, runtime: ModuleType) -> None:
    message = msg.Bound(numbers=[1, 2], texts=["é"], points=[msg.Point()])
    expected = "numbers:\n- 1\n- 2\ntexts:\n- é\nshorts: []\npoints:\n- x: 0.0\n  y: 0.0\n"
    assert runtime.message_to_yaml(message) == expected
    assert runtime.message_to_yaml(msg.Nothing()) == "{}\n"
    assert (
        runtime.message_to_yaml(msg.Scalars(text="long " * 99)).splitlines()[3] == f"text: '{'long ' * 99}'"
    )


def test_flow_style_puts_lists_on_one_line(msg: ModuleType, runtime: ModuleType) -> None:
    message = msg.Bound(numbers=[1, 2], points=[msg.Point()])
    expected = "numbers: [1, 2]\ntexts: []\nshorts: []\npoints: [{x: 0.0, y: 0.0}]\n"
    assert runtime.message_to_yaml(message, flow_style=True) == expected


def test_yaml_does_not_modify_other_dumpers(msg: ModuleType, runtime: ModuleType) -> None:
    from collections import OrderedDict

    before = yaml.dump(OrderedDict(a=1))
    runtime.message_to_yaml(msg.Point())
    assert yaml.dump(OrderedDict(a=1)) == before


def test_csv_joins_values_without_quotes(msg: ModuleType, runtime: ModuleType) -> None:
    assert runtime.message_to_csv(msg.Point(x=1.5)) == "1.5,0.0"
    assert runtime.message_to_csv(msg.Nested()) == "0,0,,0.0,0.0"
    assert runtime.message_to_csv(msg.Scalars()).startswith("False,b'\\x00',0,,,,0.0,0.0,0")
    assert runtime.message_to_csv(msg.Bound(numbers=[1, 2], points=[msg.Point()])) == "1,2,,,0.0,0.0"


def test_csv_has_no_leading_separator(msg: ModuleType, runtime: ModuleType) -> None:
    assert runtime.message_to_csv(msg.Bound(texts=["a"])) == "a,,"


def test_csv_can_be_truncated(msg: ModuleType, runtime: ModuleType) -> None:
    message = msg.Loose(a_int8=[1, 2, 3], texts=["abcd"], bytes=[b"xyz"])
    text = runtime.message_to_csv(message, truncate_length=2)
    assert text.startswith("1,2,...,")
    assert "ab..." in text
    assert "b'xy...'" in text
    assert "<sequence type: int8, length: 3>" in runtime.message_to_csv(message, no_arr=True)
    assert runtime.message_to_csv(msg.Bound(texts=["abc"]), no_str=True) == "<string length: <3>>,,"


def test_slot_types_are_found_by_name(msg: ModuleType, runtime: ModuleType) -> None:
    assert list(runtime.get_message_slot_types(msg.Point()).items()) == list(
        zip(["x", "y"], msg.Point.SLOT_TYPES, strict=True)
    )


def test_handwritten_classes_need_only_slots(runtime: ModuleType) -> None:
    class ByHand:
        __slots__ = ("_speed",)
        SLOT_TYPES = ("double",)

    assert dict(runtime.get_message_slot_types(ByHand())) == {"speed": "double"}


def test_single_values_are_converted_keeping_dictionary_keys(runtime: ModuleType) -> None:
    convert = import_module("rosidl_runtime_py.convert")._convert_value
    assert convert({1: "abc", "key": b"abc"}, truncate_length=1) == {1: "a...", "key": "a..."}
    assert runtime.convert._convert_value((1, 2), truncate_length=1) == (1, "...")


# From dictionaries to fields


VALUES = [
    ("a_int8", "5", 5),
    ("a_int8", 5.7, 5),
    ("exact", 1, 1.0),
    ("exact", "1e3", 1000.0),
    ("text", 5, "5"),
    ("flag", 1, True),
    ("octet", b"a", b"a"),
    ("octet", 10, b"\n"),
    ("octet", "\xff", b"\xff"),
]


@pytest.mark.parametrize(("name", "value", "expected"), VALUES)
def test_values_are_converted_to_the_field_type(
    msg: ModuleType, runtime: ModuleType, name: str, value: object, expected: object
) -> None:
    message = msg.Scalars()
    assert runtime.set_message_fields(message, {name: value}) == []
    assert getattr(message, name) == expected
    assert type(getattr(message, name)) is type(expected)


def test_collections_are_converted_to_the_field_type(msg: ModuleType, runtime: ModuleType) -> None:
    fixed, loose = msg.Fixed(), msg.Loose()
    values = {
        "a_int8": [1, 2, 3],
        "bytes": ["\0", 255],
        "points": [{"x": 1}, {"y": "2"}],
        "texts": ("a", "b"),
    }
    for message in (fixed, loose):
        runtime.set_message_fields(message, values)
        assert message.bytes == [b"\0", b"\xff"]
        assert message.points == [msg.Point(x=1.0), msg.Point(y=2.0)]
        assert message.texts == ["a", "b"]
    assert (fixed.a_int8.dtype, fixed.a_int8.tolist()) == (np.int8, [1, 2, 3])
    assert loose.a_int8 == array("b", [1, 2, 3])


def test_nested_messages_are_replaced(msg: ModuleType, runtime: ModuleType) -> None:
    message = msg.Nested(point=msg.Point(x=1.0))
    runtime.set_message_fields(message, {"point": {"y": 2}, "header": {"stamp": {"sec": 3}, "frame_id": 7}})
    assert message.point == msg.Point(y=2.0)
    assert (message.header.stamp.sec, message.header.frame_id) == (3, "7")
    given = msg.Point(x=5.0)
    runtime.set_message_fields(message, {"point": given})
    assert message.point == given
    assert message.point is not given


def test_the_given_values_are_not_modified(msg: ModuleType, runtime: ModuleType) -> None:
    values = {"points": [{"x": 1}], "texts": ["a"]}
    message = msg.Loose()
    runtime.set_message_fields(message, values)
    message.texts.append("b")
    assert values == {"points": [{"x": 1}], "texts": ["a"]}


def test_numpy_numbers_in_fields_are_replaced(msg: ModuleType, runtime: ModuleType) -> None:
    message = msg.Point(x=np.float64(1))
    runtime.set_message_fields(message, {"x": 2})
    assert message.x == 2.0


MISTAKES = [
    ({"other": 1}, AttributeError, "other"),
    ({"LOW": 1}, KeyError, "LOW"),
    (5, TypeError, "Value '5' is expected to be a dictionary but is a int"),
]


@pytest.mark.parametrize(("values", "error", "words"), MISTAKES)
def test_invalid_fields_are_reported(
    msg: ModuleType, runtime: ModuleType, values: object, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        runtime.set_message_fields(msg.Constants(), values)


def test_a_message_needs_a_dictionary(msg: ModuleType, runtime: ModuleType) -> None:
    for message, values in ((msg.Nested(), {"point": 5}), (msg.Loose(), {"points": [5]})):
        with pytest.raises(TypeError, match="Value '5' is expected to be a dictionary but is a int"):
            runtime.set_message_fields(message, values)


def test_auto_and_now_fill_in_times(msg: ModuleType, runtime: ModuleType) -> None:
    time = import_module("builtin_interfaces.msg").Time
    message = msg.Nested()
    (set_stamp,) = runtime.set_message_fields(message, {"header": "auto"}, expand_header_auto=True)
    set_stamp(time(sec=5))
    assert message.header.stamp.sec == 5
    values = {"header": {"stamp": "now", "frame_id": "map"}}
    (set_now,) = runtime.set_message_fields(message, values, expand_time_now=True)
    set_now(time(sec=6))
    assert (message.header.stamp.sec, message.header.frame_id) == (6, "map")
    with pytest.raises(TypeError):
        runtime.set_message_fields(message, {"header": "auto"})


def test_yaml_round_trips(msg: ModuleType, runtime: ModuleType) -> None:
    message = msg.Fixed(
        a_int8=[1, 2, 3], texts=["a", "é"], points=[msg.Point(x=1.0), msg.Point()], bytes=[b"a", b"\0"]
    )
    again = msg.Fixed()
    runtime.set_message_fields(again, yaml.safe_load(runtime.message_to_yaml(message)))
    assert again == message


# Classes by name


@pytest.mark.parametrize("name", ["probe/msg/Point", "probe/Point"])
def test_a_message_is_found_by_name(msg: ModuleType, names: ModuleType, name: str) -> None:
    assert names.get_message(name) is msg.Point


def test_services_and_actions_are_found_by_name(names: ModuleType) -> None:
    service, action = import_module("probe.srv").Point, import_module("probe.action").Act
    assert names.get_service("probe/Point") is names.get_interface("probe/srv/Point") is service
    assert names.get_action("probe/Act") is names.get_action("probe/action/Act") is action


NAMED = [
    ("get_namespaced_type", "probe/srv/Point", ["probe", "srv"]),
    ("get_message_namespaced_type", "probe/Point", ["probe", "msg"]),
    ("get_message_namespaced_type", "probe/msg/Point", ["probe", "msg"]),
    ("get_service_namespaced_type", "probe/Point", ["probe", "srv"]),
    ("get_action_namespaced_type", "probe/Point", ["probe", "action"]),
]


@pytest.mark.parametrize(("function", "name", "namespaces"), NAMED)
def test_type_names_are_resolved(names: ModuleType, function: str, name: str, namespaces: list[str]) -> None:
    type_ = getattr(names, function)(name)
    assert (type_.namespaces, type_.name) == (namespaces, "Point")


def test_the_element_class_of_collections_is_deprecated(msg: ModuleType, runtime: ModuleType) -> None:
    points = msg.Loose.SLOT_TYPES[-1]
    with pytest.warns(DeprecationWarning, match="value_type"):
        assert runtime.import_message_from_namespaced_type(points) is msg.Point


PARTS = [
    ("probe/srv/Point_Request", "Point_Request"),
    ("probe/action/Act_Goal", "Act_Goal"),
    ("probe/action/Act_FeedbackMessage", "Act_FeedbackMessage"),
    ("probe/action/Act_SendGoal_Request", "Act_SendGoal_Request"),
    ("probe/action/Act_GetResult_Response", "Act_GetResult_Response"),
]


@pytest.mark.parametrize(("name", "class_name"), PARTS)
def test_the_parts_of_services_and_actions_are_messages(
    names: ModuleType, name: str, class_name: str
) -> None:
    assert names.get_message(name).__name__ == class_name


def test_a_missing_type_is_an_import_error(names: ModuleType) -> None:
    with pytest.raises(ModuleNotFoundError):
        names.get_message("nowhere/msg/Point")
    with pytest.raises(AttributeError):
        names.get_message("probe/msg/Nowhere")


WRONG_KINDS = [
    ("get_message", "probe/srv/Point", "a message"),
    ("get_message", "Point", "a message"),
    ("get_service", "probe/msg/Point", "a service"),
    ("get_action", "probe/srv/Point", "an action"),
    ("get_interface", "probe/Point", "an interface"),
    ("get_interface", "probe//Point", "an interface"),
]


@pytest.mark.parametrize(("function", "name", "what"), WRONG_KINDS)
def test_a_name_of_another_kind_is_rejected(names: ModuleType, function: str, name: str, what: str) -> None:
    with pytest.raises(ValueError, match=f"^Expected the full name of {what}, got '{name}'$"):
        getattr(names, function)(name)
