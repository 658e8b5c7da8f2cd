"""Objects that describe the type of a field, as found in a message's `SLOT_TYPES`.

    AbstractType
      AbstractNestableType      what a collection may hold
        BasicType               int8 ... uint64, float, double, boolean, octet, char, wchar
        NamedType               a type by its bare name
        NamespacedType          another message
        AbstractGenericString
          AbstractString        BoundedString, UnboundedString
          AbstractWString       BoundedWString, UnboundedWString
      AbstractNestedType        a collection
        Array
        AbstractSequence        BoundedSequence, UnboundedSequence

Two descriptions are equal when they say the same.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Iterable

SIGNED_NONEXPLICIT_INTEGER_TYPES: Final = ("short", "long", "long long")
UNSIGNED_NONEXPLICIT_INTEGER_TYPES: Final = ("unsigned short", "unsigned long", "unsigned long long")
SIGNED_EXPLICIT_INTEGER_TYPES: Final = ("int8", "int16", "int32", "int64")
UNSIGNED_EXPLICIT_INTEGER_TYPES: Final = ("uint8", "uint16", "uint32", "uint64")
SIGNED_INTEGER_TYPES: Final = SIGNED_NONEXPLICIT_INTEGER_TYPES + SIGNED_EXPLICIT_INTEGER_TYPES
UNSIGNED_INTEGER_TYPES: Final = UNSIGNED_NONEXPLICIT_INTEGER_TYPES + UNSIGNED_EXPLICIT_INTEGER_TYPES
INTEGER_TYPES: Final = SIGNED_INTEGER_TYPES + UNSIGNED_INTEGER_TYPES
FLOATING_POINT_TYPES: Final = ("float", "double", "long double")
CHARACTER_TYPES: Final = ("char", "wchar")
BOOLEAN_TYPE: Final = ("boolean",)
OCTET_TYPE: Final = ("octet",)
BASIC_TYPES: Final = INTEGER_TYPES + FLOATING_POINT_TYPES + CHARACTER_TYPES + BOOLEAN_TYPE + OCTET_TYPE


class AbstractType:
    """What every description of a type is."""

    __slots__: tuple[str, ...] = ()

    def __eq__(self, other: object) -> bool:
        """Tell if the other describes the same type."""
        return (
            isinstance(other, AbstractType) and type(self) is type(other) and self._parts() == other._parts()
        )

    def __hash__(self) -> int:
        """Return the same number for the same type."""
        return hash((type(self), self._parts()))

    def __repr__(self) -> str:
        """Return the expression that makes this description."""
        return f"{type(self).__name__}({', '.join(map(repr, self._parts()))})"

    def _parts(self) -> tuple[object, ...]:
        return tuple(
            getattr(self, slot) for class_ in reversed(type(self).__mro__) for slot in _slots_of(class_)
        )


class AbstractNestableType(AbstractType):
    """A type that a collection may hold."""

    __slots__ = ()


class BasicType(AbstractNestableType):
    """A type of the language, by its IDL name."""

    __slots__ = ("typename",)

    def __init__(self, typename: str) -> None:
        """Describe the type of that name."""
        self.typename = typename


class NamedType(AbstractNestableType):
    """A type known by its bare name."""

    __slots__ = ("name",)

    def __init__(self, name: str) -> None:
        """Describe the type of that name."""
        self.name = name


class NamespacedType(AbstractNestableType):
    """Another message, by the modules it lives in and its name."""

    __slots__ = ("name", "namespaces")

    def __init__(self, namespaces: Iterable[str], name: str) -> None:
        """Describe the message `name` in the package and kind that `namespaces` spell."""
        self.namespaces = tuple(namespaces)
        self.name = name

    def __repr__(self) -> str:
        """Return the expression that makes this description."""
        return f"NamespacedType({list(self.namespaces)!r}, {self.name!r})"

    def namespaced_name(self) -> tuple[str, ...]:
        """Return package, kind and name."""
        return (*self.namespaces, self.name)


class AbstractGenericString(AbstractNestableType):
    """Any text."""

    __slots__ = ()

    def has_maximum_size(self) -> bool:
        """Tell if the length of the text is bounded."""
        return False


class AbstractString(AbstractGenericString):
    """Text whose characters are bytes on the wire."""

    __slots__ = ()


class BoundedString(AbstractString):
    """Text of at most `maximum_size` characters."""

    __slots__ = ("maximum_size",)

    def __init__(self, maximum_size: int) -> None:
        """Describe the text."""
        self.maximum_size = maximum_size

    def has_maximum_size(self) -> bool:
        """Tell that the length is bounded."""
        return True


class UnboundedString(AbstractString):
    """Text of any length."""

    __slots__ = ()


class AbstractWString(AbstractGenericString):
    """Text whose characters are UTF-16 units on the wire."""

    __slots__ = ()


class BoundedWString(AbstractWString):
    """Wide text of at most `maximum_size` characters."""

    __slots__ = ("maximum_size",)

    def __init__(self, maximum_size: int) -> None:
        """Describe the text."""
        self.maximum_size = maximum_size

    def has_maximum_size(self) -> bool:
        """Tell that the length is bounded."""
        return True


class UnboundedWString(AbstractWString):
    """Wide text of any length."""

    __slots__ = ()


class AbstractNestedType(AbstractType):
    """A collection of `value_type`."""

    __slots__ = ("value_type",)

    def __init__(self, value_type: AbstractNestableType) -> None:
        """Describe a collection."""
        self.value_type = value_type

    def has_maximum_size(self) -> bool:
        """Tell if the number of elements is bounded."""
        return True


class Array(AbstractNestedType):
    """A collection of exactly `size` elements."""

    __slots__ = ("size",)

    def __init__(self, value_type: AbstractNestableType, size: int) -> None:
        """Describe the array."""
        super().__init__(value_type)
        self.size = size


class AbstractSequence(AbstractNestedType):
    """A collection of some elements."""

    __slots__ = ()


class BoundedSequence(AbstractSequence):
    """A collection of at most `maximum_size` elements."""

    __slots__ = ("maximum_size",)

    def __init__(self, value_type: AbstractNestableType, maximum_size: int) -> None:
        """Describe the sequence."""
        super().__init__(value_type)
        self.maximum_size = maximum_size


class UnboundedSequence(AbstractSequence):
    """A collection of any number of elements."""

    __slots__ = ()

    def has_maximum_size(self) -> bool:
        """Tell that there is no bound."""
        return False


def _slots_of(class_: type) -> tuple[str, ...]:
    return tuple(class_.__dict__.get("__slots__", ()))
