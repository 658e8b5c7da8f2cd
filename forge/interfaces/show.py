"""The output of `ros2 interface show`: a definition with nested messages."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from forge.base.errors import InterfaceError, Problem
from forge.interfaces.model import (
    Named,
    TypeName,
    element_of,
)
from forge.interfaces.read.declarations import read_declaration
from forge.interfaces.read.literals import ParseError

MAX_LINES = 1_000_000
"""The maximum number of lines, which grows exponentially with the nesting of messages."""

_MAX_NESTING = 100


def parse_type_name(text: str, known: Callable[[], Iterable[TypeName]] = tuple) -> TypeName:
    """Parse 'package/kind/Name'; raises InterfaceError with the message of `ros2 interface`.

    `known` returns names for a suggestion.
    """
    parts = text.split("/")
    if len(parts) != 3:
        full = (str(name) for name in known() if f"{name.package}/{name.name}" == text)
        hint = next((f"did you mean '{name}'?" for name in full), None)
        message = f"Invalid name '{text}'. Expected three parts separated by '/'"
        raise InterfaceError(Problem(message, hint=hint))
    if not all(parts):
        raise InterfaceError(Problem(f"Invalid name '{text}'. Must not contain empty parts"))
    if ".." in parts:
        raise InterfaceError(Problem(f"Invalid name '{text}'. Must not contain '..'"))
    return TypeName(*parts)


def show(name: TypeName, comments: int, text_of: Callable[[TypeName], str]) -> Iterator[str]:
    """Yield the lines of an interface and of its nested messages, indented by one tab per level.

    `comments` is the number of levels on which comments and blank lines are shown. `text_of` returns the text
    of a definition. Omitted comments include their '#', unlike in ROS. Raises InterfaceError if a message
    contains itself or is too large; exceptions of `text_of` propagate.
    """
    for number, line in enumerate(_show(name, comments, text_of, ())):
        if number >= MAX_LINES:
            raise InterfaceError(Problem(f"'{name}' expands to more than {MAX_LINES} lines"))
        yield line


def _show(
    name: TypeName, comments: int, text_of: Callable[[TypeName], str], above: tuple[TypeName, ...]
) -> Iterator[str]:
    if name in above:
        path = " -> ".join(f"{each.package}/{each.name}" for each in (*above[above.index(name) :], name))
        raise InterfaceError(Problem(f"a message cannot contain itself: {path}"))
    if len(above) > _MAX_NESTING:
        message = f"messages in '{above[0]}' are nested more than {_MAX_NESTING} levels deep"
        raise InterfaceError(Problem(message))
    keep = len(above) < comments
    for written in text_of(name).removeprefix("\ufeff").splitlines():
        line = written.rstrip() if keep else written.partition("#")[0].rstrip()
        if line or keep:
            yield "\t" * len(above) + line if line else ""
        try:
            code = line.partition("#")[0].replace("\t", " ").rstrip()
            element = element_of(read_declaration(code, name.package).type)
        except ParseError:  # only a comment, a blank line or '---'
            continue
        if isinstance(element, Named):
            yield from _show(element.name, comments, text_of, (*above, name))
