"""Text from definitions and manifests never becomes markup or script in pages of interfaces."""

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from hypothesis import given

from forge.interfaces.model import Catalog, Constant, Field, Message, Primitive, Source, String, TypeName
from forge.plugins.interface_pages.site import PackageInfo, site
from tests.hostile import hostile
from tests.sites import UNSEEN, elements, read_page, scripts
from tests.unit.test_injection import BIDI, NEUTRAL, everywhere, generated, messages, quick


def site_of(text: str) -> dict[str, str]:
    """Return the pages of a message with `text` in every field of free text."""
    name, doc = TypeName("demo", "msg", "Thing"), tuple(text.split("\n"))
    number = Field("a", Primitive("int8"), 5, doc, text)
    message = Message(
        name, (number, Field("text", String(), text, doc)), (Constant("A", String(), text, doc),), doc
    )
    source = Source(
        "demo", "msg/Thing.msg", Path("Thing.msg"), f"# {text}\nint8 a # {text}\nstring b '{text}'\n"
    )
    catalog = Catalog("demo", {name: message}, {name: message}, {name: source})
    files = site([catalog], {"demo": PackageInfo(text, text, text)}, f"About {text}")
    return {file.path: file.text for file in files if file.path.endswith((".html", ".js"))}


@quick
@given(hostile("\r"))
def test_interface_pages_contain_no_foreign_elements(text: str) -> None:
    # A comment may make paragraphs and drawings, and there may be nothing to be seen of it.
    plain = site_of("x\n\n  a   b\n")
    for path, found in site_of(text).items():
        if path.endswith(".js"):
            assert found == plain[path]
        else:
            assert elements(found) <= elements(plain[path]), path
            assert scripts(found) == scripts(plain[path])


@pytest.mark.parametrize("code", [0x07, 0x85, 0x61C, 0x200E, 0x200F, 0x2028, 0x2029, 0x202E, 0x2066])
def test_interface_pages_contain_no_invisible_characters(code: int) -> None:
    assert not [path for path, page in site_of(f"x{chr(code)}x").items() if UNSEEN.search(page)]


@everywhere
def test_interface_pages_show_every_fragment_as_text(fragment: str) -> None:
    said = read_page(site_of(f"x{fragment}x")["demo/msg/Thing.html"]).text
    letters = "".join(char for char in fragment if char.isascii() and char.isprintable() and char != " ")
    assert letters in re.sub(r"\s", "", said)


class _Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.tags: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(f"{tag} {[name for name, _ in attrs]}")


@quick
@given(messages)
def test_documentation_pages_contain_no_foreign_tags(message: Message) -> None:
    markdown_it = pytest.importorskip("markdown_it")
    tags = []
    for each in (message, NEUTRAL):
        (text,) = generated(each, "docs").values()
        assert not BIDI.search(text)
        parser = _Tags()
        parser.feed(markdown_it.MarkdownIt("commonmark", {"html": True}).enable("table").render(text))
        tags.append(parser.tags)
    assert tags[0] <= tags[1] | {"p []", "ul []", "ol []", "li []", "ol ['start']", "hr []", "br []"}
