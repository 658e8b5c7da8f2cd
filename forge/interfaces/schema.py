"""Read schemas: a definition and all referenced ones in one text, as in MCAP files and rosbag2."""

from __future__ import annotations

import re
from pathlib import Path

from forge.base.errors import InterfaceError, Location, Problem
from forge.base.names import LOWER_NAME
from forge.interfaces.model import Source, TypeName

SEPARATOR = "=" * 80
_HEADING = re.compile(r"(MSG|SRV|IDL): (\w+)/(?:(\w+)/)?(\w+)\s*")


def read_schema(text: str, name: TypeName) -> tuple[Source, ...]:
    """Split a schema into its definitions; the first one is that of `name` unless it has a heading.

    Raises InterfaceError if a line of '=' is not followed by the name of a type.
    """
    sections: list[tuple[TypeName, str, list[str]]] = [(name, name.kind, [])]
    lines = iter(enumerate(text.splitlines(), 1))
    for _, line in lines:
        if line != SEPARATOR:
            sections[-1][2].append(line)
            continue
        number, heading = next(lines, (None, ""))
        match = _HEADING.fullmatch(heading)
        if not match:
            place = Location(str(name), number, 1 if number else None, heading if number else None)
            hint = "such as 'MSG: std_msgs/Header'"
            raise InterfaceError(Problem("expected the name of a type after a line of '='", place, hint))
        word, package, kind, stem = match.groups()
        kind = kind or word.lower()
        sections.append((TypeName(package, kind, stem), "idl" if word == "IDL" else kind, []))
    if sections[1:] and not any(sections[0][2]):
        del sections[0]
    sources = []
    for type_name, ending, content in sections:
        relative = f"{type_name.kind}/{type_name.name}.{ending}"
        # The blank line before a heading is not part of the definition.
        text = "\n".join(content).rstrip("\n")
        path = Path(type_name.package) / relative
        sources.append(Source(type_name.package, relative, path, f"{text}\n" if text else ""))
    return tuple(sources)


def parse_name(text: str) -> TypeName:
    """Parse the name of a schema; messages may omit 'msg'. Raises InterfaceError."""
    parts = text.split("/")
    if len(parts) == 2:
        parts.insert(1, "msg")
    if len(parts) != 3 or not all(parts) or not LOWER_NAME.fullmatch(parts[0]):
        raise InterfaceError(Problem(f"invalid type name '{text}'", hint="such as 'std_msgs/msg/String'"))
    return TypeName(*parts)
