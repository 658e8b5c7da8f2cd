"""HTML sites for tests: what stands in their pages, and where their links lead."""

import re
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

UNSEEN = re.compile("[\0-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")
"""Invisible and bidirectional characters, which must not get into pages."""

_EMPTY = frozenset({"br", "hr", "img", "input", "link", "meta"})


@dataclass(slots=True)
class Contents:
    """What a page has: its tags in order, ids, targets of links and scripts, and its words."""

    tags: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    words: list[str] = field(default_factory=list)
    open: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)

    @property
    def ids(self) -> list[str]:
        """The anchors of the page."""
        return [attributes["id"] for _, attributes in self.tags if "id" in attributes]

    @property
    def targets(self) -> list[str]:
        """Where links, scripts, styles, pictures and forms lead."""
        return [
            attributes[name]
            for _, attributes in self.tags
            for name in ("href", "src", "action")
            if name in attributes
        ]

    @property
    def text(self) -> str:
        """All that is to be read."""
        return "".join(self.words)


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.contents = Contents()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        names = [name for name, _ in attrs]
        if len(names) != len(set(names)):
            self.contents.faults.append(f"<{tag}> says an attribute twice")
        self.contents.tags.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in _EMPTY:
            self.contents.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if not self.contents.open or self.contents.open.pop() != tag:
            self.contents.faults.append(f"</{tag}> closes nothing")

    def handle_data(self, data: str) -> None:
        self.contents.words.append(data)


def read_page(text: str) -> Contents:
    """Return what a page has; each element that is opened must be closed."""
    reader = _Reader()
    reader.feed(text)
    reader.close()
    contents = reader.contents
    contents.faults += [f"<{tag}> is not closed" for tag in contents.open]
    contents.faults += [
        f"'{each}' is there twice" for each in set(contents.ids) if contents.ids.count(each) > 1
    ]
    return contents


def faults_of(site: Path) -> list[str]:
    """Return what is wrong with the pages of a folder: tags, anchors, links that lead nowhere or outside."""
    pages = {path: read_page(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}
    found = []
    for path, contents in pages.items():
        found += [f"{path}: {fault}" for fault in contents.faults]
        for target in contents.targets:
            parts = urlsplit(target)
            if parts.scheme == "data":
                continue
            file = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            outside = parts.scheme or parts.netloc or not file.is_relative_to(site.resolve())
            anchor = parts.fragment and parts.fragment not in (pages[file].ids if file in pages else ())
            if outside or not file.is_file() or anchor:
                found.append(f"{path}: '{target}' leads nowhere")
    return found


def elements(text: str) -> set[tuple[str, tuple[str, ...]]]:
    """Return what kinds of elements a page has, each with the names of its attributes; all are closed."""
    contents = read_page(text)
    assert contents.faults == []
    assert contents.open == []
    assert not UNSEEN.search(text), text
    return {(tag, tuple(sorted(attributes))) for tag, attributes in contents.tags}


def scripts(text: str) -> tuple[list[str], list[str]]:
    """Return the scripts of a page, and its blocks of JSON."""
    found = re.findall(r"<script(?: ([^>]*))?>(.*?)</script", text, re.DOTALL)
    blocks = [body for attributes, body in found if "application/json" in attributes]
    return [body for attributes, body in found if "application/json" not in attributes], blocks
