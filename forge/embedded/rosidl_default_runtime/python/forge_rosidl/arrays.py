"""Checks for fixed-size numeric arrays; the only part of the run time that needs numpy."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from forge_rosidl import checks

_DTYPES: Final = {
    **{name: np.dtype(name) for name in checks.NUMBERS if "int" in name},
    "float": np.dtype("float32"),
    "double": np.dtype("float64"),
}


def new_array(name: str, value: Any, type_name: str, size: int) -> np.ndarray[Any, Any]:
    """Return a new array for an argument of a constructor, converted by numpy without range checks."""
    made = array(name, np.array(value, _DTYPES[type_name]), type_name, size)
    assert made.shape == (size,), f"The '{name}' numpy.ndarray() must have a shape of ({size},)"
    return made


def array(name: str, value: Any, type_name: str, size: int) -> np.ndarray[Any, Any]:
    """Return an ndarray of the right dtype and size unchanged, and convert other numbers that fit."""
    dtype = _DTYPES[type_name]
    if isinstance(value, np.ndarray):
        assert value.size == size, f"The '{name}' numpy.ndarray() must have a size of {size}"
        if value.dtype == dtype:
            return value
        wanted, copied = f"numpy.{dtype.name}", checks.copy_of(value, type_name)
        assert copied is not None, f"The '{name}' numpy.ndarray() must have the dtype of '{wanted}'"
    else:
        checks.elements(name, value, type_name, size=size)
        copied = checks.copy_of(value, type_name)
    if copied is None:  # numpy would cut off fractions under -O, which removes the checks
        copied = checks.array(checks.NUMBERS[type_name].code, list(value))
    return np.array(copied, dtype)
