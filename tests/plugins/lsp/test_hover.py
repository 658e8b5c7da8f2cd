"""What an editor shows about the name under the cursor."""

import pytest

from forge.plugins.lsp.hover import hover
from tests.plugins.lsp.conftest import Pointer

_POINT = """**shapes/msg/Point** (message)

A place.

```
uint8 FLAT=2
float64 x
float32 y 0.5
```

Serialized: 12 bytes"""

_PLAN = """**nav/srv/Plan** (service)

```
shapes/Point goal
```

Request: 12 bytes"""

_MORE = "Serialized: %s bytes or more, at byte"
_FIRST = "Serialized: 8 bytes, at byte 0"
_BOXES = "Serialized: 28 bytes, at byte 0"


def _code(line: str, *parts: str) -> str:
    return "\n\n".join((f"```\n{line}\n```", *parts))


@pytest.mark.parametrize(
    ("file", "word", "text"),
    [
        ("nav/msg/Path.msg", "Point", _POINT),
        ("shapes/msg/Point.msg", "x  #", _code("float64 x", "to the right", "Unit: m", _FIRST)),
        ("shapes/msg/Point.msg", "y 0.5", _code("float32 y 0.5", "Serialized: 4 bytes, at byte 8")),
        ("shapes/msg/Point.msg", "FLAT", _code("uint8 FLAT=2", "no height")),
        ("nav/msg/Path.msg", "points", _code("shapes/Point[] points", f"{_MORE % 4} 0")),
        ("nav/msg/Path.msg", "name", _code("string name", f"{_MORE % 5} 4 or later")),
        ("nav/action/Drive.action", "boxes", _code("shapes/Box[2] boxes", _BOXES)),
        ("shapes/msg/Box.idl", "SIDES", "```\nint16 SIDES=6\n```"),
        ("nav/package.xml", "7", None),
    ],
)  # fmt: skip
def test_the_documentation_and_the_size_are_shown(
    workspace: Pointer, file: str, word: str, text: str | None
) -> None:
    if text is None:
        assert hover(workspace.index, workspace.path(file), 0, 0) is None
    else:
        assert hover(*workspace.at(file, word)) == text


@pytest.mark.parametrize("word", ["three[3]", "three sides"])
def test_a_typedef_is_shown_as_declared(workspace: Pointer, word: str) -> None:
    struct = "struct Box {\n  three sides;\n};"
    text = f"module shapes {{ module msg {{\n  typedef double three[3];\n{struct}\n}}; }};"
    workspace.index.open(workspace.path("shapes/msg/Box.idl"), text)
    assert hover(*workspace.at("shapes/msg/Box.idl", word)) == "```\ntypedef double three[3];\n```"


def test_a_package_is_described(workspace: Pointer) -> None:
    own = hover(*workspace.at("nav/package.xml", "shapes"))
    assert own == f"**shapes** 0.1.0\n\nA package of the tests\n\n{workspace.path('shapes')}"
    assert "**std_msgs** " in (hover(*workspace.at("nav/package.xml", "std_msgs")) or "")
    workspace.index.open(workspace.path("shapes/package.xml"), "<package><name>shapes</name></package>")
    assert hover(*workspace.at("nav/package.xml", "shapes")) == f"**shapes**\n\n{workspace.path('shapes')}"
    path = workspace.path("nav/package.xml")
    workspace.index.open(path, workspace.index.text(path).replace("std_msgs", "libtinyxml2-dev"))
    assert "a system dependency, or missing" in (hover(*workspace.at("nav/package.xml", "libtiny")) or "")


def test_a_type_with_an_unknown_member_type_has_no_size(workspace: Pointer) -> None:
    workspace.index.open(workspace.path("shapes/msg/Point.msg"), "Missing x\nint8 y\n")
    text = hover(*workspace.at("nav/msg/Path.msg", "Point"))
    assert text == "**shapes/msg/Point** (message)\n\n```\nshapes/Missing x\nint8 y\n```"
    assert hover(*workspace.at("shapes/msg/Point.msg", "Missing")) is None
    assert hover(*workspace.at("shapes/msg/Point.msg", "y")) == "```\nint8 y\n```"


def test_sections_of_a_service_have_separate_sizes(workspace: Pointer) -> None:
    workspace.index.open(workspace.path("nav/msg/Plan.idl"), "")
    request = "struct Ask_Request { nav::srv::Plan x; };"
    text = f"module nav {{ module srv {{ {request} struct Ask_Response {{ long y; }}; }}; }};"
    workspace.index.open(workspace.path("nav/srv/Ask.idl"), text)
    assert (hover(*workspace.at("nav/srv/Ask.idl", "Plan")) or "").startswith(_PLAN)


def test_long_definitions_are_truncated(workspace: Pointer) -> None:
    workspace.index.open(workspace.path("shapes/msg/Point.msg"), "".join(f"int8 a{n}\n" for n in range(99)))
    text = hover(*workspace.at("nav/msg/Path.msg", "Point")) or ""
    assert "int8 a39\n...\n```\n\nSerialized: 99 bytes" in text
