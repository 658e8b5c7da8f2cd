"""The serialized layout of messages as C++ templates, for the sizer, writer and reader of forge_cdr."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field
from types import SimpleNamespace

from forge.base.frozen import frozen
from forge.interfaces.cpp.text import qualified
from forge.interfaces.model import Array, Named, Sequence, String, TypeName
from forge.interfaces.wire.layout import (
    UNKNOWN,
    InlineArray,
    LayoutBuilder,
    LayoutStep,
    Length,
    Loop,
    Member,
    MessageCall,
    MessageLayout,
    Path,
    PrimitiveElements,
    Run,
    Scalar,
    StringData,
)

_WIDTH = 100
_NEVER_COPIED = frozenset({"boolean", "wchar"})
"""Not every byte is a valid bool, and a wchar is serialized with twice its size in memory."""


@frozen
class _Shape:
    """The layout of a message; `size` and `alignment` are 0 unless it is copied in one piece."""

    layout: MessageLayout
    min_size: int
    size: int
    alignment: int


@frozen
class MembersViews:
    """Creates the specializations of forge_cdr::Members for the messages of a catalog."""

    layouts: LayoutBuilder
    _shapes: dict[TypeName, _Shape] = field(default_factory=dict)

    def of(self, name: TypeName) -> SimpleNamespace:
        """Return the specialization for a message, which is valid at any start offset.

        `needs` are the messages whose specializations it uses.
        """
        shape = self._shape(name)
        layout, size = shape.layout, shape.size
        constants = (f"least = {shape.min_size};", f"packed = {size};", f"alignment = {shape.alignment};")
        wholes: dict[Path, TypeName] = {}  # the outermost nested messages that are copied in one piece
        for path, inner in layout.inlined:
            if self._shape(inner).size and _outermost(path, wholes) is None:
                wholes[path] = inner
        needs = set(wholes.values())
        for step in layout.steps:
            match step:
                case MessageCall(_, needed) | Loop(_, Array(Named(needed)) | Sequence(Named(needed))):
                    needs.add(needed)
        return SimpleNamespace(
            type=f"{qualified(name)}_",
            constants=constants if size else constants[:2],
            storage="static" if self.layouts.is_large(name) else "[[gnu::always_inline]] static",
            statements=[line for step in layout.steps for line in self._statements(step, wholes)],
            needs=needs,
        )

    def _shape(self, name: TypeName) -> _Shape:
        if name not in self._shapes:
            layout = self.layouts.of(name, UNKNOWN)
            min_size = layout.min_size + sum(map(self._nested_size, layout.steps))
            self._shapes[name] = _Shape(layout, min_size, *_packed(layout))
        return self._shapes[name]

    def _nested_size(self, step: LayoutStep) -> int:
        """Return the size to add to the minimum size of a step, which counts a MessageCall as one byte.

        The reader limits memory in proportion to the minimum size, so it must be accurate.
        """
        match step:
            case MessageCall(_, name):
                return self._shape(name).min_size - 1
            case Loop(_, Array(_, count), body):
                return count * sum(map(self._nested_size, body.steps))
            case _:
                return 0

    def _statements(self, step: LayoutStep, wholes: Mapping[Path, TypeName]) -> Iterator[str]:
        match step:
            case Run(members):
                # The padding between the members of a statement is known for any offset of the first one.
                group: list[Path] = []
                first = 0
                for path, alignment in self._leaves(members, wholes):
                    if group and alignment > first:
                        yield _call("fixed", *group)
                        group = []
                    first = first if group else alignment
                    group.append(path)
                if group:
                    yield _call("fixed", *group)
            case StringData(path, type_):
                yield _call("text", path, bound=type_.bound)
            case PrimitiveElements(path, Array()):
                yield _call("fixed", path)
            case PrimitiveElements(path):
                yield _call("sequence", path)
            case Loop(path, type_):
                word = "array" if isinstance(type_, Array) else "sequence"
                bound = type_.of.bound if isinstance(type_.of, String) else None
                yield _call(word, path, bound=bound)
            case MessageCall(path):
                yield _call("message", path)

    def _leaves(
        self, members: Iterable[Member], wholes: Mapping[Path, TypeName]
    ) -> Iterator[tuple[Path, int]]:
        """Yield path and alignment of what is copied in one piece; lengths are serialized with their data."""
        visited: set[Path] = set()
        for member in members:
            whole = _outermost(member.path, wholes)
            if whole is None and not isinstance(member, Length):
                yield member.path, member.alignment
            elif whole is not None and whole not in visited:
                visited.add(whole)
                yield whole, self._shape(wholes[whole]).alignment


def _packed(layout: MessageLayout) -> tuple[int, int]:
    """Return size and alignment of a message whose serialized bytes equal those in memory, else zeros.

    Consecutive messages of this kind have no padding between them if the first one is aligned.
    """
    match layout.steps:
        case (Run(members) as run,) if all(map(_is_copied, members)):
            size = sum(member.size for member in members)
            gaps = any(map(sum, (piece.paddings for piece in run.segments)))
            if len(run.segments) == 1 and not gaps and not size % run.alignment:
                return size, run.alignment
    return 0, 0


def _is_copied(member: Member) -> bool:
    match member:
        case Scalar(_, of) | InlineArray(_, _, of):
            return of.name not in _NEVER_COPIED
        case Length():
            return False


def _outermost(path: Path, wholes: Mapping[Path, TypeName]) -> Path | None:
    """Return the path of the message in `wholes` that contains a member, or None."""
    return next((path[:length] for length in range(1, len(path) + 1) if path[:length] in wholes), None)


def _call(word: str, *paths: Path, bound: int | None = None) -> str:
    arguments = [".".join(("message", *path)) for path in paths]
    if bound is not None:
        arguments.append(f"{bound}u")
    line = f"cdr.{word}({', '.join(arguments)});"
    if len(line) <= _WIDTH - 4:
        return line
    lines = [""]
    for argument in arguments:
        if lines[-1] and len(lines[-1]) + len(argument) > _WIDTH - 9:
            lines.append("")
        lines[-1] += f" {argument}," if lines[-1] else f"{argument},"
    joined = "\n      ".join(lines)
    return f"cdr.{word}(\n      {joined[:-1]});"
