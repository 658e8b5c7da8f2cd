"""Objects that describe the type of a field, as found in a message's `SLOT_TYPES`.

    AbstractType
      AbstractNestableType      possible elements of collections
        BasicType               int8 ... uint64, float, double, boolean, octet, char, wchar
        NamedType               a type by its bare name
        NamespacedType          a message
        AbstractGenericString
          AbstractString        BoundedString, UnboundedString
          AbstractWString       BoundedWString, UnboundedWString
      AbstractNestedType        a collection
        Array
        AbstractSequence        BoundedSequence, UnboundedSequence

Descriptions of the same type are equal.
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
BOOLEAN_TYPE: Final = "boolean"
OCTET_TYPE: Final = "octet"
BASIC_TYPES: Final = (*INTEGER_TYPES, *FLOATING_POINT_TYPES, *CHARACTER_TYPES, BOOLEAN_TYPE, OCTET_TYPE)


class AbstractType:
    """The base class of all descriptions of types."""

    __slots__: tuple[str, ...] = ()

    def __eq__(self, other: object) -> bool:
        """Return True if the other describes the same type."""
        return (
            isinstance(other, AbstractType) and type(self) is type(other) and self._parts() == other._parts()
        )

    def __hash__(self) -> int:
        """Return a hash; it is equal for equal types."""
        return hash((type(self), self._parts()))

    def __repr__(self) -> str:
        """Return the expression that creates this description."""
        return f"{type(self).__name__}({', '.join(map(repr, self._parts()))})"

    def _parts(self) -> tuple[object, ...]:
        return tuple(
            getattr(self, slot) for class_ in reversed(type(self).__mro__) for slot in _slots_of(class_)
        )


class AbstractNestableType(AbstractType):
    """A type of the elements of a collection."""

    __slots__ = ()


class BasicType(AbstractNestableType):
    """A primitive type, by its IDL name."""

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
    """A message, by its namespaces and its name."""

    __slots__ = ("name", "namespaces")

    def __init__(self, namespaces: Iterable[str], name: str) -> None:
        """Describe the message `name`; `namespaces` are its package and kind."""
        self.namespaces = list(namespaces)
        self.name = name

    def __repr__(self) -> str:
        """Return the expression that creates this description."""
        return f"NamespacedType({self.namespaces!r}, {self.name!r})"

    def _parts(self) -> tuple[object, ...]:
        return self.namespaced_name()  # hashable, unlike the list

    def namespaced_name(self) -> tuple[str, ...]:
        """Return package, kind and name."""
        return (*self.namespaces, self.name)


class AbstractGenericString(AbstractNestableType):
    """The base class of strings."""

    __slots__ = ()

    def has_maximum_size(self) -> bool:
        """Return True if the length is bounded."""
        return False


class AbstractString(AbstractGenericString):
    """A string, serialized as UTF-8."""

    __slots__ = ()


class BoundedString(AbstractString):
    """A string of at most `maximum_size` characters."""

    __slots__ = ("maximum_size",)

    def __init__(self, maximum_size: int) -> None:
        """Describe the string."""
        self.maximum_size = maximum_size

    def has_maximum_size(self) -> bool:
        """Return True."""
        return True


class UnboundedString(AbstractString):
    """An unbounded string."""

    __slots__ = ()


class AbstractWString(AbstractGenericString):
    """A wide string, serialized as UTF-16 code units."""

    __slots__ = ()


class BoundedWString(AbstractWString):
    """A wide string of at most `maximum_size` characters."""

    __slots__ = ("maximum_size",)

    def __init__(self, maximum_size: int) -> None:
        """Describe the string."""
        self.maximum_size = maximum_size

    def has_maximum_size(self) -> bool:
        """Return True."""
        return True


class UnboundedWString(AbstractWString):
    """An unbounded wide string."""

    __slots__ = ()


class AbstractNestedType(AbstractType):
    """A collection of `value_type`."""

    __slots__ = ("value_type",)

    def __init__(self, value_type: AbstractNestableType) -> None:
        """Describe a collection."""
        self.value_type = value_type

    def has_maximum_size(self) -> bool:
        """Return True if the number of elements is bounded."""
        return True


class Array(AbstractNestedType):
    """A collection of exactly `size` elements."""

    __slots__ = ("size",)

    def __init__(self, value_type: AbstractNestableType, size: int) -> None:
        """Describe the array."""
        super().__init__(value_type)
        self.size = size


class AbstractSequence(AbstractNestedType):
    """A sequence."""

    __slots__ = ()


class BoundedSequence(AbstractSequence):
    """A sequence of at most `maximum_size` elements."""

    __slots__ = ("maximum_size",)

    def __init__(self, value_type: AbstractNestableType, maximum_size: int) -> None:
        """Describe the sequence."""
        super().__init__(value_type)
        self.maximum_size = maximum_size


class UnboundedSequence(AbstractSequence):
    """An unbounded sequence."""

    __slots__ = ()

    def has_maximum_size(self) -> bool:
        """Return False."""
        return False


def _slots_of(class_: type) -> tuple[str, ...]:
    return tuple(class_.__dict__.get("__slots__", ()))
