"""Documentation pages as text."""

import re

from forge.interfaces.model import Catalog, Constant, Field, Message, Primitive, String, TypeName
from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library, read_folder
from forge.interfaces.resolve.resolution import resolve
from forge.plugins.interface_pages import markdown
from tests.conftest import GOLDEN, Forge, Golden, Tree

NAME = TypeName("demo", "msg", "Thing")
EMPTY = Catalog("demo", {}, {}, {})
GENERATE = ("interface", "generate", "--package", "p", "--output", "out")
METADATA = "Metadata-Version: 2.1\nName: third\nVersion: 1.0\n"


def page(message: Message) -> str:
    """Return the page of a package with one message."""
    (file,) = markdown.files(Catalog("demo", {message.name: message}, {message.name: message}, {}))
    assert file.path == "demo.md"
    return file.text


def test_pages_match_the_golden_files(golden: Golden) -> None:
    """A message, a service and an action, with constants, defaults, units and links."""
    case = GOLDEN / "interfaces" / "docs" / "robot"
    catalog = resolve("robot", parse_all(read_folder("robot", case)), Library())
    golden(case, {file.path: file.text for file in markdown.files(catalog)})


def test_comments_and_values_are_escaped_in_markdown() -> None:
    """What Markdown would understand is escaped, so that a table stays a table."""
    doc = ("# not | a *heading*", "", "<b>nor</b> [a](link)")
    fields = (Field("text", String(), "a | `b`", doc),)
    text = page(Message(NAME, fields, (Constant("A_B", Primitive("int8"), -1, doc),), doc))
    plain = re.sub(r"\\.", "", text)
    assert "\\# not \\| a \\*heading\\*\n\n\\<b\\>nor\\</b\\> \\[a\\](link)\n" in text
    assert '| `text` | string | "a \\| \\`b\\`" |  | \\# not \\| a' in text
    assert {line.count("|") for line in plain.splitlines() if line.startswith("| `text`")} == {6}
    assert {line.count("|") for line in plain.splitlines() if line.startswith("| `A_B`")} == {5}


def test_an_empty_message_is_documented_as_empty() -> None:
    assert "\n\nNo fields.\n" in page(Message(NAME))


def test_documentation_is_a_target(forge: Forge, tree: Tree) -> None:
    """Pages of the types referred to lie beside the package's own, so that links lead somewhere."""
    root = tree({"src/msg/A.msg": "geometry_msgs/Point[] points"})
    ran = forge(
        "interface", "generate", "--package", "p", "--output", "out", "--lang", "docs", "src", cwd=root
    )
    assert (ran.code, ran.err) == (0, "")
    assert sorted(path.name for path in (root / "out/docs").iterdir()) == ["geometry_msgs.md", "p.md"]
    (link,) = set(re.findall(r"\((geometry_msgs\.md)#", (root / "out/docs/p.md").read_text()))
    assert '<a id="geometry_msgs/msg/Point"></a>' in (root / "out/docs" / link).read_text()
