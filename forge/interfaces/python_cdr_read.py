"""A message's layout to the Python function that reads it.

Messages are made without their constructors and values unpacked straight into their slots. The
offset is a number in the text as long as it is known, then `o` and a number. Structs check the end
of the data by themselves; slices do not, so what is sliced is compared with `size` beforehand.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from forge.interfaces.model import Array, Sequence
from forge.interfaces.python_cdr_text import HEADER_SIZE, Packed, codes, singular, units, unpacked
from forge.interfaces.python_types import DTYPES, TYPE_CODES
from forge.interfaces.wire import SIZES, Block, Chars, Count, Loop, Numbers, Phase, Run, Shared, Value

if TYPE_CHECKING:
    from collections.abc import Callable
    from collections.abc import Sequence as Items

    from forge.interfaces.model import TypeName
    from forge.interfaces.python_cdr_text import Text as Lines
    from forge.interfaces.python_cdr_text import Unit
    from forge.interfaces.wire import Layout, Member, Path

_HEADER_CHECK = ("if encapsulation != _LITTLE_ENDIAN:", "    raise _pieces.Refused")
_CONVERSIONS = {"boolean": "from_flags", "octet": "from_octets", "char": "from_chars", "wchar": "from_wchars"}


@dataclass(frozen=True, slots=True)
class Others:
    """What a reader calls messages by: their classes, and the functions that read large ones."""

    class_of: Callable[[TypeName], str]
    shared: Callable[[TypeName], str]


def read_whole(lines: Lines, name: TypeName, layout: Layout, others: Others) -> None:
    """Add the lines of a function that returns the message in some data."""
    reader = _Reader(lines, "message", others, number=HEADER_SIZE)
    if not any(isinstance(step, Shared) and not step.path for step in layout.steps):
        lines.add(f"message = _new({others.class_of(name)})")
    if _looks_at_size(units(layout.steps)):
        lines.add("size = len(buffer)", "view = memoryview(buffer)")
    first = layout.steps[0]
    if isinstance(first, Run) and first.pieces[0].alignment == 1:
        reader.header = True
    else:
        unpack = lines.table("unpack", "_pieces.fixed('H x x', -4).unpack_from")
        lines.add(f"(encapsulation,) = {unpack}(buffer, 0)", *_HEADER_CHECK)
    reader.read(layout, tail=False)
    lines.add("return message")


def read_part(lines: Lines, name: TypeName, layout: Layout, others: Others) -> None:
    """Add the lines of a function that returns the message at an offset, and the offset behind it."""
    reader = _Reader(lines, "message", others, known=False)
    lines.add(f"message = _new({others.class_of(name)})")
    if _looks_at_size(units(layout.steps)):
        lines.add("size = len(view)")
    reader.read(layout, tail=True)
    lines.add("return message, o")


def _looks_at_size(gathered: Items[Unit]) -> bool:
    return any(not isinstance(unit, Packed) for unit in gathered)


@dataclass(slots=True)
class _Reader:
    """The lines that read one message, or one element of a loop."""

    lines: Lines
    root: str
    others: Others
    header: bool = False
    """Whether the first run comes right after the header, which is read with it."""
    known: bool = True
    """Whether the offset is `number`; else it is that much more than `o`."""
    number: int = 0
    _owners: dict[Path, str] = field(default_factory=dict)
    _counts: dict[Path, str] = field(default_factory=dict)
    """The local names of what the runs have counted."""
    _later: list[str] = field(default_factory=list)
    """What is to be done with unpacked values, once they are."""

    def read(self, layout: Layout, *, tail: bool, made: bool = False) -> None:
        """Add the lines for a layout; `tail` says that `o` must be right behind it.

        `made` says that the messages in it are there already.
        """
        self._owners[()] = self.root
        for inner in () if made else layout.inner:
            self._make(inner.path, inner.name)
        gathered = units(layout.steps)
        for index, unit in enumerate(gathered):
            self._unit(unit, last=not tail and index == len(gathered) - 1)
        if tail:
            self._settle()

    def _make(self, path: Path, name: TypeName) -> None:
        """Add the line that makes a nested message."""
        local = self._owners[path] = self.lines.names.of(path, self.root)
        self.lines.add(f"{self._slot(path)} = {local} = _new({self.others.class_of(name)})")

    def _unit(self, unit: Unit, *, last: bool) -> None:
        match unit:
            case Packed(before, chars, after):
                if before:
                    self._run(before)
                if chars:
                    self._text(chars, after, fixed=_fixed_behind(chars, after), last=last)
            case Chars():
                self._wide(unit, last=last)
            case Numbers():
                self._numbers(unit, last=last)
            case Loop():
                self._loop(unit, last=last)
            case Shared(path, name):
                self._settle()
                target = self._slot(path) if path else self.root
                self.lines.add(f"{target}, o = {self.others.shared(name)}(buffer, view, o, limit)")

    @property
    def _here(self) -> str:
        """The expression for the offset."""
        if self.known:
            return str(self.number)
        return f"o + {self.number}" if self.number else "o"

    def _settle(self) -> None:
        """Add the line that makes `o` the offset itself."""
        if self.known or self.number:
            self.lines.add(f"o = {self._here}")
        self.known, self.number = False, 0

    def _align(self, alignment: int) -> None:
        """Add the line that passes padding of unknown size."""
        self.lines.add(f"o = {_rounded(self._here, alignment)}")
        self.known, self.number = False, 0

    def _run(self, run: Run) -> None:
        start = run.start
        for piece in run.pieces:
            if piece.alignment > 1:
                self._align(piece.alignment)
                start = Phase(piece.alignment, 0)
            letters = codes(Run(piece.members, start))
            targets = self._targets(piece.members)
            if self.header:
                self.number = 0
                table = f"_pieces.fixed('H x x {letters}', -{HEADER_SIZE}).unpack_from"
                targets.insert(0, "encapsulation")
                self._later[:0] = _HEADER_CHECK
            else:
                table = f"_pieces.fixed({letters!r}, {start.remainder}).unpack_from"
            self._unpack(targets, f"{self.lines.table('unpack', table)}(buffer, {self._here})")
            self.number += piece.size + (HEADER_SIZE if self.header else 0)
            self.header = False

    def _text(self, chars: Chars, after: Run | None, *, fixed: bool, last: bool) -> None:
        """Add the lines for a string and the run behind it, which one Struct unpacks."""
        text = self._text_name(chars.path)
        values = self._targets(after.members) if after else []
        later, self._later = self._later, []
        if fixed:
            arguments = f"{codes(after)!r}, {chars.start.remainder}"
            table = f"{self.lines.table('texts', f'_pieces.read_texts({arguments})')}"
        else:
            self._settle()
            made = f"_pieces.phased_read_texts({codes(after)!r})"
            table = f"{self.lines.table('texts', made)}[o & 7]"
        struct = f"{table}[{self._counts[chars.path]}]"
        if not last:
            self.lines.add(f"struct = {struct}")
            struct = "struct"
        self._unpack([text, "nul", *values], f"{struct}.unpack_from(buffer, {self._here})")
        if not last:
            self.lines.add(f"o = {self._here} + struct.size" if self._here != "o" else "o += struct.size")
            self.known, self.number = False, 0
        self.lines.add("if nul:", f"    {text} = _pieces.unterminated({text}, nul)")
        target = self._slot(chars.path) if chars.path else text
        self.lines.add(f"{target} = {text}.decode()", *later)

    def _text_name(self, path: Path) -> str:
        return self.lines.names.of(path, self.root) if path else self.root

    def _unpack(self, targets: list[str], call: str) -> None:
        """Add the line that unpacks values, and those that turn them into what fields hold."""
        if not targets:
            self.lines.add(call)
        elif len(targets) == 1:
            self.lines.add(f"({targets[0]},) = {call}")
        else:
            self.lines.add(*unpacked("", targets, f" = {call}"))
        self.lines.add(*self._later)
        self._later.clear()

    def _targets(self, members: Items[Member]) -> list[str]:
        """Return what the values of a run are unpacked to; what else they need is put off."""
        return [target for member in members if (target := self._target(member))]

    def _target(self, member: Member) -> str | None:
        match member:
            case Value(hidden=True):
                return None
            case Value(path, type_) if type_.name in {"char", "wchar"}:
                name = self.lines.names.of(path, self.root)
                self._later.append(f"{self._slot(path)} = _pieces.{type_.name}({name})")
                return name
            case Value(path):
                return self._slot(path)
            case Block():
                name = self.lines.names.of(member.path, self.root)
                self._later.append(f"{self._slot(member.path)} = {self._array(member, name)}")
                return name
            case Count(path, type_):
                name = self._counts[path] = self.lines.names.new("_".join((*(path or (self.root,)), "size")))
                if isinstance(type_, Sequence) and type_.bound is not None:
                    self._later += [f"if {name} > {type_.bound}:", "    raise _pieces.Refused"]
                return name

    def _array(self, block: Block, raw: str) -> str:
        """Return the expression that makes an array of its bytes."""
        if block.of.name in _CONVERSIONS:
            return f"_pieces.{_CONVERSIONS[block.of.name]}({raw})"
        dtype = self.lines.table(DTYPES[block.of.name], f"_numpy.dtype({DTYPES[block.of.name]!r})")
        return f"_ndarray(({block.type.size},), {dtype}, bytearray({raw}))"

    def _check_end(self, length: str) -> str:
        """Add the lines that make sure of that many bytes; return the name of the offset behind them."""
        end = self.lines.names.new("end")
        self.lines.add(f"{end} = {self._here} + {length}", f"if {end} > size:", "    raise _pieces.Refused")
        return end

    def _pass(self, end: str, *, last: bool) -> None:
        """Add the line that goes on behind an offset, unless nothing follows."""
        if not last:
            self.lines.add(f"o = {end}")

    def _wide(self, unit: Chars, *, last: bool) -> None:
        self._settle()
        end = self._check_end(f"4 * {self._counts[unit.path]}")
        target = self._slot(unit.path) if unit.path else self.root
        self.lines.add(f"{target} = _pieces.from_wide(view[o:{end}])")
        self._pass(end, last=last)

    def _numbers(self, unit: Numbers, *, last: bool) -> None:
        size, array = SIZES[unit.of.name], isinstance(unit.type, Array)
        length = str(unit.type.size * size) if isinstance(unit.type, Array) else self._counts[unit.path]
        if not array and size > 1:
            length = f"{size} * {length}"
        self._pad(unit.padding, size, None if array else self._counts[unit.path])
        self._settle()
        end = self._check_end(length)
        slot, raw = self._slot(unit.path), f"view[o:{end}]"
        if isinstance(unit.type, Array):
            name = self.lines.names.of(unit.path, self.root)
            self.lines.add(
                f"{name} = {raw}", f"{slot} = {self._array(Block(unit.path, unit.type, unit.of), name)}"
            )
        elif unit.of.name in _CONVERSIONS:
            self.lines.add(f"{slot} = _pieces.{_CONVERSIONS[unit.of.name]}(bytes({raw}))")
        else:
            self._sequence(unit, end)
        self._pass(end, last=last)

    def _sequence(self, unit: Numbers, end: str) -> None:
        """Add the lines that copy numbers into an array, or leave them for later where they are many."""
        code = TYPE_CODES[unit.of.name]
        empty = self.lines.table(f"no_{unit.of.name}", f"_array({code!r})")
        name = self.lines.names.of(unit.path, self.root)
        owner = self._owners[unit.path[:-1]]
        self.lines.add(
            f"if {end} - o <= limit:",
            f"    {self._slot(unit.path)} = {name} = {empty}[:]",
            f"    if {self._counts[unit.path]}:",
            f"        {name}.frombytes(view[o:{end}])",
            "else:",
            f"    _lazy.postpone({owner}, '_{unit.path[-1]}', view[o:{end}], {code!r})",
        )

    def _pad(self, padding: int | None, alignment: int, number: str | None) -> None:
        """Add the lines that pass the padding before elements, of which there may be none."""
        if padding == 0:
            return
        if number is None:
            if padding:
                self.number += padding
            else:
                self._align(alignment)
            return
        self._settle()
        passed = f"o += {padding}" if padding else f"o = {_rounded('o', alignment)}"
        self.lines.add(f"if {number}:", f"    {passed}")

    def _loop(self, unit: Loop, *, last: bool) -> None:
        array = isinstance(unit.type, Array)
        number = str(unit.type.size) if isinstance(unit.type, Array) else self._counts[unit.path]
        run = _batch(unit)
        if run:
            self._pad(unit.start.padding(run.alignment), run.alignment, None if array else number)
        self._settle()
        if not array and not run:
            least = f"{unit.body.least} * {number}" if unit.body.least > 1 else number
            self.lines.add(f"if {least} > size - o:", "    raise _pieces.Refused")
        if run:
            self._batched(unit, run, number, last=last)
        else:
            self._repeated(unit, number)
        self.known, self.number = False, 0

    def _repeated(self, unit: Loop, number: str) -> None:
        """Add a loop that reads one element after the other."""
        element = self.lines.names.new(singular(unit.path[-1]))
        inside = _Reader(self.lines, element, self.others, known=False)
        if unit.body.inner:
            self._make_all(unit, number, inside, ())
            inside.read(unit.body, tail=True, made=True)
        else:
            name = self.lines.names.of(unit.path, self.root)
            append = self.lines.names.new(f"append_{element}")
            self.lines.add(
                f"{self._slot(unit.path)} = {name} = []",
                f"{append} = {name}.append",
                f"for _ in range({number}):",
            )
            self.lines.deeper()
            inside.read(unit.body, tail=True)
            self.lines.add(f"{append}({element})")
        self.lines.back()

    def _batched(self, unit: Loop, run: Run, number: str, *, last: bool) -> None:
        """Add the loop over elements of one size, which are all unpacked in one go."""
        end = self._check_end(f"{sum(piece.size for piece in run.pieces)} * {number}")
        element = self.lines.names.new(singular(unit.path[-1]))
        inside = _Reader(self.lines, element, self.others, known=False)
        unpack = self.lines.table("iterate", f"_pieces.fixed({codes(run)!r}, 0).iter_unpack")
        self._make_all(unit, number, inside, (run, f"{unpack}(view[o:{end}])"))
        if len(unit.body.inner) == 1:
            self.lines.add("pass")
        self.lines.back()
        self._pass(end, last=last)

    def _make_all(
        self, unit: Loop, number: str, inside: _Reader, values: tuple[Run, str] | tuple[()]
    ) -> None:
        """Add the line that makes all elements, and begin a loop over them and over what is in them."""
        name = self.lines.names.of(unit.path, self.root)
        targets, sources, stores = [inside.root], [name], []
        inside._owners[()] = inside.root
        for inner in unit.body.inner:
            made = f"_new, _repeat({self.others.class_of(inner.name)}"
            if not inner.path:
                self.lines.add(f"{self._slot(unit.path)} = {name} = [*map({made}, {number}))]")
                continue
            local = inside._owners[inner.path] = self.lines.names.of(inner.path, inside.root)
            stores.append(f"{inside._slot(inner.path)} = {local}")
            targets.append(local)
            sources.append(f"map({made}))")
        if values:
            slots = inside._targets(values[0].members)
            targets.append(f"({', '.join(slots)}{',' if len(slots) == 1 else ''})")
            sources.append(values[1])
        if len(sources) == 1:
            self.lines.add(f"for {targets[0]} in {name}:")
        else:
            self.lines.add(
                *unpacked("for ", targets, " in zip("), *(f"    {each}," for each in sources), "):"
            )
        self.lines.deeper()
        self.lines.add(*stores)

    def _slot(self, path: Path) -> str:
        return f"{self._owners[path[:-1]]}._{path[-1]}"


def _fixed_behind(chars: Chars, after: Run | None) -> bool:
    """Tell if the padding of the run behind a string is known once its length is."""
    return after is None or after.is_fixed(Phase(chars.start.modulus, 0))


def _rounded(offset: str, alignment: int) -> str:
    """Return the expression that rounds an offset up; the header is no part of what is aligned."""
    if alignment <= HEADER_SIZE:
        return f"{offset} + {alignment - 1} & -{alignment}"
    return f"({offset} + {alignment - 1 - HEADER_SIZE} & -{alignment}) + {HEADER_SIZE}"


def _batch(unit: Loop) -> Run | None:
    """Return the run that each element is, if all of them have the same layout once the first is aligned."""
    steps = unit.body.steps
    if len(steps) != 1 or not isinstance(steps[0], Run):
        return None
    first = steps[0].members[0]
    run = Run(steps[0].members, Phase(first.alignment, 0))
    plain = all(
        isinstance(m, Value) and not m.hidden and m.type.name not in {"char", "wchar"} for m in run.members
    )
    return run if plain and first.alignment == run.alignment and not run.end(run.start).remainder else None
