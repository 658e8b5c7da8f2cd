"""The data of the HTML page of an interface, for its template."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.interfaces.hashing import Hasher, structures_of
from forge.interfaces.model import Action, Named, element_of, sections_of
from forge.interfaces.notation import kind_of, type_text, value_text, visible
from forge.interfaces.resolve.dependencies import ACTION_DEPENDENCIES
from forge.interfaces.wire.sizes import SizeCalculator
from forge.plugins.interface_pages.snippets import Snippets, snippets
from forge.plugins.interface_pages.text import TITLES, Paragraph, paragraphs

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from forge.interfaces.model import Catalog, Constant, Field, Interface, Message, Source, Type, TypeName
    from forge.interfaces.wire.sizes import MemberSize, MessageSize


@frozen
class Link:
    """A link to a page and the text after it; plain text if there is no page."""

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
    """The offset and size of a member, as text."""

    name: str
    offset: str
    alignment: int
    size: str


@frozen
class Section:
    """A message; without a title unless it is a part of a service or an action."""

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
    """The lines of the definition, each as code and comment."""
    snippets: Snippets
    users: tuple[Link, ...]
    needs: tuple[Link, ...]
    """The types that every action uses implicitly."""
    hash: str
    derived: tuple[Derived, ...]


class Pages:
    """The pages of all interfaces of a site; `catalog` contains the interfaces of all packages."""

    def __init__(self, catalog: Catalog) -> None:
        """Index all interfaces and their users."""
        self._catalog = catalog
        self._sizes = SizeCalculator(catalog.known)
        self._hasher = Hasher(catalog)
        self._users = used_by(catalog.interfaces)

    def page(self, name: TypeName) -> Page:
        """Return the page of an interface."""
        interface = self._catalog.interfaces[name]
        links = _Links(self._catalog.interfaces, "../" * path_of(name).count("/"), name.package)
        messages = sections_of(interface)
        source = self._catalog.sources.get(name)
        derived = [each for each, _ in structures_of(interface) if each != name]
        return Page(
            name,
            kind_of(name),
            links.root,
            tuple(
                self._section(title, message, links)
                for title, message in zip(TITLES[len(messages)], messages, strict=True)
            ),
            source.relative if source else "",
            tuple(_lines(source)) if source else (),
            snippets(interface, self._catalog.known),
            links.links(self._users.get(name, ())),
            links.links(ACTION_DEPENDENCIES if isinstance(interface, Action) else ()),
            self._hasher.hash(name),
            tuple(Derived(str(each), self._hasher.hash(each)) for each in derived),
        )

    def _section(self, title: str, message: Message, links: _Links) -> Section:
        sizes = self._sizes.of(message)
        prefix = f"{title.lower()}."
        return Section(
            title,
            paragraphs(message.doc),
            tuple(
                links.row(prefix, each, value_text(each.default), each.unit or "") for each in message.fields
            ),
            tuple(links.row(prefix, each, value_text(each.value)) for each in message.constants),
            _size_of(sizes),
            tuple(
                _bytes(member.name, size)
                for member, size in zip(message.members, sizes.members, strict=True)
                if message.fields
            ),
        )


@frozen
class _Links:
    """Creates links to types; they are relative to the folder of the page."""

    interfaces: Mapping[TypeName, Interface]
    root: str
    package: str

    def row(self, prefix: str, declared: Field | Constant, value: str, unit: str = "") -> Row:
        """Return the row of a field or a constant."""
        doc = paragraphs(declared.doc)
        type_ = self.type(declared.type)
        return Row(f"{prefix}{declared.name}", declared.name, type_, value, visible(unit), doc)

    def type(self, type_: Type) -> Link:
        """Return a type with a link to the message that it names, if any."""
        spelled = type_text(type_, self.package)
        if spelled.name is None or spelled.name not in self.interfaces:
            return Link(spelled.word, "", spelled.suffix)
        return Link(spelled.word, f"{self.root}{path_of(spelled.name)}", spelled.suffix)

    def links(self, names: Collection[TypeName]) -> tuple[Link, ...]:
        """Return links to interfaces, sorted by name."""
        known = sorted(name for name in names if name in self.interfaces)
        return tuple(Link(str(name), f"{self.root}{path_of(name)}") for name in known)


def path_of(name: TypeName) -> str:
    """Return the path of the page of an interface."""
    return f"{name.package}/{name.kind}/{name.name}.html"


def used_by(interfaces: Mapping[TypeName, Interface]) -> dict[TypeName, set[TypeName]]:
    """Return, for each message, the interfaces with a field of its type in their definition."""
    found: dict[TypeName, set[TypeName]] = {}
    for name, interface in interfaces.items():
        for message in sections_of(interface):
            for member in message.fields:
                element = element_of(member.type)
                if isinstance(element, Named) and element.name in interfaces:
                    found.setdefault(element.name, set()).add(name)
    return found


def _lines(source: Source) -> list[tuple[str, str]]:
    """Return each line of a definition as code and comment."""
    mark = "//" if source.relative.endswith(".idl") else "#"
    lines = []
    for line in visible(source.text.removeprefix("\ufeff")).splitlines():
        code, hash_, comment = line.partition(mark)
        # Inside quotes, '//' starts no comment in .idl files; '#' in other files is ambiguous.
        quoted = code.count('"') % 2 or code.count("'") % 2
        lines.append((line, "") if quoted else (code, hash_ + comment))
    return lines


def _size_of(size: MessageSize) -> str:
    """Return the size of a message as text."""
    if size.max_size is None:
        return f"{_count(size.min_size)} or more"
    if size.min_size == size.max_size:
        return f"always {_count(size.min_size)}"
    return f"{size.min_size:,} to {_count(size.max_size)}"


def _bytes(name: str, member: MemberSize) -> MemberBytes:
    offset = f"{member.offset:,}" if member.fixed else f"{member.offset:,} or later"
    low, high = member.min_size, member.max_size
    upper = "or more" if high is None else f"to {high:,}"
    size = f"{low:,}" if low == high else f"{low:,} {upper}"
    return MemberBytes(name, offset, member.alignment, size)


def _count(count: int) -> str:
    return "1 byte" if count == 1 else f"{count:,} bytes"
