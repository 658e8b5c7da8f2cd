"""Random messages of generated classes, and messages as plain data."""

import sys
from array import array
from importlib import import_module
from typing import Any

import numpy as np
from hypothesis import strategies as st

from tests.generated import INTEGERS

_TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=9)
_SINGLES = st.floats(width=32, allow_nan=False) | st.just(float("inf"))
_DOUBLES = st.floats(allow_nan=False) | st.just(float("-inf"))
_PRIMITIVES: dict[str, st.SearchStrategy[Any]] = {
    "boolean": st.booleans(),
    "octet": st.binary(min_size=1, max_size=1),
    "char": st.characters(max_codepoint=127),
    "wchar": st.characters(max_codepoint=0xFFFF, exclude_categories=["Cs"]),
    "float": _SINGLES,
    "double": _DOUBLES,
    **{name: st.integers(low, high) for name, (low, high) in INTEGERS.items()},
}


def messages(class_: Any) -> st.SearchStrategy[Any]:
    """Return a strategy for messages of a class, by its SLOT_TYPES."""

    @st.composite
    def build(draw: st.DrawFn) -> Any:
        return _message(draw, class_)

    return build()


def _message(draw: st.DrawFn, class_: Any) -> Any:
    slots = zip(class_.__slots__, class_.SLOT_TYPES, strict=True)
    return class_(**{slot[1:]: _value(draw, type_, class_) for slot, type_ in slots})


def _value(draw: st.DrawFn, type_: Any, owner: Any) -> Any:
    word = type(type_).__name__
    if word == "BasicType":
        return draw(_PRIMITIVES[type_.typename])
    if "String" in word:
        return draw(_TEXTS)[: getattr(type_, "maximum_size", None)]
    if word == "NamespacedType":
        return _message(draw, class_of(owner, type_))
    bound = getattr(type_, "maximum_size", 3)
    size = type_.size if word == "Array" else draw(st.integers(0, min(bound, 3)))
    if word == "Array" and size > 3:
        few = [_value(draw, type_.value_type, owner) for _ in range(3)]
        return [few[index % 3] for index in range(size)]
    return [_value(draw, type_.value_type, owner) for _ in range(size)]


def class_of(owner: Any, type_: Any) -> Any:
    """Return the class of a field of `owner`; parts of actions are in the same module."""
    if type_.namespaces[-1] == "action":
        return getattr(sys.modules[owner.__module__], type_.name)
    home = owner.__module__.split(".")[:-3]  # of classes that were created at run time
    return getattr(import_module(".".join((*home, *type_.namespaces))), type_.name)


def plain(value: Any) -> Any:
    """Return a value or a message of any library as dicts, lists, numbers and strings."""
    if isinstance(value, np.ndarray | array):
        return value.tolist()
    if isinstance(value, bytes):
        return list(value) if len(value) != 1 else value[0]
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if hasattr(value, "get_fields_and_field_types"):
        names = [slot[1:] for slot in value.__slots__]
    elif hasattr(value, "__dataclass_fields__"):
        hidden = {"__msgtype__", "structure_needs_at_least_one_member"}
        names = [name for name in value.__dataclass_fields__ if name not in hidden]
    else:
        return value.item() if isinstance(value, np.generic) else value
    return {name: plain(getattr(value, name)) for name in names}
