from array import array as _array
from collections.abc import Sequence as _Sequence
from collections.abc import Set as _Set
from typing import Final as _Final

import numpy as _numpy
from numpy.typing import NDArray as _NDArray

from forge_rosidl import messages as _messages
from std_msgs.msg._header import Header

class Metaclass_Reading(_messages.MessageType): ...

class Reading(_messages.Message, metaclass=Metaclass_Reading):
    """One reading of a thermometer."""
    KIND_AIR: _Final[int]
    UNIT: _Final[str]
    KIND__DEFAULT: _Final[int]
    TAGS__DEFAULT: _Final[list[str]]
    def __init__(
        self,
        *,
        header: Header = ...,
        kind: int = ...,
        value: float = ...,
        covariance: _NDArray[_numpy.float64] | _Sequence[float] | _Set[float] = ...,
        history: _Sequence[float] | _Set[float] = ...,
        tags: _Sequence[str] | _Set[str] = ...,
        check_fields: object = ...,
    ) -> None: ...
    @property
    def header(self) -> Header: ...
    @header.setter
    def header(self, value: Header) -> None: ...
    @property
    def kind(self) -> int: ...
    @kind.setter
    def kind(self, value: int) -> None: ...
    @property
    def value(self) -> float:
        """in degrees"""
    @value.setter
    def value(self, value: float) -> None: ...
    @property
    def covariance(self) -> _NDArray[_numpy.float64]: ...
    @covariance.setter
    def covariance(self, value: _NDArray[_numpy.float64] | _Sequence[float] | _Set[float]) -> None: ...
    @property
    def history(self) -> _array[float]: ...
    @history.setter
    def history(self, value: _Sequence[float] | _Set[float]) -> None: ...
    @property
    def tags(self) -> list[str]: ...
    @tags.setter
    def tags(self, value: _Sequence[str] | _Set[str]) -> None: ...
