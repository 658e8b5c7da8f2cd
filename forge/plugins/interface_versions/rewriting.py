"""Rewrite definitions of ROS 1, and names that ROS 2 rejects, into valid ROS 2 definitions; pure."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from itertools import takewhile

from forge.base.frozen import frozen
from forge.base.names import TYPE_NAME
from forge.interfaces.read.declarations import PRIMITIVES, check_keyword, valid_name
from forge.interfaces.read.literals import ParseError

BUILT_IN = {
    "Header": "std_msgs/Header",
    "duration": "builtin_interfaces/Duration",
    "time": "builtin_interfaces/Time",
}
"""The types that ROS 1 knows without a package."""

_NAMES_OF_TYPES = frozenset({*PRIMITIVES, *BUILT_IN, "string", "wstring"})
_DECLARATION = re.compile(
    r"[ \t]*(?P<type>[A-Za-z]\w*(?:/\w+)?)(?P<array>(?:<=\d+)?(?:\[[^\]\s]*\])?)(?P<gap>[ \t]+)"
    r"(?P<name>[A-Za-z_]\w*)(?P<rest>[ \t]*(?P<constant>=)?.*)",
    re.DOTALL,
)
_SEPARATOR = re.compile(r"-{3,}[ \t]*(?P<end>\r?\n?)")


@frozen
class Renamed:
    """A name of a field or a constant, before and after."""

    old: str
    new: str


def type_name(stem: str) -> str:
    """Return a valid ROS 2 name of an interface; unchanged if there is none."""
    if TYPE_NAME.fullmatch(stem):
        return stem
    name = "".join(part[:1].upper() + part[1:] for part in re.split(r"[\W_]+", stem))
    return name if TYPE_NAME.fullmatch(name) else stem


def rewritten(
    text: str, package: str, own: Collection[str], types: Mapping[str, str]
) -> tuple[str, list[Renamed]]:
    """Return the text of a definition with valid types and names, and the names that have changed.

    `own` are the interfaces of the package, `types` those that get other names. Comments, values and blanks
    stay, and so do errors that cannot be corrected.
    """
    renamed: list[Renamed] = []
    lines: list[str] = []
    taken: set[str] = set()
    whole = text.removeprefix("\ufeff").splitlines(keepends=True)
    for number, line in enumerate(whole):
        separator = _SEPARATOR.fullmatch(line)
        if separator or not number:
            taken = {*_valid_names(whole[number + bool(separator) :])}
        if separator:
            lines.append(f"---{separator['end']}")
            continue
        code, mark, comment = line.partition("#")
        declaration = _DECLARATION.fullmatch(code)
        if declaration is None:
            lines.append(line)
            continue
        name = declaration["name"]
        better = _better_name(declaration)
        if better not in taken:
            renamed.append(Renamed(name, better))
            taken.add(better)
            name = better
        type_ = _type(declaration["type"], package, own, types)
        start = f"{type_}{declaration['array']}{declaration['gap']}{name}"
        lines.append(f"{start}{declaration['rest']}{mark}{comment}")
    return "".join(lines), renamed


def _valid_names(lines: Iterable[str]) -> Iterator[str]:
    """Yield the unchanged names of a section, which ends with a separator."""
    for line in takewhile(lambda line: not _SEPARATOR.fullmatch(line), lines):
        declaration = _DECLARATION.fullmatch(line.partition("#")[0])
        if declaration and _better_name(declaration) == declaration["name"]:
            yield declaration["name"]


def _better_name(declaration: re.Match[str]) -> str:
    """Return a valid name for a declaration, or its own if that is valid or cannot be corrected."""
    name, kind = declaration["name"], "constant" if declaration["constant"] else "field"
    better = valid_name(name, kind) or name
    if kind == "field":
        try:
            check_keyword(better, 0, kind)
        except ParseError:
            better = f"{better}_value"
    return better


def _type(written: str, package: str, own: Collection[str], types: Mapping[str, str]) -> str:
    home, _, name = written.rpartition("/")
    if home in {"", package} and name in types and (home or name not in _NAMES_OF_TYPES):
        return f"{home}{'/' if home else ''}{types[name]}"
    return BUILT_IN.get(written, written) if written not in own else written
