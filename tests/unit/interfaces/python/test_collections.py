"""Arrays and sequences of generated Python: accepted, converted and rejected values."""

import ctypes
import math
from array import array
from collections import UserList, UserString
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.generated import CODES, refused


@pytest.mark.parametrize(("name", "code"), CODES.items())
def test_fixed_numeric_arrays_are_numpy_arrays(msg: ModuleType, name: str, code: str) -> None:
    value = getattr(msg.Fixed(), f"a_{name}")
    assert isinstance(value, np.ndarray)
    assert (value.dtype, value.shape, value.tolist()) == (np.dtype(name), (3,), [0, 0, 0])
    assert np.dtype(code) == value.dtype


@pytest.mark.parametrize(("name", "code"), CODES.items())
def test_numeric_sequences_are_arrays(msg: ModuleType, name: str, code: str) -> None:
    assert getattr(msg.Loose(), f"a_{name}") == array(code)
    message = msg.Loose(**{f"a_{name}": [1, 2]})
    assert getattr(message, f"a_{name}").typecode == code


def test_other_collections_are_lists(msg: ModuleType) -> None:
    fixed, loose = msg.Fixed(), msg.Loose()
    assert (fixed.flags, fixed.bytes) == ([False] * 2, [b"\0"] * 2)
    assert fixed.texts == fixed.shorts == [""] * 2
    assert fixed.points == [msg.Point(), msg.Point()]
    assert (loose.flags, loose.bytes, loose.texts, loose.shorts, loose.points) == ([], [], [], [], [])


def test_constructors_convert_with_numpy(msg: ModuleType) -> None:
    message = msg.Fixed(a_int8=[1.7, 2, True], a_float32=(1, 2, 3))
    assert message.a_int8.tolist() == [1, 2, 1]
    assert message.a_float32.dtype == np.float32
    with pytest.raises(OverflowError):
        msg.Fixed(a_int8=[1, 2, 300])
    with refused("The 'a_int8' numpy.ndarray() must have a size of 3"):
        msg.Fixed(a_int8=[1, 2])
    with pytest.raises(AssertionError):
        msg.Fixed(a_int8=[[1, 2, 3]])


def test_constructors_convert_to_array(msg: ModuleType) -> None:
    given = array("d", [1.0])
    message = msg.Loose(a_uint8=b"\x01\x02", a_float64=given)
    assert message.a_uint8 == array("B", [1, 2])
    assert message.a_float64 == given
    assert message.a_float64 is not given
    assert msg.Loose(a_float32=[1, 2]).a_float32 == array("f", [1.0, 2.0])
    with pytest.raises(OverflowError):
        msg.Loose(a_uint8=[256])
    with pytest.raises(TypeError):
        msg.Loose(a_uint8=["a"])
    with refused("The 'numbers' array.array() must have a size <= 3"):
        msg.Bound(numbers=[1, 2, 3, 4])


def test_arrays_of_the_right_type_are_stored_without_a_copy(msg: ModuleType) -> None:
    fixed, loose = msg.Fixed(), msg.Loose()
    fixed.a_uint8 = kept = np.arange(3, dtype=np.uint8)
    assert fixed.a_uint8 is kept
    loose.a_uint8 = also_kept = array("B", [1])
    assert loose.a_uint8 is also_kept
    square = np.zeros((3, 1), np.uint8)
    fixed.a_uint8 = square
    assert fixed.a_uint8 is square
    assert fixed != msg.Fixed()


COLLECTIONS_ACCEPTED = [
    ("a_uint8", b"\x01\x02\x03"),
    ("a_uint8", range(3)),
    ("a_uint8", memoryview(b"abc")),
    ("a_uint8", UserList([1, 2, 3])),
    ("a_int16", {1, 2, 3}),
    ("a_int16", (True, False, True)),
    ("a_float64", [1.0, math.nan, math.inf]),
    ("a_float32", [np.float64(1.5), 2.5, -math.inf]),
]


@pytest.mark.parametrize(("name", "value"), COLLECTIONS_ACCEPTED)
def test_assigning_numbers_converts_them_to_an_array(
    msg: ModuleType, name: str, value: Iterable[float]
) -> None:
    for message in (msg.Fixed(), msg.Loose()):
        setattr(message, name, value)
        assert repr(list(map(float, getattr(message, name)))) == repr(list(map(float, value)))


def view_of(values: Any) -> memoryview:
    return memoryview(values)


IMAGE = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
BUFFERS = [
    ("a_uint8", IMAGE),
    ("a_uint8", IMAGE[:, ::2]),
    ("a_uint8", np.asfortranarray(IMAGE)),
    ("a_uint8", np.zeros((0, 3), np.uint8)),
    ("a_uint8", bytearray(b"abc")),
    ("a_uint8", memoryview(b"abcdef")[::2]),
    ("a_uint8", np.array([0, 255])),
    ("a_uint8", np.array([True, False])),
    ("a_int8", np.array([-128, 127], np.int64)),
    ("a_int16", np.array([1, 2], ">i2")),
    ("a_uint64", np.array([2**64 - 1], np.uint64)),
    ("a_int64", np.array([-(2**63)], "long")),
    ("a_float32", np.array([1.5, math.inf, -math.inf], np.float64)),
    ("a_float32", np.array([1.5], np.float16)),
    ("a_float32", np.array([3], np.uint8)),
    ("a_float64", np.array([1.5, math.nan], np.float32)),
    ("a_float64", memoryview(array("d", [2.5]))),
    ("a_uint64", np.array([True, False, True])),
    ("a_int16", view_of(np.array([1, -2, 3], ">i2"))),
    ("a_int8", view_of(np.array([1, -2, 3], ">i8"))),
    ("a_float32", view_of(np.array([1.5], np.float16))),
    ("a_int32", (ctypes.c_int.__ctype_be__ * 3)(1, 2, -3)),
]


@pytest.mark.parametrize(("name", "value"), BUFFERS)
def test_numbers_in_buffers_are_copied_in_c_order(msg: ModuleType, name: str, value: Any) -> None:
    expected = np.asarray(value).ravel().tolist()
    assigned, constructed = msg.Loose(), msg.Loose(**{name: value})
    setattr(assigned, name, value)
    for message in (assigned, constructed):
        found = getattr(message, name)
        assert isinstance(found, array)
        assert repr(list(map(float, found))) == repr(list(map(float, expected)))
    if np.asarray(value).size == 3:
        fixed = msg.Fixed(**{name: np.asarray(value)})
        assert repr(getattr(fixed, name).tolist()) == repr(getattr(assigned, name).tolist())


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("a_uint8", np.array([256])),
        ("a_uint8", np.array([-1])),
        ("a_uint8", np.array([1.0])),
        ("a_int64", np.array([2**63], np.uint64)),
        ("a_float32", np.array([1e39])),
        ("a_float32", np.array([1j])),
        ("a_uint8", view_of(np.array([1, 256], ">i2"))),
        ("a_uint8", view_of(np.array([1.0], np.float16))),
        ("a_uint8", view_of(np.zeros(2, "i1, i2"))),
        ("a_uint16", view_of(np.full((2, 2), -1))),
        ("a_uint8", np.uint8(5)),
        ("a_uint8", np.array(["1"])),
        ("a_uint8", np.array(["2026-01-01"], "datetime64[D]")),
    ],
)
def test_out_of_range_numbers_are_rejected(msg: ModuleType, name: str, value: Any) -> None:
    with pytest.raises(AssertionError, match=f"^The '{name}' field must be a set or sequence and each value"):
        setattr(msg.Loose(), name, value)


def test_arrays_of_a_compatible_type_are_converted(msg: ModuleType) -> None:
    fixed = msg.Fixed()
    fixed.a_uint8 = np.array([1, 2, 3])
    assert (fixed.a_uint8.dtype, fixed.a_uint8.tolist()) == (np.uint8, [1, 2, 3])


@pytest.mark.parametrize("value", [[1.0], iter([1]), "", 5, None, {1: 1.5}, np.zeros(3), [300], ["a"]])
def test_numeric_sequences_reject_other_values(msg: ModuleType, value: object) -> None:
    with refused(
        "The 'a_uint8' field must be a set or sequence and each value of type 'int' "
        "and each unsigned integer in [0, 255]"
    ):
        msg.Loose().a_uint8 = value


def test_arrays_of_another_type_or_size_are_rejected(msg: ModuleType) -> None:
    fixed, loose, bound = msg.Fixed(), msg.Loose(), msg.Bound()
    with refused("The 'a_uint8' numpy.ndarray() must have the dtype of 'numpy.uint8'"):
        fixed.a_uint8 = np.zeros(3)
    with refused("The 'a_uint8' numpy.ndarray() must have a size of 3"):
        fixed.a_uint8 = np.zeros(4, np.uint8)
    with refused("The 'a_uint8' array.array() must have the type code of 'B'"):
        loose.a_uint8 = array("b")
    with refused("The 'numbers' array.array() must have a size <= 3"):
        bound.numbers = array("i", [1, 2, 3, 4])
    with refused(
        "The 'a_uint8' field must be a set or sequence with length 3 and each value of type 'int' "
        "and each unsigned integer in [0, 255]"
    ):
        fixed.a_uint8 = [1, 2]
    with refused(
        "The 'a_float32' field must be a set or sequence and each value of type 'float' "
        "and each float in [-3.402823466e+38, 3.402823466e+38]"
    ):
        loose.a_float32 = [1e39]


LISTS_REFUSED = [
    ("Fixed", "flags", [1, 0], "with length 2 and each value of type 'bool'"),
    ("Fixed", "bytes", [b"a"], "with length 2 and each value of type 'bytes'"),
    ("Fixed", "texts", "ab", "with length 2 and each value of type 'str'"),
    (
        "Fixed",
        "shorts",
        ["a", "long"],
        "with length 2 and each string value not longer than 3 and each value of type 'str'",
    ),
    ("Loose", "texts", UserString("ab"), "and each value of type 'str'"),
    ("Loose", "texts", ["a", 1], "and each value of type 'str'"),
    ("Loose", "points", [None], "and each value of type 'Point'"),
    ("Loose", "flags", np.array([True]), "and each value of type 'bool'"),
    ("Bound", "texts", ["a"] * 4, "with length <= 3 and each value of type 'str'"),
    (
        "Bound",
        "shorts",
        [1],
        "with length <= 2 and each string value not longer than 3 and each value of type 'str'",
    ),
]


@pytest.mark.parametrize(("class_", "name", "value", "words"), LISTS_REFUSED)
def test_lists_reject_wrong_elements_and_lengths(
    msg: ModuleType, class_: str, name: str, value: object, words: str
) -> None:
    message = getattr(msg, class_)()
    with refused(f"The '{name}' field must be a set or sequence{' ' + words}"):
        setattr(message, name, value)
    with pytest.raises(AssertionError):
        getattr(msg, class_)(**{name: value})


@pytest.mark.parametrize("value", [("a", "b"), {"a", "b"}, UserList(["a", "b"]), ["a", "b"]])
def test_lists_are_stored_without_a_copy(msg: ModuleType, value: object) -> None:
    message = msg.Fixed()
    message.texts = value
    assert message.texts is value


@given(value=st.one_of(st.integers(), st.floats(), st.booleans(), st.text(max_size=2), st.none()))
def test_a_rejected_integer_leaves_the_field_unchanged(probe: Path, value: object) -> None:
    assert probe.is_dir()
    message = import_module("probe.msg").Scalars()
    try:
        message.a_uint16 = value
    except AssertionError:
        assert message.a_uint16 == 0
        assert not (isinstance(value, int) and 0 <= value < 2**16)
    else:
        assert message.a_uint16 is value
        assert isinstance(value, int)
        assert 0 <= value < 2**16
