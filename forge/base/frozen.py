"""`@frozen` is `@dataclass(frozen=True, slots=True)`, but three times as fast to create.

dataclass compiles up to eight small functions per class; for the classes of an up-to-date build this took a
sixth of its time. Here only `__init__` is compiled, when the class gets its first object; all other methods
are shared. `replace`, `fields`, `asdict`, patterns and type checkers see an ordinary dataclass.
"""

from __future__ import annotations

from dataclasses import MISSING, Field, FrozenInstanceError, dataclass, field
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from typing_extensions import dataclass_transform
else:

    def dataclass_transform(**_: object) -> Callable[[Any], Any]:
        """Replace the decorator that only type checkers read."""
        return lambda function: function


_Class = TypeVar("_Class")
_set = object.__setattr__


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def frozen(cls: type[_Class]) -> type[_Class]:
    """Turn a class with annotated fields into an immutable dataclass with slots and value equality.

    Supports defaults, `field(...)` and `__post_init__`. The class must not inherit fields.
    """
    # Without a docstring, dataclass would create one from the signature, which requires inspection.
    cls.__doc__ = cls.__doc__ or cls.__name__
    dataclass_type: Any = dataclass(init=False, repr=False, eq=False, slots=True)(cls)
    own: tuple[Field[Any], ...] = tuple(dataclass_type.__dataclass_fields__.values())
    compared = _reader([f.name for f in own if f.compare])
    hashed = _reader([f.name for f in own if (f.compare if f.hash is None else f.hash)])

    def __init__(self: Any, *arguments: Any, **named: Any) -> None:
        # Half of the classes that a command imports never have an object in it.
        compiled = _initializer(own, calls_post_init=hasattr(dataclass_type, "__post_init__"))
        dataclass_type.__init__ = compiled
        compiled(self, *arguments, **named)

    def __eq__(self: Any, other: object) -> bool:
        return compared(self) == compared(other) if other.__class__ is self.__class__ else NotImplemented

    def __hash__(self: Any) -> int:
        return hash((self.__class__, hashed(self)))

    dataclass_type.__init__ = __init__
    dataclass_type.__eq__, dataclass_type.__hash__ = __eq__, __hash__
    dataclass_type.__repr__ = _representation
    dataclass_type.__setattr__ = dataclass_type.__delattr__ = _refuse
    dataclass_type.__getstate__, dataclass_type.__setstate__ = _state, _restore
    return dataclass_type  # type: ignore[no-any-return]  # (the class itself, with slots)


def _initializer(fields: Sequence[Field[Any]], *, calls_post_init: bool) -> Callable[..., None]:
    names: dict[str, Any] = {"_set": _set, "_missing": MISSING}
    parameters, body = [], []
    for each in fields:
        name = each.name
        parameter, value = name, name
        if each.default is not MISSING:
            names[f"_default_{name}"] = each.default
            parameter = f"{name}=_default_{name}"
        elif each.default_factory is not MISSING:
            names[f"_make_{name}"] = each.default_factory
            parameter = f"{name}=_missing"
            value = f"_make_{name}() if {name} is _missing else {name}"
        parameters.append(parameter)
        body.append(f"_set(self, {name!r}, {value})")
    body += ["self.__post_init__()"] if calls_post_init else []
    lines = [f"def __init__(self, {', '.join(parameters)}):", *(body or ["pass"])]
    exec("\n ".join(lines), names)  # noqa: S102  (as dataclass does; only names of fields are in it)
    initializer: Callable[..., None] = names["__init__"]
    return initializer


def _reader(names: Sequence[str]) -> Callable[[Any], Any]:
    return attrgetter(*names) if names else lambda _: ()


def _representation(self: Any) -> str:
    shown = (f"{name}={getattr(self, name)!r}" for name, f in self.__dataclass_fields__.items() if f.repr)
    return f"{self.__class__.__qualname__}({', '.join(shown)})"


def _refuse(self: object, name: str, _value: object = None) -> NoReturn:
    raise FrozenInstanceError(f"'{name}' of a {self.__class__.__name__} cannot be changed: it is frozen")


def _state(self: Any) -> list[Any]:
    return [getattr(self, name) for name in self.__dataclass_fields__]


def _restore(self: Any, state: list[Any]) -> None:
    for name, value in zip(self.__dataclass_fields__, state, strict=True):
        _set(self, name, value)


Pairs = tuple[tuple[str, str], ...]
"""A hashable mapping from names to values."""
