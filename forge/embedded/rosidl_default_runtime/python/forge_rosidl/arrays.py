"""What a fixed-size numeric array accepts; the only part of the run time that needs numpy."""

# ruff: noqa: S101  (assertions, so that python -O turns the checks off and leaves the conversions)

from __future__ import annotations

from typing import Any

import numpy as np

from forge_rosidl import checks

_DTYPES = {**{name: np.dtype(name) for name in checks.NUMBERS if "int" in name}, "float": np.dtype("float32"), "double": np.dtype("float64")}


def zeros(type_name: str, size: int) -> np.ndarray[Any, Any]:
    """Return the array a field holds when nothing was given."""
    return np.zeros(size, _DTYPES[type_name])


def filled(type_name: str, values: tuple[float, ...]) -> np.ndarray[Any, Any]:
    """Return a new array with the values of a default."""
    return np.array(values, _DTYPES[type_name])


def new_array(name: str, value: Any, type_name: str, size: int) -> np.ndarray[Any, Any]:  # noqa: ANN401
    """Return a new array of what a constructor was given, converted by numpy without a look at ranges."""
    made = array(name, np.array(value, _DTYPES[type_name]), type_name, size)
    assert made.shape == (size,), f"The '{name}' numpy.ndarray() must have a shape of ({size},)"
    return made


def array(name: str, value: Any, type_name: str, size: int) -> np.ndarray[Any, Any]:  # noqa: ANN401
    """Accept an ndarray of the right dtype and size as it is, and convert a set or sequence of numbers."""
    dtype = _DTYPES[type_name]
    if isinstance(value, np.ndarray):
        assert value.dtype == dtype, f"The '{name}' numpy.ndarray() must have the dtype of 'numpy.{dtype.name}'"
        assert value.size == size, f"The '{name}' numpy.ndarray() must have a size of {size}"
        return value
    checks.elements(name, value, type_name, size=size)
    return np.array(list(value) if isinstance(value, (set, frozenset)) else value, dtype)
