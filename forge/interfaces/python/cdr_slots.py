"""Where a generated reader puts what it reads, as text: slots of messages, and what is done on the way."""

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
"""The run time's functions for collections that are neither numpy's nor array's."""


@dataclass(slots=True)
class Slots:
    """The messages being read, and the counts of elements to read."""

    lines: FunctionSource
    root: str
    """The local name of the message, or of the loop's element."""
    later: list[str] = field(default_factory=list)
    """What is to be done with unpacked values, once they are."""
    _owners: dict[Path, str] = field(default_factory=dict)
    _counts: dict[Path, str] = field(default_factory=dict)

    def slot(self, path: Path) -> str:
        """Return the expression for a slot; () is the element itself."""
        return f"{self.owner(path[:-1])}._{path[-1]}" if path else self.root

    def owner(self, path: Path) -> str:
        """Return the local name of a message."""
        return self._owners[path] if path else self.root

    def count(self, path: Path) -> str:
        """Return the local name of what a run has counted."""
        return self._counts[path]

    def hold(self, path: Path) -> str:
        """Return a new local name for the message at a path."""
        self._owners[path] = self.local(path)
        return self._owners[path]

    def local(self, path: Path) -> str:
        """Return a new local name for what lies at a path; the element itself has one."""
        return self.lines.names.of(path, self.root) if path else self.root

    def unpack(self, targets: list[str], call: str) -> None:
        """Add the line that unpacks values, and those that turn them into what fields hold."""
        if len(targets) == 1:
            self.lines.add(f"({targets[0]},) = {call}")
        else:
            self.lines.add(*(assignment("", targets, f" = {call}") if targets else [call]))
        self.lines.add(*self.later)
        self.later.clear()

    def targets(self, members: Iterable[Member]) -> list[str]:
        """Return what the values of a run are unpacked to; what else they need is put off."""
        return [target for member in members if (target := self._target(member))]

    def _target(self, member: Member) -> str | None:
        match member:
            case Scalar(hidden=True):
                return None
            case Scalar(path, type_) if type_.name in {"char", "wchar"}:
                name = self.local(path)
                self.later.append(f"{self.slot(path)} = _pieces.{type_.name}({name})")
                return name
            case Scalar(path):
                return self.slot(path)
            case InlineArray(path):
                name = self.local(path)
                self.later.append(f"{self.slot(path)} = {self.array(member, name)}")
                return name
            case Length(path, type_):
                name = self._counts[path] = self.lines.names.new(f"{'_'.join(path) or self.root}_size")
                if isinstance(type_, Sequence) and type_.bound is not None:
                    self.later += [f"if {name} > {type_.bound}:", "    raise _pieces.Refused"]
                return name

    def array(self, block: InlineArray, raw: str) -> str:
        """Return the expression that makes an array of its bytes."""
        if block.of.name in CONVERSIONS:
            return f"_pieces.{CONVERSIONS[block.of.name]}({raw})"
        dtype = self.lines.table(DTYPES[block.of.name], f"_numpy.dtype({DTYPES[block.of.name]!r})")
        return f"_ndarray(({block.type.size},), {dtype}, bytearray({raw}))"
