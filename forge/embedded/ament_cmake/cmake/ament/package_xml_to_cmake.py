"""Print a package.xml as the CMake variables that ament_package_xml() publishes.

Called as `package_xml_to_cmake.py PACKAGE_XML` if forge does not provide the variables. Uses only the
standard library.
"""

from __future__ import annotations

import operator
import os
import re
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

# The CMake lists of each dependency tag of REP 149.
LISTS = {
    "build_depend": ("BUILD_DEPENDS",),
    "buildtool_depend": ("BUILDTOOL_DEPENDS",),
    "build_export_depend": ("BUILD_EXPORT_DEPENDS",),
    "buildtool_export_depend": ("BUILDTOOL_EXPORT_DEPENDS",),
    "exec_depend": ("EXEC_DEPENDS",),
    "run_depend": ("BUILD_EXPORT_DEPENDS", "EXEC_DEPENDS"),
    "depend": ("BUILD_DEPENDS", "BUILD_EXPORT_DEPENDS", "EXEC_DEPENDS"),
    "test_depend": ("TEST_DEPENDS",),
    "group_depend": ("GROUP_DEPENDS",),
    "member_of_group": ("MEMBER_OF_GROUPS",),
}
NAMES = tuple(dict.fromkeys(name for names in LISTS.values() for name in names))
COMPARISONS = ("lt", "lte", "eq", "gte", "gt")
OPERATORS = {
    "==": operator.eq,
    "!=": operator.ne,
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
}
TOKEN = re.compile(r"""\s*([()]|[=!<>]=|[<>]|\$\w+|[\w-]+|"[^"]*"|'[^']*')""", re.ASCII)

# The values for conditions if no ROS installation sets these variables.
VARIABLES = {"ROS_VERSION": "2", "ROS_PYTHON_VERSION": "3", "ROS_DISTRO": "humble", **os.environ}


class Condition:
    """A parser of conditions of REP 149; 'and' has precedence over 'or'."""

    def __init__(self, text: str) -> None:
        """Split the text into tokens; raises ValueError if that is not possible."""
        self.tokens = []
        position = 0
        while text[position:].strip():
            match = TOKEN.match(text, position)
            if not match:
                raise ValueError
            self.tokens.append(match[1])
            position = match.end()

    def holds(self) -> bool:
        """Return whether the condition is true; raises ValueError if it is malformed."""
        answer = self._any()
        if self.tokens:
            raise ValueError
        return answer

    def _any(self) -> bool:
        answer = self._all()
        while self.tokens[:1] == ["or"]:
            self.tokens.pop(0)
            answer = self._all() or answer
        return answer

    def _all(self) -> bool:
        answer = self._one()
        while self.tokens[:1] == ["and"]:
            self.tokens.pop(0)
            answer = self._one() and answer
        return answer

    def _one(self) -> bool:
        if self.tokens[:1] == ["("]:
            self.tokens.pop(0)
            answer = self._any()
            if self.tokens[:1] != [")"]:
                raise ValueError
            self.tokens.pop(0)
            return answer
        minimum = 3  # left, operator, right
        if len(self.tokens) < minimum or self.tokens[1] not in OPERATORS:
            raise ValueError
        left, compare, right = (self.tokens.pop(0) for _ in range(minimum))
        return bool(OPERATORS[compare](_value(left), _value(right)))


def _value(token: str) -> str:
    if token.startswith("$"):
        return VARIABLES.get(token[1:], "")
    if token[0] in "\"'":
        return token[1:-1]
    if token in ("(", ")", *OPERATORS):
        raise ValueError
    return token


def _active(element: ET.Element) -> bool:
    condition = element.get("condition")
    if condition is None:
        return True
    try:
        return Condition(condition).holds()
    except ValueError:
        sys.exit(f"package.xml: the condition '{condition}' of <{element.tag}> is malformed")


def _text(element: ET.Element | None) -> str:
    return (element.text or "").strip() if element is not None else ""


def _quote(text: str) -> str:
    """Return the text as a quoted CMake argument."""
    return '"' + re.sub(r'([\\"$;])', r"\\\1", text) + '"'


def _maintainers(root: ET.Element) -> str:
    people = [(_text(person), person.get("email")) for person in root.findall("maintainer")]
    return ", ".join(f"{name} <{email}>" if email else name for name, email in people)


def _deprecation(root: ET.Element) -> str:
    element = root.find("export/deprecated")
    return "" if element is None else _text(element) or "TRUE"


def _export_tags(root: ET.Element) -> list[str]:
    tags = []
    for element in root.findall("export/*"):
        if _active(element):
            element.tail = None
            tags.append(ET.tostring(element, encoding="unicode").replace("${prefix}/", ""))
    return tags


def variables(root: ET.Element) -> dict[str, list[str]]:
    """Return the variables; the names are without the prefix '<package>_'."""
    values: dict[str, list[str]] = {
        "VERSION": [_text(root.find("version"))],
        "MAINTAINER": [_maintainers(root)],
        "DEPRECATED": [_deprecation(root)],
        **{name: [] for name in NAMES},
        "EXPORT_TAGS": _export_tags(root),
    }
    for element in root:
        if element.tag not in LISTS or not _active(element):
            continue
        dependency = _text(element)
        for name in LISTS[element.tag]:
            if dependency not in values[name]:
                values[name].append(dependency)
            for comparison in COMPARISONS:
                version = element.get(f"version_{comparison}")
                if version is not None:
                    values[f"{name}_{dependency}_VERSION_{comparison.upper()}"] = [version]
    return values


def main(path: str) -> int:
    """Print the variables of the manifest at `path`."""
    try:
        root = ET.fromstring(Path(path).read_bytes())  # noqa: S314  (the user's own file)
    except ET.ParseError as error:
        sys.exit(f"{path} is not well-formed XML: {error}")
    package = _text(root.find("name"))
    if root.tag != "package" or not package or not _text(root.find("version")):
        sys.exit(f"{path} is not a package manifest: <package> with <name> and <version> is missing")
    lines = [f"set(_AMENT_PACKAGE_NAME {_quote(package)})"]
    for name, values in variables(root).items():
        lines.append(" ".join([f"set({package}_{name}", *(map(_quote, values) if values else ['""'])]) + ")")
    sys.stdout.buffer.write("\n".join([*lines, ""]).encode())
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
