"""A message's layout to the Python function that writes it.

The function gathers pieces of bytes and joins them once: a Struct's result for what stands side by
side, arrays as they are. Where padding depends on lengths, it carries `o`, the offset; alignment
only asks for its remainder, so wherever that is known again `o` is set to it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from forge.interfaces.model import Array, Primitive, Sequence, String
from forge.interfaces.python.cdr_text import (
    HEADER_SIZE,
    FunctionSource,
    PackedGroup,
    group_steps,
    singular,
    struct_format,
    wrap_arguments,
)
from forge.interfaces.wire.layout import (
    MAX_ALIGNMENT,
    SIZES,
    InlineArray,
    Length,
    Loop,
    MessageCall,
    Phase,
    PrimitiveElements,
    Run,
    Scalar,
    StringData,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from forge.interfaces.model import TypeName
    from forge.interfaces.python.cdr_text import Group
    from forge.interfaces.wire.layout import Member, MessageLayout, Path

_READABLE = 60
"""Longer calls get a line of their own."""

_CONVERSIONS = {"boolean": "to_flags", "octet": "to_octets", "char": "to_chars", "wchar": "to_wchars"}


def emit_writer(lines: FunctionSource, layout: MessageLayout, shared: Callable[[TypeName], str]) -> None:
    """Add the lines of a function that returns a message's bytes; `shared` names the writers of others."""
    gathered = group_steps(layout.steps)
    writer = _Writer(lines, "message", shared)
    if not (isinstance(gathered[0], PackedGroup) and gathered[0].before):
        writer.pieces.append("_HEADER_BYTES")
    writer.sole = not writer.pieces and len(gathered) == 1
    writer.write(gathered, layout.end, tail=False)
    writer.finish()


def emit_part_writer(lines: FunctionSource, layout: MessageLayout, shared: Callable[[TypeName], str]) -> None:
    """Add the lines of a function that appends a message's pieces and returns the offset behind it."""
    writer = _Writer(lines, "message", shared, appending=True)
    writer.write(group_steps(layout.steps), Phase(1, 0), tail=True)
    lines.add("return o")


def _needs(gathered: tuple[Group, ...], end: Phase, *, tail: bool) -> list[bool]:
    """Tell for each unit, and for what follows the last, if `o` must be right where it begins."""
    needs = [tail]
    after = end
    for unit in reversed(gathered):
        needs.append(_is_dynamic(unit) or (needs[-1] and after.modulus < MAX_ALIGNMENT))
        after = unit.start
    return needs[::-1]


def _is_dynamic(unit: Group) -> bool:
    """Tell if a unit's padding depends on the message."""
    match unit:
        case PackedGroup():
            return not unit.fixed
        case PrimitiveElements():
            return unit.padding is None
        case Loop():
            return _needs(group_steps(unit.body.steps), unit.body.end, tail=False)[0]
        case MessageCall():
            return True
        case StringData():
            return False


@dataclass(slots=True)
class _Writer:
    """The lines that write one message, or one element of a loop."""

    lines: FunctionSource
    root: str
    """The local name of that message or element."""
    shared: Callable[[TypeName], str]
    appending: bool = False
    """Whether pieces are appended as they come, or all joined in the end."""
    sole: bool = False
    """Whether there is but one piece, which needs no joining."""
    pieces: list[str] = field(default_factory=list)
    _owners: dict[Path, str] = field(default_factory=dict)
    _found: dict[Path, tuple[str, str]] = field(default_factory=dict)
    """The local names of a collection, or of a string's bytes, and of their number."""

    def write(self, gathered: tuple[Group, ...], end: Phase, *, tail: bool) -> None:
        """Add the lines for all units; `tail` says that `o` matters behind the last."""
        needs = _needs(gathered, end, tail=tail)
        if needs[0] and self.pieces:
            self._set_offset(gathered[0].start)
        for index, unit in enumerate(gathered):
            behind = gathered[index + 1].start if index + 1 < len(gathered) else end
            needed = needs[index + 1]
            known = behind.modulus == MAX_ALIGNMENT
            self._unit(unit, counting=needed and not known)
            if needed and known:
                self._set_offset(behind)

    def finish(self) -> None:
        """Add the line that returns the bytes."""
        if self.appending:
            self.lines.add('return b"".join(parts)')
        elif self.pieces:
            self.lines.add(*wrap_arguments('return b"".join((', self.pieces, "))"))

    def _set_offset(self, phase: Phase) -> None:
        self.lines.add(f"o = {(phase.remainder + HEADER_SIZE) % MAX_ALIGNMENT}")

    def _unit(self, unit: Group, *, counting: bool) -> None:
        match unit:
            case PackedGroup():
                self._packed(unit, counting=counting)
            case StringData(path):
                self._piece(self._found[path][0], counting=counting)
            case PrimitiveElements():
                self._numbers(unit, counting=counting)
            case Loop():
                self._loop(unit, counting=counting)
            case MessageCall(path, name):
                self._append_from_now_on()
                self.lines.add(f"o = {self.shared(name)}({self._owner(path)}, append, o)")

    def _piece(self, expression: str, *, counting: bool, first: bool = False) -> None:
        """Add one piece, and its bytes to the offset where that is wanted."""
        if counting and not expression.isidentifier():
            name = self.lines.names.new("piece")
            self.lines.add(f"{name} = {expression}")
            expression = name
        if self.appending:
            self.lines.add(f"append({expression})")
        else:
            self.pieces.append(expression)
        if counting:
            self.lines.add(f"o {'' if first else '+'}= len({expression})")

    def _packed(self, unit: PackedGroup, *, counting: bool) -> None:
        with_header = not self.appending and not self.pieces
        start = -HEADER_SIZE if with_header else unit.start.remainder
        before = f"{'I ' if with_header else ''}{struct_format(unit.before)}"
        values = ["_HEADER"] if with_header else []
        values += self._values(unit.before)
        if unit.chars:
            text, length = self._found[unit.chars.path]
            values.append(text)
        values += self._values(unit.after)
        if unit.chars and unit.fixed:
            arguments = f"{before!r}, {struct_format(unit.after)!r}, {start}"
            made = f"{self.lines.table('texts', f'_pieces.texts({arguments})')}[{length}].pack"
        elif unit.chars:
            table = f"_pieces.phased_texts({before!r}, {struct_format(unit.after)!r})"
            made = f"{self.lines.table('texts', table)}[o & 7][{length}].pack"
        elif unit.fixed:
            made = self.lines.table("pack", f"_pieces.fixed({before!r}, {start}).pack")
        else:
            made = f"{self.lines.table('structs', f'_pieces.phased({before!r})')}[o & 7].pack"
        if counting or not unit.fixed:
            name = self.lines.names.new("piece")
            self.lines.add(*wrap_arguments(f"{name} = {made}(", values, ")"))
            self._piece(name, counting=counting, first=with_header)
        elif self.appending:
            self.lines.add(*wrap_arguments(f"append({made}(", values, "))"))
        elif self.sole:
            self.lines.add(*wrap_arguments(f"return {made}(", values, ")"))
        else:
            self.pieces.append(self._named(made, values))

    def _named(self, function: str, values: list[str]) -> str:
        """Return a short call as it is, and the name of a long one's result."""
        call = f"{function}({', '.join(values)})"
        if len(call) <= _READABLE:
            return call
        name = self.lines.names.new("piece")
        self.lines.add(*wrap_arguments(f"{name} = {function}(", values, ")"))
        return name

    def _values(self, run: Run | None) -> list[str]:
        """Return the arguments for the members of a run, after the lines that make them."""
        return [value for member in (run.members if run else ()) for value in self._value(member)]

    def _value(self, member: Member) -> Iterator[str]:
        match member:
            case Scalar(hidden=True):
                return
            case Scalar(path, type_):
                word = self._attribute(path)
                yield f"_pieces.to_{type_.name}({word})" if type_.name in {"char", "wchar"} else word
            case InlineArray():
                yield self._block(member)
            case Length(path, type_):
                yield self._count(path, type_)

    def _block(self, block: InlineArray) -> str:
        """Add the line that makes bytes of a small array, and the check of their number."""
        conversion = _CONVERSIONS.get(block.of.name)
        word = self._attribute(block.path)
        name = self.lines.names.of(block.path, self.root)
        made = f"_pieces.{conversion}({word})" if conversion else f"{word}.tobytes()"
        self.lines.add(f"{name} = {made}", f"if len({name}) != {block.size}:", "    raise _pieces.Refused")
        return name

    def _count(self, path: Path, type_: String | Sequence) -> str:
        """Add the lines that find a string's bytes or a sequence; return the number that is written."""
        word = self._attribute(path)
        name = self.lines.names.of(path, self.root) if path else self.lines.names.new("text")
        number = self.lines.names.new(f"{name}_size")
        made, length = word, f"len({name})"
        if isinstance(type_, String):
            made = f"_pieces.to_wide({word})" if type_.wide else f"{word}.encode()"
            length = f"len({name}) >> 2" if type_.wide else length
        elif isinstance(type_.of, Primitive) and type_.of.name in _CONVERSIONS:
            made = f"_pieces.{_CONVERSIONS[type_.of.name]}({word})"
            length = f"len({name}) >> 2" if type_.of.name == "wchar" else length
        self.lines.add(f"{name} = {made}", f"{number} = {length}")
        if isinstance(type_, Sequence) and type_.bound is not None:
            self.lines.add(f"if {number} > {type_.bound}:", "    raise _pieces.Refused")
        self._found[path] = (name, number)
        return f"{number} + 1" if isinstance(type_, String) and not type_.wide else number

    def _numbers(self, unit: PrimitiveElements, *, counting: bool) -> None:
        size = SIZES[unit.of.name]
        if isinstance(unit.type, Array):
            block = InlineArray(unit.path, unit.type, unit.of)
            name, empty, length = self._large_array(block), "", str(block.size)
        else:
            name, number = self._found[unit.path]
            empty = f' if {number} else b""'
            length = number if size == 1 else f"{size} * {number}"
        if unit.padding is None:
            table = self.lines.table(f"padding_{size}", f"_pieces.paddings({size})")
            padding = self.lines.names.new("padding")
            self.lines.add(f"{padding} = {table}[o & 7]{empty}")
            self._piece(padding, counting=counting)
        elif unit.padding:
            self._piece(f"{bytes(unit.padding)!r}{empty}", counting=counting)
        self._piece(name, counting=False)
        if counting:
            self.lines.add(f"o += {length}")

    def _large_array(self, block: InlineArray) -> str:
        """Add the line that finds a large array, and the check of its size."""
        if block.of.name in _CONVERSIONS:
            return self._block(block)
        name = self.lines.names.of(block.path, self.root)
        self.lines.add(
            f"{name} = {self._attribute(block.path)}",
            f"if {name}.nbytes != {block.size}:",
            "    raise _pieces.Refused",
        )
        return name

    def _loop(self, unit: Loop, *, counting: bool) -> None:
        self._append_from_now_on()
        if unit.path in self._found:
            name = self._found[unit.path][0]
        else:
            name = self.lines.names.of(unit.path, self.root)
            self.lines.add(f"{name} = {self._attribute(unit.path)}")
        if isinstance(unit.type, Array):
            self.lines.add(f"if len({name}) != {unit.type.size}:", "    raise _pieces.Refused")
        gathered = group_steps(unit.body.steps)
        element = self.lines.names.new(singular(unit.path[-1]))
        self.lines.add(f"for {element} in {name}:")
        self.lines.deeper()
        inside = _Writer(self.lines, element, self.shared, appending=True)
        tail = counting or _needs(gathered, unit.body.end, tail=False)[0]
        inside.write(gathered, unit.body.end, tail=tail)
        self.lines.back()

    def _append_from_now_on(self) -> None:
        """Turn the pieces so far into a list that grows."""
        if not self.appending:
            self.lines.add(*wrap_arguments("parts = [", self.pieces, "]"), "append = parts.append")
            self.appending = True

    def _attribute(self, path: Path) -> str:
        """Return the expression for a member; () is the element of the loop."""
        return f"{self._owner(path[:-1])}._{path[-1]}" if path else self.root

    def _owner(self, path: Path) -> str:
        """Return the local name of a message, after the line that gives it one."""
        if not path:
            return self.root
        if path not in self._owners:
            word = f"{self._owner(path[:-1])}._{path[-1]}"
            self._owners[path] = self.lines.names.of(path, self.root)
            self.lines.add(f"{self._owners[path]} = {word}")
        return self._owners[path]
