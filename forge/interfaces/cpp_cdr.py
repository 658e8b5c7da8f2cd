"""How messages lie on the wire, as C++ tells a sizer, a writer or a reader of the header-only forge_cdr."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING

from forge.interfaces.cpp_text import qualified
from forge.interfaces.model import Named, Sequence
from forge.interfaces.wire import ANYWHERE, Chars, Count, Loop, Numbers, Run, Shared, Value

if TYPE_CHECKING:
    from collections.abc import Iterator

    from forge.interfaces.model import TypeName
    from forge.interfaces.unfolding import Layouts
    from forge.interfaces.wire import Layout, Member, Path, Step

_WIDTH = 100
_NEVER_COPIED = frozenset({"boolean", "wchar"})
"""Not every byte is a bool, and a wchar takes twice the bytes that it has in memory."""


@dataclass(frozen=True, slots=True)
class MembersView:
    """The specialisation of forge_cdr::Members for a message, as finished strings."""

    type: str
    constants: tuple[str, ...]
    statements: tuple[str, ...]
    needs: frozenset[TypeName]
    """The messages whose own specialisations this one asks for."""


def members_view(name: TypeName, layouts: Layouts) -> MembersView:
    """Return what is said about a message; it holds wherever in other messages it begins."""
    layout = layouts.of(name, ANYWHERE)
    packed, alignment = _packed(layout)
    constants = [f"least = {layout.least};", f"packed = {packed};"]
    if packed:
        constants.append(f"alignment = {alignment};")
    return MembersView(
        type=f"{qualified(name)}_",
        constants=tuple(constants),
        statements=tuple(chain.from_iterable(map(_statements, layout.steps))),
        needs=frozenset(chain.from_iterable(map(_needs, layout.steps))),
    )


def _packed(layout: Layout) -> tuple[int, int]:
    """Return the size and the alignment of a message that never has padding, else zeros.

    Such messages lie side by side without gaps if the first one is aligned for all its members.
    """
    match layout.steps:
        case (Run(members) as run,) if run.count is None and all(map(_is_copied, members)):
            size = sum(member.size for member in members)
            gaps = any(map(sum, (piece.paddings for piece in run.pieces)))
            if len(run.pieces) == 1 and not gaps and not size % run.alignment:
                return size, run.alignment
    return 0, 0


def _is_copied(member: Member) -> bool:
    """Tell if a member's bytes in memory are those on the wire."""
    of = member.type if isinstance(member, Value) else getattr(member, "of", None)
    return of is not None and of.name not in _NEVER_COPIED


def _statements(step: Step) -> Iterator[str]:
    """Yield the statements that move what a step is about; all but the first ones are indented alike."""
    match step:
        case Run(members):
            for group in _groups(tuple(member for member in members if not isinstance(member, Count))):
                yield _call("fixed", *(member.path for member in group))
        case Chars(path):
            yield _call("text", path)
        case Numbers(path, type_) | Loop(path, type_):
            yield _call("sequence" if isinstance(type_, Sequence) else _word(step), path)
        case Shared(path):
            yield _call("message", path)


def _word(step: Numbers | Loop) -> str:
    """Return the word for an array: numbers are as good as one value."""
    return "fixed" if isinstance(step, Numbers) else "array"


def _groups(members: tuple[Member, ...]) -> Iterator[list[Member]]:
    """Yield neighbours with known padding between them, wherever the first of them lies."""
    group: list[Member] = []
    for member in members:
        if group and member.alignment > group[0].alignment:
            yield group
            group = []
        group.append(member)
    if group:
        yield group


def _call(word: str, *paths: Path) -> str:
    """Return the call, its arguments on as many lines as they need."""
    arguments = [".".join(("message", *path)) for path in paths]
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


def _needs(step: Step) -> Iterator[TypeName]:
    match step:
        case Shared(_, name):
            yield name
        case Loop(_, type_) if isinstance(type_.of, Named):
            yield type_.of.name
