"""Generate the Python function that deserializes a message, from its layout.

The function creates messages without calling their constructors and unpacks values directly into their
slots. Structs check the end of the data themselves; slices do not, so the function compares their end with
`size` first.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from forge.base.names import snake_case
from forge.interfaces.model import Array, Sequence, TypeName
from forge.interfaces.python.types import DTYPES, TYPE_CODES
from forge.interfaces.wire.layout import (
    SIZES,
    InlineArray,
    Length,
    Loop,
    Member,
    MessageCall,
    MessageLayout,
    Path,
    Phase,
    PrimitiveElements,
    Run,
    Scalar,
    StringData,
)
from forge.plugins.python_cdr.source import (
    CONVERTED,
    HEADER_SIZE,
    FunctionSource,
    Group,
    PackedGroup,
    assignment,
    group_steps,
    singular,
    struct_format,
)

_HEADER_CHECK = ("if encapsulation != _LITTLE_ENDIAN:", "    raise _pieces.Refused")


def emit_reader(lines: FunctionSource, name: TypeName, layout: MessageLayout) -> None:
    """Emit the body of a function that returns the message in a buffer."""
    reader = _Reader(lines, "message", Cursor(lines, constant=HEADER_SIZE))
    if not any(isinstance(step, MessageCall) and not step.path for step in layout.steps):
        lines.add(f"message = _new({lines.module.class_of(name)})")
    if _looks_at_size(group_steps(layout.steps)):
        lines.add("size = len(buffer)", "view = memoryview(buffer)")
    first = layout.steps[0]
    if isinstance(first, Run) and first.segments[0].alignment == 1:
        reader.header = True
    else:
        unpack = lines.table("unpack", "_pieces.fixed('H x x', -4).unpack_from")
        lines.add(f"(encapsulation,) = {unpack}(buffer, 0)", *_HEADER_CHECK)
    reader.read(layout, keep_offset=False)
    lines.add("return message")


def emit_part_reader(lines: FunctionSource, name: TypeName, layout: MessageLayout) -> None:
    """Emit the body of a function that returns the message at an offset, and the offset after it."""
    lines.add(f"message = _new({lines.module.class_of(name)})")
    if _looks_at_size(group_steps(layout.steps)):
        lines.add("size = len(view)")
    reader = _Reader(lines, "message", Cursor(lines, absolute=False))
    reader.read(layout, keep_offset=True)
    lines.add("return message, o")


def _looks_at_size(groups: Iterable[Group]) -> bool:
    return any(not isinstance(group, PackedGroup) for group in groups)


@dataclass(slots=True)
class _Reader:
    """Emits the lines that read one message, or one element of a loop."""

    lines: FunctionSource
    root: str
    """The local name of the message, or of the element of a loop."""
    cursor: Cursor
    header: bool = False
    """Whether to unpack the header together with the first run."""
    conversions: list[str] = field(default_factory=list)
    """The lines that check and convert values after they were unpacked."""
    _owners: dict[Path, str] = field(default_factory=dict)
    _lengths: dict[Path, str] = field(default_factory=dict)

    def read(self, layout: MessageLayout, *, keep_offset: bool, made: bool = False) -> None:
        """Emit the lines for a layout.

        With `keep_offset`, `o` is the offset after it. With `made`, the nested messages already exist.
        """
        for path, name in () if made else layout.inlined:
            new = f"_new({self.lines.module.class_of(name)})"
            self.lines.add(f"{self.slot(path)} = {self.new_owner(path)} = {new}")
        groups = group_steps(layout.steps)
        for index, group in enumerate(groups):
            self._group(group, last=not keep_offset and index == len(groups) - 1)
        if keep_offset:
            self.cursor.store()

    def _group(self, group: Group, *, last: bool) -> None:
        match group:
            case PackedGroup(before, chars, after):
                if before:
                    self._run(before)
                if chars:
                    self._text(chars, after, last=last)
            case StringData(path):
                end = self.cursor.check_available(f"4 * {self._lengths[path]}")
                self._store_text(group, f"_pieces.from_wide(view[o:{end}])")
                self.cursor.move_to(end, last=last)
            case PrimitiveElements():
                self._numbers(group, last=last)
            case Loop():
                self._loop(group, last=last)
            case MessageCall(path, name):
                self.cursor.store()
                factory = self.lines.module.factory_call("part_reader", name)
                read = self.lines.table(f"read_{snake_case(name.name)}", factory)
                self.lines.add(f"{self.slot(path)}, o = {read}(buffer, view, o, limit)")

    def _run(self, run: Run) -> None:
        start = run.start
        for segment in run.segments:
            if segment.alignment > 1:
                self.cursor.align(segment.alignment)
                start = Phase(segment.alignment, 0)
            letters = struct_format(Run(segment.members, start))
            targets = self.targets(segment.members)
            table = f"_pieces.fixed({letters!r}, {start.remainder}).unpack_from"
            if self.header:
                self.cursor.constant = 0
                table = f"_pieces.fixed('H x x {letters}', -{HEADER_SIZE}).unpack_from"
                targets.insert(0, "encapsulation")
                self.conversions[:0] = _HEADER_CHECK
            self.unpack(targets, f"{self.lines.table('unpack', table)}(buffer, {self.cursor.expression})")
            self.cursor.constant += segment.size + (HEADER_SIZE if self.header else 0)
            self.header = False

    def _text(self, chars: StringData, after: Run | None, *, last: bool) -> None:
        """Emit the lines for a string and the run after it, which one Struct unpacks."""
        text = self.local(chars.path)
        values = self.targets(after.members) if after else []
        conversions = self.conversions[:]
        self.conversions.clear()
        if after is None or after.is_fixed(Phase(chars.start.modulus, 0)):
            table = f"_pieces.read_texts({struct_format(after)!r}, {chars.start.remainder})"
            struct = self.lines.table("texts", table)
        else:
            self.cursor.store()
            table = f"_pieces.phased_read_texts({struct_format(after)!r})"
            struct = f"{self.lines.table('texts', table)}[o & 7]"
        struct = f"{struct}[{self._lengths[chars.path]}]"
        if not last:
            self.lines.add(f"struct = {struct}")
            struct = "struct"
        self.unpack([text, "nul", *values], f"{struct}.unpack_from(buffer, {self.cursor.expression})")
        if not last:
            self.cursor.advance("struct.size")
        self.lines.add("if nul:", f"    {text} = _pieces.unterminated({text}, nul)")
        self._store_text(chars, f"{text}.decode()")
        self.lines.add(*conversions)

    def _store_text(self, chars: StringData, expression: str) -> None:
        slot = self.slot(chars.path)
        self.lines.add(f"{slot} = {expression}")
        if chars.type.bound is not None:
            self.lines.reject_if(f"len({slot}) > {chars.type.bound}")

    def _numbers(self, group: PrimitiveElements, *, last: bool) -> None:
        size = SIZES[group.of.name]
        slot = self.slot(group.path)
        if isinstance(group.type, Array):
            block = InlineArray(group.path, group.type, group.of)
            self.cursor.pad(group.padding, size, None)
            end = self.cursor.check_available(str(block.size))
            self.lines.add(f"{slot} = {self.array(block, f'view[o:{end}]')}")
        else:
            number = self._lengths[group.path]
            self.cursor.pad(group.padding, size, number)
            end = self.cursor.check_available(f"{size} * {number}" if size > 1 else number)
            if group.of.name in CONVERTED:
                self.lines.add(f"{slot} = _pieces.from_{CONVERTED[group.of.name]}(view[o:{end}])")
            else:
                # Numbers are copied into an array; on first access if they are many.
                code = TYPE_CODES[group.of.name]
                empty = self.lines.table(f"no_{group.of.name}", f"_array({code!r})")
                name = self.local(group.path)
                owner = self.owner(group.path[:-1])
                self.lines.add(
                    f"if {end} - o <= limit:",
                    f"    {slot} = {name} = {empty}[:]",
                    f"    if {number}:",
                    f"        {name}.frombytes(view[o:{end}])",
                    "else:",
                    f"    _lazy.postpone({owner}, '_{group.path[-1]}', view[o:{end}], {code!r})",
                )
        self.cursor.move_to(end, last=last)

    def _loop(self, group: Loop, *, last: bool) -> None:
        counted = self._lengths.get(group.path) if isinstance(group.type, Sequence) else None
        number = str(group.type.size) if isinstance(group.type, Array) else self._lengths[group.path]
        run = _batch(group)
        if run:
            # `iter_unpack` unpacks elements of one size.
            self.cursor.pad(group.start.padding(run.alignment), run.alignment, counted)
            end = self.cursor.check_available(f"{sum(segment.size for segment in run.segments)} * {number}")
            unpack = self.lines.table("iterate", f"_pieces.fixed({struct_format(run)!r}, 0).iter_unpack")
        else:
            self.cursor.store()
            if counted:
                least = f"{group.body.min_size} * {number}" if group.body.min_size > 1 else number
                self.lines.reject_if(f"{least} > size - o")
        root = self.lines.name(singular(group.path[-1]))
        element = _Reader(self.lines, root, Cursor(self.lines, absolute=False))
        if run:
            self._for_all(group, number, element, (run, f"{unpack}(view[o:{end}])"))
            if len(group.body.inlined) == 1:
                self.lines.add("pass")
        elif group.body.inlined:
            self._for_all(group, number, element, None)
            element.read(group.body, keep_offset=True, made=True)
        else:
            name = self.local(group.path)
            append = self.lines.name(f"append_{root}")
            self.lines.add(f"{self.slot(group.path)} = {name} = []", f"{append} = {name}.append")
            self.lines.add(f"for _ in range({number}):")
            self.lines.indent()
            element.read(group.body, keep_offset=True)
            self.lines.add(f"{append}({root})")
        self.lines.dedent()
        if run:
            self.cursor.move_to(end, last=last)

    def _for_all(self, group: Loop, number: str, element: _Reader, values: tuple[Run, str] | None) -> None:
        """Emit the lines that create all elements, and the head of the loop over them.

        `values` is a run that the loop unpacks as well, and the expression for the values of all elements.
        """
        name = self.local(group.path)
        targets, sources, stores = [element.root], [name], []
        for path, inner in group.body.inlined:
            new_objects = f"_new, _repeat({self.lines.module.class_of(inner)}"
            if not path:
                self.lines.add(f"{self.slot(group.path)} = {name} = [*map({new_objects}, {number}))]")
                continue
            targets.append(element.new_owner(path))
            sources.append(f"map({new_objects}))")
            stores.append(f"{element.slot(path)} = {targets[-1]}")
        if values:
            slots = element.targets(values[0].members)
            targets.append(f"({', '.join(slots)}{',' if len(slots) == 1 else ''})")
            sources.append(values[1])
        if len(sources) == 1:
            self.lines.add(f"for {targets[0]} in {name}:")
        else:
            self.lines.add(*assignment("for ", targets, " in zip("))
            self.lines.add(*(f"    {source}," for source in sources), "):")
        self.lines.indent()
        self.lines.add(*stores)

    def slot(self, path: Path) -> str:
        """Return the expression for a slot; () is the element itself."""
        return f"{self.owner(path[:-1])}._{path[-1]}" if path else self.root

    def owner(self, path: Path) -> str:
        return self._owners[path] if path else self.root

    def new_owner(self, path: Path) -> str:
        """Return a new local name for the message at a path."""
        self._owners[path] = self.local(path)
        return self._owners[path]

    def local(self, path: Path) -> str:
        """Return a new local name for the value at a path, or the existing name of the element itself."""
        return self.lines.name("_".join(path)) if path else self.root

    def unpack(self, targets: list[str], call: str) -> None:
        """Emit the line that unpacks values, and those that convert them to the types of fields."""
        if len(targets) == 1:
            self.lines.add(f"({targets[0]},) = {call}")
        else:
            self.lines.add(*(assignment("", targets, f" = {call}") if targets else [call]))
        self.lines.add(*self.conversions)
        self.conversions.clear()

    def targets(self, members: Iterable[Member]) -> list[str]:
        """Return the assignment targets for the values of a run, and queue their conversions."""
        return [target for member in members if (target := self._target(member))]

    def _target(self, member: Member) -> str | None:
        match member:
            case Scalar(hidden=True):
                return None
            case Scalar(path, type_) if type_.name in {"char", "wchar"}:
                name = self.local(path)
                self.conversions.append(f"{self.slot(path)} = _pieces.{type_.name}({name})")
                return name
            case Scalar(path):
                return self.slot(path)
            case InlineArray(path):
                name = self.local(path)
                self.conversions.append(f"{self.slot(path)} = {self.array(member, name)}")
                return name
            case Length(path, type_):
                name = self._lengths[path] = self.lines.name(f"{'_'.join(path) or self.root}_size")
                if isinstance(type_, Sequence) and type_.bound is not None:
                    self.conversions += [f"if {name} > {type_.bound}:", "    raise _pieces.Refused"]
                return name

    def array(self, block: InlineArray, raw: str) -> str:
        """Return the expression that creates an array from its bytes."""
        if block.of.name in CONVERTED:
            return f"_pieces.from_{CONVERTED[block.of.name]}({raw})"
        dtype = self.lines.table(DTYPES[block.of.name], f"_numpy.dtype({DTYPES[block.of.name]!r})")
        return f"_ndarray(({block.type.size},), {dtype}, bytearray({raw}))"


def _batch(group: Loop) -> Run | None:
    """Return the run of each element, if all elements have the same padding once the first is aligned."""
    steps = group.body.steps
    if len(steps) != 1 or not isinstance(steps[0], Run):
        return None
    first = steps[0].members[0]
    run = Run(steps[0].members, Phase(first.alignment, 0))
    plain = all(
        isinstance(m, Scalar) and not m.hidden and m.type.name not in {"char", "wchar"} for m in run.members
    )
    return run if plain and first.alignment == run.alignment and not run.end(run.start).remainder else None


@dataclass(slots=True)
class Cursor:
    """The offset of the next byte to read, including the header; alignment does not count the header."""

    lines: FunctionSource
    absolute: bool = True
    """True if the offset is `constant`, False if it is `o` plus `constant`."""
    constant: int = 0

    @property
    def expression(self) -> str:
        if self.absolute:
            return str(self.constant)
        return f"o + {self.constant}" if self.constant else "o"

    def store(self) -> None:
        if self.absolute or self.constant:
            self.lines.add(f"o = {self.expression}")
        self._mark_stored()

    def advance(self, size: str) -> None:
        """Emit the line that skips as many bytes as the expression `size`."""
        self.lines.add(f"o += {size}" if self.expression == "o" else f"o = {self.expression} + {size}")
        self._mark_stored()

    def align(self, alignment: int) -> None:
        """Emit the line that skips padding of unknown size."""
        self.lines.add(f"o = {_rounded(self.expression, alignment)}")
        self._mark_stored()

    def pad(self, padding: int | None, alignment: int, count: str | None) -> None:
        """Emit the lines that skip the padding before elements; an empty sequence has none.

        `count` is the expression for the number of elements, or None for an array.
        """
        if padding == 0:
            return
        if count is not None:
            self.store()
            skip = f"o += {padding}" if padding else f"o = {_rounded('o', alignment)}"
            self.lines.add(f"if {count}:", f"    {skip}")
        elif padding:
            self.constant += padding
        else:
            self.align(alignment)

    def check_available(self, length: str) -> str:
        """Emit the lines that reject data with fewer remaining bytes; return the name of the end offset."""
        self.store()
        end = self.lines.name("end")
        self.lines.add(f"{end} = o + {length}")
        self.lines.reject_if(f"{end} > size")
        return end

    def move_to(self, end: str, *, last: bool) -> None:
        """Emit the assignment of `o` after the data, unless nothing follows."""
        if not last:
            self.lines.add(f"o = {end}")

    def _mark_stored(self) -> None:
        self.absolute, self.constant = False, 0


def _rounded(offset: str, alignment: int) -> str:
    if alignment <= HEADER_SIZE:
        return f"{offset} + {alignment - 1} & -{alignment}"
    return f"({offset} + {alignment - 1 - HEADER_SIZE} & -{alignment}) + {HEADER_SIZE}"
