"""Assignment targets of a generated reader: slots of messages, and conversions of the values."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from forge.interfaces.model import Sequence
from forge.interfaces.python.cdr_text import assignment
from forge.interfaces.python.types import DTYPES
from forge.interfaces.wire.layout import InlineArray, Length, Scalar

if TYPE_CHECKING:
    from collections.abc import Iterable

    from forge.interfaces.python.cdr_text import FunctionSource
    from forge.interfaces.wire.layout import Member, Path

CONVERSIONS = {"boolean": "from_flags", "octet": "from_octets", "char": "from_chars", "wchar": "from_wchars"}
"""The run-time functions for collections that are stored as neither numpy arrays nor arrays."""


@dataclass(slots=True)
class Slots:
    """The messages being read, and the lengths that were read."""

    lines: FunctionSource
    root: str
    """The local name of the message, or of the element of a loop."""
    conversions: list[str] = field(default_factory=list)
    """The lines that check and convert values after they were unpacked."""
    _owners: dict[Path, str] = field(default_factory=dict)
    _lengths: dict[Path, str] = field(default_factory=dict)

    def slot(self, path: Path) -> str:
        """Return the expression for a slot; () is the element itself."""
        return f"{self.owner(path[:-1])}._{path[-1]}" if path else self.root

    def owner(self, path: Path) -> str:
        """Return the local name of a message."""
        return self._owners[path] if path else self.root

    def length(self, path: Path) -> str:
        """Return the local name of a length."""
        return self._lengths[path]

    def new_owner(self, path: Path) -> str:
        """Return a new local name for the message at a path."""
        self._owners[path] = self.local(path)
        return self._owners[path]

    def local(self, path: Path) -> str:
        """Return a new local name for the value at a path, or the existing name of the element itself."""
        return self.lines.names.of(path, self.root) if path else self.root

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
                name = self._lengths[path] = self.lines.names.new(f"{'_'.join(path) or self.root}_size")
                if isinstance(type_, Sequence) and type_.bound is not None:
                    self.conversions += [f"if {name} > {type_.bound}:", "    raise _pieces.Refused"]
                return name

    def array(self, block: InlineArray, raw: str) -> str:
        """Return the expression that creates an array from its bytes."""
        if block.of.name in CONVERSIONS:
            return f"_pieces.{CONVERSIONS[block.of.name]}({raw})"
        dtype = self.lines.table(DTYPES[block.of.name], f"_numpy.dtype({DTYPES[block.of.name]!r})")
        return f"_ndarray(({block.type.size},), {dtype}, bytearray({raw}))"
