"""Rewrite definitions of ROS 1, and names that ROS 2 rejects, into valid ROS 2 definitions; pure."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping

from forge.base.frozen import frozen
from forge.base.names import TYPE_NAME
from forge.interfaces.read.declarations import PRIMITIVES, check_keyword, valid_name
from forge.interfaces.read.literals import ParseError

BUILT_IN = {
    "Header": "std_msgs/Header",
    "duration": "builtin_interfaces/Duration",
    "time": "builtin_interfaces/Time",
}
"""The types that need no package name in ROS 1."""

_NAMES_OF_TYPES = frozenset({*PRIMITIVES, *BUILT_IN, "string", "wstring"})
_DECLARATION = re.compile(
    r"[ \t]*(?P<type>[A-Za-z]\w*(?:/\w+)?)(?P<array>(?:<=\d+)?(?:\[[^\]\s]*\])?)(?P<gap>[ \t]+)"
    r"(?P<name>[A-Za-z_]\w*)(?P<rest>[ \t]*(?P<constant>=)?.*)",
    re.DOTALL,
)
_FULL_NAME = re.compile(r"^(?P<start>[ \t]*)(?P<type>[A-Za-z]\w*/\w+)", re.MULTILINE)
_TEXT = re.compile(r"string[ \t]+(?P<name>\w+)[ \t]*=[ \t]*(?P<value>.*)", re.DOTALL)
_PREFIX = re.compile(r"(?<=enum: )(?P<prefix>[A-Za-z]\w*_)(?=\*\s*$)")
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

    `own` are the interfaces of the package, `types` maps full old names of types to new names. Comments,
    values, blanks, and errors that cannot be corrected are kept; the prefix of an enumeration changes with
    its constants.
    """
    renamed: list[Renamed] = []
    parts: list[str] = []
    for start, lines in _sections(text):
        declarations = [_DECLARATION.fullmatch(line.partition("#")[0]) for line in lines]
        better = [_better_name(each) if each else "" for each in declarations]
        taken = {
            name for each, name in zip(declarations, better, strict=True) if each and each["name"] == name
        }
        constants: dict[str, str] = {}
        for number, declaration in enumerate(declarations):
            if declaration is None:
                continue
            name = declaration["name"]
            if better[number] not in taken:
                renamed.append(Renamed(name, better[number]))
                taken.add(better[number])
                name = better[number]
            if declaration["constant"]:
                constants[declaration["name"]] = name
            type_ = _type(declaration["type"], package, own, types)
            code = f"{type_}{declaration['array']}{declaration['gap']}{name}{declaration['rest']}"
            lines[number] = code + lines[number][declaration.end() :]
        parts += (start, *(_with_prefix(line, constants) for line in lines))
    return "".join(parts), renamed


def retyped(text: str, types: Mapping[str, str]) -> str:
    """Return the text of a definition of another package with the new names of the types."""
    return _FULL_NAME.sub(lambda each: each["start"] + _type(each["type"], "", (), types), text)


def texts_of_ros1(text: str) -> list[dict[str, str]]:
    """Return the values that ROS 1 gives to the constants of type string in each section, by name.

    Quotes and text after a '#' belong to them.
    """
    matches = [map(_TEXT.fullmatch, map(str.strip, lines)) for _, lines in _sections(text)]
    return [{each["name"]: each["value"] for each in section if each} for section in matches]


def _sections(text: str) -> Iterator[tuple[str, list[str]]]:
    """Yield the valid separator before each section, and its lines."""
    start, lines = "", list[str]()
    for line in text.removeprefix("\ufeff").splitlines(keepends=True):
        if separator := _SEPARATOR.fullmatch(line):
            yield start, lines
            start, lines = f"---{separator['end']}", []
        else:
            lines.append(line)
    yield start, lines


def _with_prefix(line: str, constants: Mapping[str, str]) -> str:
    """Return a line whose comment names an enumeration by the current prefix of its constants."""
    code, mark, comment = line.partition("#")

    def better(match: re.Match[str]) -> str:
        prefix = match["prefix"]
        members = [new for old, new in constants.items() if old.startswith(prefix)]
        new_prefix = (valid_name(f"{prefix}X", "constant") or prefix).removesuffix("X")
        return new_prefix if members and all(new.startswith(new_prefix) for new in members) else prefix

    return code + mark + _PREFIX.sub(better, comment)


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


def _type(text: str, package: str, own: Collection[str], types: Mapping[str, str]) -> str:
    home, _, name = text.rpartition("/")
    if (full_name := f"{home or package}/{name}") in types and (home or name not in _NAMES_OF_TYPES):
        return f"{home}{'/' if home else ''}{types[full_name]}"
    return BUILT_IN.get(text, text) if text not in own else text
