"""A message's layout to the Python function that reads it.

Messages are made without their constructors and values unpacked straight into their slots. Structs
check the end of the data by themselves; slices do not, so what is sliced is compared with `size`
beforehand.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.interfaces.model import Array
from forge.interfaces.python.cdr_cursor import Cursor
from forge.interfaces.python.cdr_slots import CONVERSIONS, Slots
from forge.interfaces.python.cdr_text import (
    HEADER_SIZE,
    PackedGroup,
    assignment,
    group_steps,
    singular,
    struct_format,
)
from forge.interfaces.python.types import TYPE_CODES
from forge.interfaces.wire.layout import (
    SIZES,
    InlineArray,
    Loop,
    MessageCall,
    Phase,
    PrimitiveElements,
    Run,
    Scalar,
    StringData,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from forge.interfaces.model import TypeName
    from forge.interfaces.python.cdr_text import FunctionSource, Group
    from forge.interfaces.wire.layout import MessageLayout

_HEADER_CHECK = ("if encapsulation != _LITTLE_ENDIAN:", "    raise _pieces.Refused")


@frozen
class References:
    """What a reader calls messages by: their classes, and the functions that read large ones."""

    class_of: Callable[[TypeName], str]
    shared: Callable[[TypeName], str]


def emit_reader(lines: FunctionSource, name: TypeName, layout: MessageLayout, others: References) -> None:
    """Add the lines of a function that returns the message in some data."""
    reader = _Reader(lines, others, Slots(lines, "message"), Cursor(lines, number=HEADER_SIZE))
    if not any(isinstance(step, MessageCall) and not step.path for step in layout.steps):
        lines.add(f"message = _new({others.class_of(name)})")
    if _looks_at_size(group_steps(layout.steps)):
        lines.add("size = len(buffer)", "view = memoryview(buffer)")
    first = layout.steps[0]
    if isinstance(first, Run) and first.segments[0].alignment == 1:
        reader.header = True
    else:
        unpack = lines.table("unpack", "_pieces.fixed('H x x', -4).unpack_from")
        lines.add(f"(encapsulation,) = {unpack}(buffer, 0)", *_HEADER_CHECK)
    reader.read(layout, tail=False)
    lines.add("return message")


def emit_part_reader(
    lines: FunctionSource, name: TypeName, layout: MessageLayout, others: References
) -> None:
    """Add the lines of a function that returns the message at an offset, and the offset behind it."""
    lines.add(f"message = _new({others.class_of(name)})")
    if _looks_at_size(group_steps(layout.steps)):
        lines.add("size = len(view)")
    reader = _Reader(lines, others, Slots(lines, "message"), Cursor(lines, known=False))
    reader.read(layout, tail=True)
    lines.add("return message, o")


def _looks_at_size(gathered: Sequence[Group]) -> bool:
    return any(not isinstance(unit, PackedGroup) for unit in gathered)


@dataclass(slots=True)
class _Reader:
    """The lines that read one message, or one element of a loop."""

    lines: FunctionSource
    others: References
    slots: Slots
    cursor: Cursor
    header: bool = False
    """Whether the first run comes right after the header, which is read with it."""

    def read(self, layout: MessageLayout, *, tail: bool, made: bool = False) -> None:
        """Add the lines for a layout; `tail` says that `o` must be right behind it.

        `made` says that the messages in it are there already.
        """
        for inner in () if made else layout.inlined:
            self.lines.add(
                f"{self.slots.slot(inner.path)} = {self.slots.hold(inner.path)} "
                f"= _new({self.others.class_of(inner.name)})"
            )
        gathered = group_steps(layout.steps)
        for index, unit in enumerate(gathered):
            self._unit(unit, last=not tail and index == len(gathered) - 1)
        if tail:
            self.cursor.settle()

    def _unit(self, unit: Group, *, last: bool) -> None:
        match unit:
            case PackedGroup(before, chars, after):
                if before:
                    self._run(before)
                if chars:
                    self._text(chars, after, last=last)
            case StringData():
                self._wide(unit, last=last)
            case PrimitiveElements():
                self._numbers(unit, last=last)
            case Loop():
                self._loop(unit, last=last)
            case MessageCall(path, name):
                self.cursor.settle()
                read = self.others.shared(name)
                self.lines.add(f"{self.slots.slot(path)}, o = {read}(buffer, view, o, limit)")

    def _run(self, run: Run) -> None:
        start = run.start
        for piece in run.segments:
            if piece.alignment > 1:
                self.cursor.align(piece.alignment)
                start = Phase(piece.alignment, 0)
            letters = struct_format(Run(piece.members, start))
            targets = self.slots.targets(piece.members)
            table = f"_pieces.fixed({letters!r}, {start.remainder}).unpack_from"
            if self.header:
                self.cursor.number = 0
                table = f"_pieces.fixed('H x x {letters}', -{HEADER_SIZE}).unpack_from"
                targets.insert(0, "encapsulation")
                self.slots.later[:0] = _HEADER_CHECK
            self.slots.unpack(targets, f"{self.lines.table('unpack', table)}(buffer, {self.cursor.here})")
            self.cursor.number += piece.size + (HEADER_SIZE if self.header else 0)
            self.header = False

    def _text(self, chars: StringData, after: Run | None, *, last: bool) -> None:
        """Add the lines for a string and the run behind it, which one Struct unpacks."""
        text = self.slots.local(chars.path)
        values = self.slots.targets(after.members) if after else []
        later = self.slots.later[:]
        self.slots.later.clear()
        if after is None or after.is_fixed(Phase(chars.start.modulus, 0)):
            made = f"_pieces.read_texts({struct_format(after)!r}, {chars.start.remainder})"
            struct = self.lines.table("texts", made)
        else:
            self.cursor.settle()
            struct = (
                f"{self.lines.table('texts', f'_pieces.phased_read_texts({struct_format(after)!r})')}[o & 7]"
            )
        struct = f"{struct}[{self.slots.count(chars.path)}]"
        if not last:
            self.lines.add(f"struct = {struct}")
            struct = "struct"
        self.slots.unpack([text, "nul", *values], f"{struct}.unpack_from(buffer, {self.cursor.here})")
        if not last:
            self.cursor.add_size("struct.size")
        self.lines.add("if nul:", f"    {text} = _pieces.unterminated({text}, nul)")
        self.lines.add(f"{self.slots.slot(chars.path)} = {text}.decode()", *later)

    def _wide(self, unit: StringData, *, last: bool) -> None:
        end = self.cursor.ensure(f"4 * {self.slots.count(unit.path)}")
        self.lines.add(f"{self.slots.slot(unit.path)} = _pieces.from_wide(view[o:{end}])")
        self.cursor.go_on(end, last=last)

    def _numbers(self, unit: PrimitiveElements, *, last: bool) -> None:
        size = SIZES[unit.of.name]
        slot = self.slots.slot(unit.path)
        if isinstance(unit.type, Array):
            block = InlineArray(unit.path, unit.type, unit.of)
            self.cursor.pad(unit.padding, size, None)
            end = self.cursor.ensure(str(block.size))
            self.lines.add(f"{slot} = {self.slots.array(block, f'view[o:{end}]')}")
        else:
            number = self.slots.count(unit.path)
            self.cursor.pad(unit.padding, size, number)
            end = self.cursor.ensure(f"{size} * {number}" if size > 1 else number)
            if unit.of.name in CONVERSIONS:
                self.lines.add(f"{slot} = _pieces.{CONVERSIONS[unit.of.name]}(view[o:{end}])")
            else:
                self._sequence(unit, end)
        self.cursor.go_on(end, last=last)

    def _sequence(self, unit: PrimitiveElements, end: str) -> None:
        """Add the lines that copy numbers into an array, or leave them for later where they are many."""
        code = TYPE_CODES[unit.of.name]
        empty = self.lines.table(f"no_{unit.of.name}", f"_array({code!r})")
        name = self.slots.local(unit.path)
        arguments = f"{self.slots.owner(unit.path[:-1])}, '_{unit.path[-1]}', view[o:{end}], {code!r}"
        self.lines.add(
            f"if {end} - o <= limit:",
            f"    {self.slots.slot(unit.path)} = {name} = {empty}[:]",
            f"    if {self.slots.count(unit.path)}:",
            f"        {name}.frombytes(view[o:{end}])",
            "else:",
            f"    _lazy.postpone({arguments})",
        )

    def _loop(self, unit: Loop, *, last: bool) -> None:
        counted = None if isinstance(unit.type, Array) else self.slots.count(unit.path)
        number = str(unit.type.size) if isinstance(unit.type, Array) else self.slots.count(unit.path)
        run = _batch(unit)
        if run:
            self.cursor.pad(unit.start.padding(run.alignment), run.alignment, counted)
            self._batched(unit, run, number, last=last)
        else:
            self.cursor.settle()
            if counted:
                least = f"{unit.body.min_size} * {number}" if unit.body.min_size > 1 else number
                self.lines.add(f"if {least} > size - o:", "    raise _pieces.Refused")
            self._repeated(unit, number)

    def _batched(self, unit: Loop, run: Run, number: str, *, last: bool) -> None:
        """Add the loop over elements of one size, which are all unpacked in one go."""
        end = self.cursor.ensure(f"{sum(piece.size for piece in run.segments)} * {number}")
        unpack = self.lines.table("iterate", f"_pieces.fixed({struct_format(run)!r}, 0).iter_unpack")
        element = self._element(unit)
        self._for_all(unit, number, element, (run, f"{unpack}(view[o:{end}])"))
        if len(unit.body.inlined) == 1:
            self.lines.add("pass")
        self.lines.back()
        self.cursor.go_on(end, last=last)

    def _repeated(self, unit: Loop, number: str) -> None:
        """Add the loop that reads one element after the other."""
        element = self._element(unit)
        if unit.body.inlined:
            self._for_all(unit, number, element, None)
            element.read(unit.body, tail=True, made=True)
        else:
            name, root = self.slots.local(unit.path), element.slots.root
            append = self.lines.names.new(f"append_{root}")
            self.lines.add(f"{self.slots.slot(unit.path)} = {name} = []", f"{append} = {name}.append")
            self.lines.add(f"for _ in range({number}):")
            self.lines.deeper()
            element.read(unit.body, tail=True)
            self.lines.add(f"{append}({root})")
        self.lines.back()

    def _element(self, unit: Loop) -> _Reader:
        """Return what reads one element of a loop."""
        slots = Slots(self.lines, self.lines.names.new(singular(unit.path[-1])))
        return _Reader(self.lines, self.others, slots, Cursor(self.lines, known=False))

    def _for_all(self, unit: Loop, number: str, element: _Reader, values: tuple[Run, str] | None) -> None:
        """Add the line that makes all elements, and begin the loop over them and over what is in them.

        `values` is the run that the loop unpacks as well, and the expression for all their values.
        """
        name = self.slots.local(unit.path)
        targets, sources, stores = [element.slots.root], [name], []
        for inner in unit.body.inlined:
            made = f"_new, _repeat({self.others.class_of(inner.name)}"
            if not inner.path:
                self.lines.add(f"{self.slots.slot(unit.path)} = {name} = [*map({made}, {number}))]")
                continue
            targets.append(element.slots.hold(inner.path))
            sources.append(f"map({made}))")
            stores.append(f"{element.slots.slot(inner.path)} = {targets[-1]}")
        if values:
            slots = element.slots.targets(values[0].members)
            targets.append(f"({', '.join(slots)}{',' if len(slots) == 1 else ''})")
            sources.append(values[1])
        if len(sources) == 1:
            self.lines.add(f"for {targets[0]} in {name}:")
        else:
            self.lines.add(*assignment("for ", targets, " in zip("))
            self.lines.add(*(f"    {source}," for source in sources), "):")
        self.lines.deeper()
        self.lines.add(*stores)


def _batch(unit: Loop) -> Run | None:
    """Return the run that each element is, if all of them have the same layout once the first is aligned."""
    steps = unit.body.steps
    if len(steps) != 1 or not isinstance(steps[0], Run):
        return None
    first = steps[0].members[0]
    run = Run(steps[0].members, Phase(first.alignment, 0))
    plain = all(
        isinstance(m, Scalar) and not m.hidden and m.type.name not in {"char", "wchar"} for m in run.members
    )
    return run if plain and first.alignment == run.alignment and not run.end(run.start).remainder else None
