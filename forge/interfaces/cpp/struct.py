"""The C++ struct of a message: members, constants and constructors."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.interfaces.cpp.text import comment, literal, needs_numeric_limits, spell
from forge.interfaces.model import Array, Named, Primitive, Sequence, String

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from forge.interfaces.model import Field, Message, Type

_CLEARED = "_init == Initialization::ALL || _init == Initialization::ZERO"
_DEFAULTED = "_init == Initialization::ALL || _init == Initialization::DEFAULTS_ONLY"
_ZEROED = "_init == Initialization::ZERO"

_ALLOCATED: dict[type[Type], str] = {Named: "_alloc, _init", String: "_alloc", Sequence: "_alloc"}
"""The constructor arguments of members that take an allocator."""


@frozen
class MemberView:
    """A member."""

    name: str
    type: str
    doc: tuple[str, ...]


@frozen
class ConstantView:
    """The parts of the declaration of a constant."""

    storage: str
    type: str
    name: str
    value: str
    doc: tuple[str, ...]


@frozen
class Block:
    """Statements for some kinds of initialization."""

    condition: str
    statements: tuple[str, ...]


@frozen
class ConstructorView:
    """The member initializers, joined, and the statements of a constructor."""

    initializers: str
    statements: tuple[str, ...]


@frozen
class StructView:
    """The variables of the struct template."""

    name: str
    symbol: str
    doc: tuple[str, ...]
    constants: tuple[ConstantView, ...]
    members: tuple[MemberView, ...]
    settable: tuple[str, ...]
    plain: ConstructorView
    allocating: ConstructorView
    blocks: tuple[Block, ...]
    comparison: str


def struct_view(message: Message) -> StructView:
    members = message.members
    blocks = _blocks(members)
    nested = [f"{f.name}(_init)" for f in members if isinstance(f.type, Named)]
    # Elements of arrays construct their own allocators.
    allocated = [f"{f.name}({_ALLOCATED[type(f.type)]})" for f in members if type(f.type) in _ALLOCATED]
    return StructView(
        name=message.name.name,
        symbol=f"{message.name.package}__{message.name.kind}__{message.name.name}",
        doc=comment(message.doc),
        constants=tuple(
            ConstantView(
                "static inline const" if isinstance(constant.type, String) else "static constexpr",
                spell(constant.type),
                constant.name,
                literal(constant.value, constant.type),
                comment(constant.doc),
            )
            for constant in message.constants
        ),
        members=tuple(MemberView(f.name, spell(f.type), comment(f.doc, f.unit)) for f in members),
        settable=tuple(f.name for f in message.fields),
        plain=_constructor(nested, blocks, takes_init=bool(nested), takes_allocator=True),
        allocating=_constructor(allocated, blocks, takes_init=bool(nested), takes_allocator=bool(allocated)),
        blocks=blocks,
        comparison=" &&\n           ".join(f"{f.name} == _other.{f.name}" for f in members),
    )


def struct_needs_numeric_limits(message: Message) -> bool:
    """Return True if a value of the struct is infinite or NaN."""
    values = [*((f.default, f.type) for f in message.fields), *((c.value, c.type) for c in message.constants)]
    return any(needs_numeric_limits(value, type_) for value, type_ in values)


def _constructor(
    initializers: list[str], blocks: tuple[Block, ...], *, takes_init: bool, takes_allocator: bool
) -> ConstructorView:
    """Return the constructor; it mentions unused parameters once, to avoid compiler warnings."""
    statements = [] if takes_allocator else ["(void)_alloc;"]
    if blocks:
        statements.append("_initialize(_init);")
    elif not takes_init:
        statements.append("(void)_init;")
    return ConstructorView(",\n    ".join(initializers), tuple(statements))


def _blocks(members: Iterable[Field]) -> tuple[Block, ...]:
    """Return the statements that initialize members, by kind of rosidl_runtime_cpp::MessageInitialization."""
    fields = tuple(members)
    blocks = (
        Block(_CLEARED, tuple(s for f in fields if f.default is None for s in _clear(f))),
        Block(_DEFAULTED, tuple(s for f in fields for s in _default(f))),
        Block(_ZEROED, tuple(s for f in fields for s in _zero(f))),
    )
    return tuple(block for block in blocks if block.statements)


def _clear(field: Field) -> Iterator[str]:
    """Yield the assignment of zero; strings and sequences are empty by construction."""
    match field.type:
        case Primitive():
            yield f"{field.name} = {literal(0, field.type)};"
        case Array(Primitive() as of):
            yield f"{field.name}.fill({literal(0, of)});"


def _default(field: Field) -> Iterator[str]:
    if field.default not in (None, (), ""):
        yield f"{field.name} = {literal(field.default, field.type)};"


def _zero(field: Field) -> Iterator[str]:
    """Yield the statements for ZERO, which ignores defaults, including those of array elements."""
    if field.default is not None:
        yield from _clear(field)
    elif isinstance(field.type, Array) and isinstance(field.type.of, Named):
        yield f"{field.name}.fill(typename _{field.name}_type::value_type(_init));"
