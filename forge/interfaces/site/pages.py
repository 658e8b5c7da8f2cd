"""One interface as one page of HTML: what a template fills in."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.interfaces.hashing import Hasher, structures_of
from forge.interfaces.model import Action, Named, element_of, sections_of
from forge.interfaces.resolve.resolution import ACTION_DEPENDENCIES
from forge.interfaces.site.snippets import Snippets, snippets
from forge.interfaces.site.text import Paragraph, kind_of, paragraphs, type_text, value_text, visible
from forge.interfaces.wire.sizes import SizeCalculator

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from forge.interfaces.model import Catalog, Constant, Field, Interface, Message, Source, Type, TypeName
    from forge.interfaces.wire.sizes import MemberSize, MessageSize

_TITLES = {1: ("",), 2: ("Request", "Response"), 3: ("Goal", "Result", "Feedback")}


@frozen
class Link:
    """A link to a page, or plain text if there is no page."""

    word: str
    page: str = ""
    after: str = ""


@frozen
class Row:
    """A field or a constant."""

    anchor: str
    name: str
    type: Link
    value: str
    unit: str
    doc: tuple[Paragraph, ...]


@frozen
class MemberBytes:
    """The offset of a member, as text."""

    name: str
    offset: str
    alignment: int
    size: str


@frozen
class Section:
    """A message: a part of a service or of an action, or, without a title, all there is."""

    title: str
    doc: tuple[Paragraph, ...]
    fields: tuple[Row, ...]
    constants: tuple[Row, ...]
    size: str
    bytes: tuple[MemberBytes, ...]


@frozen
class Derived:
    """A type that ROS derives from an interface, with its hash."""

    name: str
    hash: str


@frozen
class Page:
    """The contents of the page of an interface; `root` is the relative path to the first page."""

    name: TypeName
    kind: str
    root: str
    sections: tuple[Section, ...]
    source: str
    lines: tuple[tuple[str, str], ...]
    """The definition: of each line what counts, and the comment behind it."""
    snippets: Snippets
    users: tuple[Link, ...]
    needs: tuple[Link, ...]
    """The types that every action uses implicitly."""
    hash: str
    derived: tuple[Derived, ...]


class Pages:
    """The pages of all interfaces of a site; `catalog` has those of every package."""

    def __init__(self, catalog: Catalog) -> None:
        """Index all interfaces and their users."""
        self._catalog = catalog
        self._extents = SizeCalculator(catalog.known)
        self._hasher = Hasher(catalog)
        self._users = used_by(catalog.interfaces)

    def page(self, name: TypeName) -> Page:
        """Return the page of an interface."""
        interface = self._catalog.interfaces[name]
        words = _Words(self._catalog.interfaces, "../" * path_of(name).count("/"), name.package)
        messages = sections_of(interface)
        source = self._catalog.sources.get(name)
        derived = [each for each, _ in structures_of(interface) if each != name]
        return Page(
            name,
            kind_of(name),
            words.root,
            tuple(
                self._section(title, message, words)
                for title, message in zip(_TITLES[len(messages)], messages, strict=True)
            ),
            source.relative if source else "",
            tuple(_lines(source)) if source else (),
            snippets(interface, self._catalog.known),
            words.links(self._users.get(name, ())),
            words.links(ACTION_DEPENDENCIES if isinstance(interface, Action) else ()),
            self._hasher.hash(name),
            tuple(Derived(str(each), self._hasher.hash(each)) for each in derived),
        )

    def _section(self, title: str, message: Message, words: _Words) -> Section:
        extent = self._extents.of(message)
        prefix = f"{title.lower()}."
        return Section(
            title,
            paragraphs(message.doc),
            tuple(
                words.row(prefix, each, value_text(each.default), each.unit or "") for each in message.fields
            ),
            tuple(words.row(prefix, each, value_text(each.value)) for each in message.constants),
            _size_of(extent),
            tuple(
                _bytes(member.name, span)
                for member, span in zip(message.members, extent.spans, strict=True)
                if message.fields
            ),
        )


@frozen
class _Words:
    """Text about types for a page; links are relative to the folder of the page."""

    interfaces: Mapping[TypeName, Interface]
    root: str
    package: str

    def row(self, prefix: str, declared: Field | Constant, value: str, unit: str = "") -> Row:
        """Return the row of a field or a constant."""
        doc = paragraphs(declared.doc)
        type_ = self.type(declared.type)
        return Row(f"{prefix}{declared.name}", declared.name, type_, value, visible(unit), doc)

    def type(self, type_: Type) -> Link:
        """Return a type, with a link to the message that it is or consists of."""
        spelled = type_text(type_, self.package)
        if spelled.name is None or spelled.name not in self.interfaces:
            return Link(spelled.word, "", spelled.suffix)
        return Link(spelled.word, f"{self.root}{path_of(spelled.name)}", spelled.suffix)

    def links(self, names: Collection[TypeName]) -> tuple[Link, ...]:
        """Return links to interfaces, in the order of their names."""
        known = sorted(name for name in names if name in self.interfaces)
        return tuple(Link(str(name), f"{self.root}{path_of(name)}") for name in known)


def path_of(name: TypeName) -> str:
    """Return the path of the page of an interface."""
    return f"{name.package}/{name.kind}/{name.name}.html"


def used_by(interfaces: Mapping[TypeName, Interface]) -> dict[TypeName, set[TypeName]]:
    """Return, for each message, the interfaces with a member of it in their own definition."""
    found: dict[TypeName, set[TypeName]] = {}
    for name, interface in interfaces.items():
        for message in sections_of(interface):
            for member in message.fields:
                element = element_of(member.type)
                if isinstance(element, Named) and element.name in interfaces:
                    found.setdefault(element.name, set()).add(name)
    return found


def _lines(source: Source) -> list[tuple[str, str]]:
    """Return each line of a definition as what counts and its comment; the mark of a comment differs."""
    mark = "//" if source.relative.endswith(".idl") else "#"
    lines = []
    for line in visible(source.text.removeprefix("\ufeff")).splitlines():
        code, hash_, comment = line.partition(mark)
        # A mark inside quotes begins no comment in .idl files, and in others there is a doubt about it.
        quoted = code.count('"') % 2 or code.count("'") % 2
        lines.append((line, "") if quoted else (code, hash_ + comment))
    return lines


def _size_of(extent: MessageSize) -> str:
    """Return how many bytes a message takes, in words."""
    if extent.most is None:
        return f"{_count(extent.least)} or more"
    if extent.least == extent.most:
        return f"always {_count(extent.least)}"
    return f"{extent.least:,} to {_count(extent.most)}"


def _bytes(name: str, span: MemberSize) -> MemberBytes:
    offset = f"{span.offset:,}" if span.fixed else f"{span.offset:,} or later"
    if span.most is None:
        size = f"{span.least:,} or more"
    else:
        size = f"{span.least:,}" if span.least == span.most else f"{span.least:,} to {span.most:,}"
    return MemberBytes(name, offset, span.alignment, size)


def _count(count: int) -> str:
    return "1 byte" if count == 1 else f"{count:,} bytes"
