"""Definitions to layouts on the wire: nested messages unfolded, fixed-size neighbours gathered into runs."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from forge.base.frozen import frozen
from forge.interfaces.model import Array, Named, Primitive, Sequence, String
from forge.interfaces.wire.layout import (
    SIZES,
    START,
    UNKNOWN,
    InlineArray,
    InlinedMessage,
    Length,
    Loop,
    MessageCall,
    MessageLayout,
    Phase,
    PrimitiveElements,
    Run,
    Scalar,
    StringData,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.interfaces.model import Element, Message, Type, TypeName
    from forge.interfaces.wire.layout import LayoutStep, Member, Path

RUN_ARRAY_LIMIT: Final = 512
"""An array of more bytes than this is moved on its own: beside it, a copy saved on a run is nothing."""

INLINE_LIMIT: Final = 64
"""A message of more steps and members than this is not unfolded inside others."""


@frozen
class LayoutBuilder:
    """The layouts of all messages of a catalog, by the definitions in `known`."""

    known: Mapping[TypeName, Message]
    _weights: dict[TypeName, int] = field(default_factory=dict)

    def of(self, name: TypeName, start: Phase = START) -> MessageLayout:
        """Return the layout of a message, itself unfolded however large."""
        flat = _Flattening(self, start)
        flat.add_members((), name)
        return flat.layout()

    def of_element(self, type_: Type, start: Phase) -> MessageLayout:
        """Return the layout of a collection's element, or of a member alone; its path is ()."""
        flat = _Flattening(self, start)
        flat.add((), type_)
        return flat.layout()

    def is_large(self, name: TypeName) -> bool:
        """Tell if other messages refer to this one's layout instead of unfolding it."""
        return self._weight(name) > INLINE_LIMIT

    def _weight(self, name: TypeName) -> int:
        if name not in self._weights:
            members = self.known[name].members
            self._weights[name] = sum(self._weight_of(member.type) for member in members)
        return self._weights[name]

    def _weight_of(self, type_: Type) -> int:
        match type_:
            case Array(of) | Sequence(of):
                return 1 + self._weight_of(of)
            case Named(name):
                return 1 if self.is_large(name) else self._weight(name)
            case _:
                return 1


@dataclass(slots=True)
class _Flattening:
    """A layout in the making."""

    layouts: LayoutBuilder
    start: Phase
    steps: list[LayoutStep] = field(default_factory=list)
    inner: list[InlinedMessage] = field(default_factory=list)
    run: list[Member] = field(default_factory=list)
    phase: Phase = UNKNOWN
    """What is known where the run being gathered begins."""

    def __post_init__(self) -> None:
        self.phase = self.start

    def layout(self) -> MessageLayout:
        """Return what has been gathered."""
        self._close()
        return MessageLayout(tuple(self.steps), tuple(self.inner), self.start, self.phase)

    def add_members(self, path: Path, name: TypeName) -> None:
        """Add all members of a message."""
        message = self.layouts.known[name]
        for member in message.members:
            inside = (*path, member.name)
            if message.fields:
                self.add(inside, member.type)
            else:
                self.run.append(Scalar(inside, Primitive("uint8"), hidden=True))

    def add(self, path: Path, type_: Type) -> None:
        """Add one member."""
        match type_:
            case Primitive():
                self.run.append(Scalar(path, type_))
            case String():
                self.run.append(Length(path, type_))
                self._close()
                self._step(StringData(path, type_, self.phase), Phase(4, 0) if type_.wide else UNKNOWN)
            case Named(name) if self.layouts.is_large(name):
                self._close()
                self._step(MessageCall(path, name, self.phase), UNKNOWN)
            case Named(name):
                self.inner.append(InlinedMessage(path, name))
                self.add_members(path, name)
            case Array() | Sequence():
                self._add_collection(path, type_)

    def _add_collection(self, path: Path, type_: Array | Sequence) -> None:
        of = type_.of
        if (
            isinstance(type_, Array)
            and isinstance(of, Primitive)
            and type_.size * SIZES[of.name] <= RUN_ARRAY_LIMIT
        ):
            self.run.append(InlineArray(path, type_, of))
            return
        if isinstance(type_, Sequence):
            self.run.append(Length(path, type_))
        self._close()
        start = self.phase
        if isinstance(of, Primitive):
            end = _phase_after(start.aligned(SIZES[of.name]), SIZES[of.name], type_)
            step: LayoutStep = PrimitiveElements(path, type_, of, start)
        else:
            body = self._body(of)
            end = body.end
            step = Loop(path, type_, body, start)
        self._step(step, start.either(end) if isinstance(type_, Sequence) else end)

    def _body(self, of: Element) -> MessageLayout:
        """Return the layout that holds for the first element as well as for those behind others."""
        body = self.layouts.of_element(of, self.phase)
        while (start := body.start.either(body.end)) != body.start:
            body = self.layouts.of_element(of, start)
        return body

    def _step(self, step: LayoutStep, end: Phase) -> None:
        self.steps.append(step)
        self.phase = end

    def _close(self) -> None:
        """End the run."""
        if self.run:
            run = Run(tuple(self.run), self.phase)
            self._step(run, run.end(self.phase))
            self.run.clear()


def _phase_after(first: Phase, size: int, type_: Array | Sequence) -> Phase:
    """Return the phase behind values of a size, the first of which lies at a known phase."""
    if isinstance(type_, Array):
        return first.after(type_.size * size)
    return first.either(first.after(size))
