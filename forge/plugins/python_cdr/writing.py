"""Generate the Python function that serializes a message, from its layout.

The function collects pieces of bytes and joins them once: the results of Structs for adjacent members, and
arrays unchanged. Where padding depends on lengths, it tracks the offset in `o`. Only the remainder of `o`
matters for alignment, so `o` is reset to a constant wherever the remainder is known again.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from forge.base.names import snake_case
from forge.interfaces.model import Array, Primitive, Sequence, String
from forge.interfaces.wire.layout import (
    MAX_ALIGNMENT,
    SIZES,
    InlineArray,
    Length,
    Loop,
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
    group_steps,
    singular,
    struct_format,
    wrap_arguments,
)

_READABLE = 60
"""Longer calls get a separate line."""

_WIDENED = frozenset({"char", "wchar"})


def emit_writer(lines: FunctionSource, layout: MessageLayout) -> None:
    """Emit the body of a function that returns the bytes of a message."""
    groups = group_steps(layout.steps)
    writer = _Writer(lines, "message")
    if not (isinstance(groups[0], PackedGroup) and groups[0].before):
        writer.pieces.append("_HEADER_BYTES")
    writer.sole = not writer.pieces and len(groups) == 1
    writer.write(groups, layout.end, keep_offset=False)
    writer.finish()


def emit_part_writer(lines: FunctionSource, layout: MessageLayout) -> None:
    """Emit the body of a function that appends the pieces of a message and returns the offset after it."""
    writer = _Writer(lines, "message", appending=True)
    writer.write(group_steps(layout.steps), Phase(1, 0), keep_offset=True)
    lines.add("return o")


def _offset_needed(groups: tuple[Group, ...], end: Phase, *, keep_offset: bool) -> list[bool]:
    """Return for each group, and for the end, whether `o` must be valid at its start."""
    needed = [keep_offset]
    after = end
    for group in reversed(groups):
        needed.append(_is_dynamic(group) or (needed[-1] and after.modulus < MAX_ALIGNMENT))
        after = group.start
    return needed[::-1]


def _is_dynamic(group: Group) -> bool:
    """Return True if the padding of a group depends on the message."""
    match group:
        case PackedGroup():
            return not group.fixed
        case PrimitiveElements():
            return group.padding is None
        case Loop():
            return _offset_needed(group_steps(group.body.steps), group.body.end, keep_offset=False)[0]
        case MessageCall():
            return True
        case StringData():
            return False


@dataclass(slots=True)
class _Writer:
    """Emits the lines that write one message, or one element of a loop."""

    lines: FunctionSource
    root: str
    """The local name of the message or element."""
    appending: bool = False
    """Whether to append each piece to a list, instead of joining all in one expression."""
    sole: bool = False
    """Whether the result is a single piece, which is returned without joining."""
    pieces: list[str] = field(default_factory=list)
    _owners: dict[Path, str] = field(default_factory=dict)
    _locals: dict[Path, tuple[str, str]] = field(default_factory=dict)
    """The local names of a sequence, or of the bytes of a string, and of its length."""

    def write(self, groups: tuple[Group, ...], end: Phase, *, keep_offset: bool) -> None:
        """Emit the lines for all groups; with `keep_offset`, `o` is valid after the last."""
        needed = _offset_needed(groups, end, keep_offset=keep_offset)
        if needed[0] and self.pieces:
            self._set_offset(groups[0].start)
        for index, group in enumerate(groups):
            following = groups[index + 1].start if index + 1 < len(groups) else end
            is_aligned = following.modulus == MAX_ALIGNMENT
            self._group(group, counting=needed[index + 1] and not is_aligned)
            if needed[index + 1] and is_aligned:
                self._set_offset(following)

    def finish(self) -> None:
        if self.appending:
            self.lines.add('return b"".join(parts)')
        elif self.pieces:
            self.lines.add(*wrap_arguments('return b"".join((', self.pieces, "))"))

    def _set_offset(self, phase: Phase) -> None:
        self.lines.add(f"o = {(phase.remainder + HEADER_SIZE) % MAX_ALIGNMENT}")

    def _group(self, group: Group, *, counting: bool) -> None:
        match group:
            case PackedGroup():
                self._packed(group, counting=counting)
            case StringData(path):
                self._piece(self._locals[path][0], counting=counting)
            case PrimitiveElements():
                self._numbers(group, counting=counting)
            case Loop():
                self._loop(group, counting=counting)
            case MessageCall(path, name):
                self._start_appending()
                factory = self.lines.module.factory_call("part_writer", name)
                write = self.lines.table(f"write_{snake_case(name.name)}", factory)
                self.lines.add(f"o = {write}({self._owner(path)}, append, o)")

    def _piece(self, expression: str, *, counting: bool, first: bool = False) -> None:
        if counting and not expression.isidentifier():
            name = self.lines.name("piece")
            self.lines.add(f"{name} = {expression}")
            expression = name
        if self.appending:
            self.lines.add(f"append({expression})")
        else:
            self.pieces.append(expression)
        if counting:
            self.lines.add(f"o {'' if first else '+'}= len({expression})")

    def _packed(self, group: PackedGroup, *, counting: bool) -> None:
        with_header = not self.appending and not self.pieces
        start = -HEADER_SIZE if with_header else group.start.remainder
        before = f"{'I ' if with_header else ''}{struct_format(group.before)}"
        values = ["_HEADER"] if with_header else []
        values += self._values(group.before)
        if group.chars:
            text, length = self._locals[group.chars.path]
            values.append(text)
        values += self._values(group.after)
        if group.chars and group.fixed:
            arguments = f"{before!r}, {struct_format(group.after)!r}, {start}"
            packer = f"{self.lines.table('texts', f'_pieces.texts({arguments})')}[{length}].pack"
        elif group.chars:
            table = f"_pieces.phased_texts({before!r}, {struct_format(group.after)!r})"
            packer = f"{self.lines.table('texts', table)}[o & 7][{length}].pack"
        elif group.fixed:
            packer = self.lines.table("pack", f"_pieces.fixed({before!r}, {start}).pack")
        else:
            packer = f"{self.lines.table('structs', f'_pieces.phased({before!r})')}[o & 7].pack"
        call = f"{packer}({', '.join(values)})"
        named = counting or not group.fixed
        if not named and self.appending:
            self.lines.add(*wrap_arguments(f"append({packer}(", values, "))"))
        elif not named and self.sole:
            self.lines.add(*wrap_arguments(f"return {packer}(", values, ")"))
        elif not named and len(call) <= _READABLE:
            self.pieces.append(call)
        else:
            name = self.lines.name("piece")
            self.lines.add(*wrap_arguments(f"{name} = {packer}(", values, ")"))
            self._piece(name, counting=counting, first=with_header)

    def _values(self, run: Run | None) -> list[str]:
        values = []
        for member in run.members if run else ():
            match member:
                case Scalar(hidden=True):
                    pass
                case Scalar(path, type_):
                    word = self._attribute(path)
                    values.append(f"_pieces.to_{type_.name}({word})" if type_.name in _WIDENED else word)
                case InlineArray():
                    values.append(self._block(member))
                case Length(path, type_):
                    values.append(self._count(path, type_))
        return values

    def _block(self, block: InlineArray, *, copied: bool = True) -> str:
        """Emit the lines that check the bytes of an array, copied or in place; return their local name."""
        word = self._attribute(block.path)
        name = self.lines.name("_".join(block.path) or self.root)
        expression, size = (f"{word}.tobytes()", f"len({name})") if copied else (word, f"{name}.nbytes")
        if block.of.name in CONVERTED:
            expression, size = f"_pieces.to_{CONVERTED[block.of.name]}({word})", f"len({name})"
        self.lines.add(f"{name} = {expression}")
        self.lines.reject_if(f"{size} != {block.size}")
        return name

    def _count(self, path: Path, type_: String | Sequence) -> str:
        """Emit the lines that encode a string or convert a sequence; return the length to write."""
        word = self._attribute(path)
        name = self.lines.name("_".join(path) or self.root) if path else self.lines.name("text")
        number = self.lines.name(f"{name}_size")
        expression, length = word, f"len({name})"
        if isinstance(type_, String):
            expression = f"_pieces.to_wide({word})" if type_.wide else f"{word}.encode()"
            length = f"len({name}) >> 2" if type_.wide else length
        elif isinstance(type_.of, Primitive) and type_.of.name in CONVERTED:
            expression = f"_pieces.to_{CONVERTED[type_.of.name]}({word})"
            length = f"len({name}) >> 2" if type_.of.name == "wchar" else length
        self.lines.add(f"{name} = {expression}", f"{number} = {length}")
        if type_.bound is not None:
            # The bound of a string counts characters, which take at least a byte or a code unit each.
            exact = f" and len({word}) > {type_.bound}" if isinstance(type_, String) else ""
            self.lines.reject_if(f"{number} > {type_.bound}{exact}")
        self._locals[path] = (name, number)
        return f"{number} + 1" if isinstance(type_, String) and not type_.wide else number

    def _numbers(self, group: PrimitiveElements, *, counting: bool) -> None:
        size = SIZES[group.of.name]
        if isinstance(group.type, Array):
            block = InlineArray(group.path, group.type, group.of)
            empty, length = "", str(block.size)
            name = self._block(block, copied=False)
        else:
            name, number = self._locals[group.path]
            empty = f' if {number} else b""'
            length = number if size == 1 else f"{size} * {number}"
        if group.padding is None:
            table = self.lines.table(f"padding_{size}", f"_pieces.paddings({size})")
            padding = self.lines.name("padding")
            self.lines.add(f"{padding} = {table}[o & 7]{empty}")
            self._piece(padding, counting=counting)
        elif group.padding:
            self._piece(f"{bytes(group.padding)!r}{empty}", counting=counting)
        self._piece(name, counting=False)
        if counting:
            self.lines.add(f"o += {length}")

    def _loop(self, group: Loop, *, counting: bool) -> None:
        self._start_appending()
        if group.path in self._locals:
            name = self._locals[group.path][0]
        else:
            name = self.lines.name("_".join(group.path) or self.root)
            self.lines.add(f"{name} = {self._attribute(group.path)}")
        if isinstance(group.type, Array):
            self.lines.reject_if(f"len({name}) != {group.type.size}")
        groups = group_steps(group.body.steps)
        element = self.lines.name(singular(group.path[-1]))
        self.lines.add(f"for {element} in {name}:")
        self.lines.indent()
        inside = _Writer(self.lines, element, appending=True)
        keep_offset = counting or _offset_needed(groups, group.body.end, keep_offset=False)[0]
        inside.write(groups, group.body.end, keep_offset=keep_offset)
        self.lines.dedent()

    def _start_appending(self) -> None:
        """Store the pieces so far in a list, and append the following ones to it."""
        if not self.appending:
            self.lines.add(*wrap_arguments("parts = [", self.pieces, "]"), "append = parts.append")
            self.appending = True

    def _attribute(self, path: Path) -> str:
        """Return the expression for a member, or for the element of the loop if the path is ()."""
        return f"{self._owner(path[:-1])}._{path[-1]}" if path else self.root

    def _owner(self, path: Path) -> str:
        """Return the local name of a message, and emit its assignment on first use."""
        if not path:
            return self.root
        if path not in self._owners:
            word = f"{self._owner(path[:-1])}._{path[-1]}"
            self._owners[path] = self.lines.name("_".join(path) or self.root)
            self.lines.add(f"{self._owners[path]} = {word}")
        return self._owners[path]
