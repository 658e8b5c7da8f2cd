"""Generate HTML documentation for the interfaces of several packages: self-contained, usable without scripts.

index.html                  all packages and interfaces, with a search field
PACKAGE/index.html          the interfaces of a package, and how to depend on it
PACKAGE/KIND/Name.html      an interface
style.css  search.js
COLCON_IGNORE               excludes the folder from package discovery
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

from forge.base.frozen import frozen
from forge.base.names import snake_case
from forge.base.templating import render
from forge.interfaces.hashing import Hasher, structures_of
from forge.interfaces.model import (
    Action,
    Array,
    Catalog,
    Constant,
    Field,
    File,
    Interface,
    Message,
    Named,
    Primitive,
    Sequence,
    Service,
    Source,
    String,
    Type,
    TypeName,
    element_of,
    sections_of,
)
from forge.interfaces.notation import KINDS, kind_of, type_text, value_text, visible
from forge.interfaces.resolve.resolution import ACTION_DEPENDENCIES
from forge.interfaces.wire.sizes import MemberSize, MessageSize, SizeCalculator

_TEMPLATES = "interface_pages/templates"
_SENTENCE = re.compile(r"(.+?[.!?])(?:\s|$)")
_LONGEST_SUMMARY = 160


@frozen
class PackageInfo:
    """The metadata of a package; `origin` is a short description of its source."""

    version: str = ""
    description: str = ""
    origin: str = ""


def site(catalogs: Iterable[Catalog], infos: Mapping[str, PackageInfo], title: str) -> Iterator[File]:
    """Yield the files of a site; each catalog may contain a part of a package.

    Only interfaces of these catalogs are linked.
    """
    title = visible(title)
    catalog = _merged(catalogs)
    names = defaultdict(list)
    for name in catalog.interfaces:
        names[name.package].append(name)
    packages = [_package_entry(package, names[package], catalog, infos) for package in sorted(names)]
    for page in pages(catalog):
        text = render(f"{_TEMPLATES}/interface.html.j2", title=title, root=page["root"], page=page)
        yield File(path_of(page["name"]), text)
    for package in packages:
        text = render(f"{_TEMPLATES}/package.html.j2", title=title, root="../", package=package)
        yield File(f"{package['name']}/index.html", text)
    yield File("style.css", render(f"{_TEMPLATES}/style.css.j2"))
    yield File("COLCON_IGNORE", "")
    yield File("search.js", render(f"{_TEMPLATES}/search.js.j2"))
    counts = f"{_plural(len(catalog.interfaces), 'interface')} in {_plural(len(packages), 'package')}"
    text = render(f"{_TEMPLATES}/index.html.j2", title=title, root="", packages=packages, counts=counts)
    yield File("index.html", text)


def _merged(catalogs: Iterable[Catalog]) -> Catalog:
    """Return a catalog of all interfaces, sorted by name."""
    interfaces: dict[TypeName, Interface] = {}
    messages: dict[TypeName, Message] = {}
    sources: dict[TypeName, Source] = {}
    for catalog in catalogs:
        interfaces.update(catalog.interfaces)
        messages.update(catalog.known)
        sources.update(catalog.sources)
    return Catalog("", dict(sorted(interfaces.items())), messages, sources)


def _package_entry(
    package: str, names: Iterable[TypeName], catalog: Catalog, infos: Mapping[str, PackageInfo]
) -> dict[str, Any]:
    """Return the values of a package, in the list of packages and on its own page."""
    kinds: dict[str, list[dict[str, Any]]] = {}
    for name in names:
        interface = catalog.interfaces[name]
        sections = sections_of(interface)
        fields = [member.name for message in sections for member in message.fields]
        words = dict.fromkeys([*fields, *(each.name for message in sections for each in message.constants)])
        text = next((text for message in sections if (text := summary(message.doc))), "")
        kinds.setdefault(name.kind, []).append(
            {"name": name, "page": path_of(name), "summary": text, "words": visible(" ".join(words))}
        )
    order = [*(kind for kind in KINDS if kind in kinds), *sorted(kinds.keys() - KINDS.keys())]
    groups = [
        {
            "title": KINDS[kind][1].capitalize() if kind in KINDS else f"In the folder {kind}",
            "entries": kinds[kind],
        }
        for kind in order
    ]
    counts = ", ".join(_plural(len(kinds[kind]), *KINDS.get(kind, (f"in '{kind}'",) * 2)) for kind in order)
    info = infos.get(package, PackageInfo())
    escaped = PackageInfo(visible(info.version), visible(info.description), visible(info.origin))
    description = paragraphs((" ".join(info.description.split()),))
    return {
        "name": package,
        "about": escaped,
        "paragraphs": description,
        "counts": counts,
        "groups": groups,
    }


def summary(doc: Iterable[str]) -> str:
    """Return the first sentence of a comment on one line; an empty text without a comment."""
    first = next((" ".join(each.text.split()) for each in paragraphs(doc)), "")
    sentence = _SENTENCE.match(first)
    text = sentence[1] if sentence else first
    return text if len(text) <= _LONGEST_SUMMARY else f"{text[:_LONGEST_SUMMARY].rstrip()} …"


def _plural(count: int, word: str, several: str | None = None) -> str:
    return f"1 {word}" if count == 1 else f"{count:,} {several or word + 's'}"


_PREFORMATTED = re.compile(r"^\s|\S {2,}\S|\t", re.MULTILINE)

TITLES = {1: ("",), 2: ("Request", "Response"), 3: ("Goal", "Result", "Feedback")}
"""The titles of the messages of an interface, by their number."""


@frozen
class Paragraph:
    """A paragraph of a comment; preformatted ones keep their white space."""

    text: str
    preformatted: bool = False


def paragraphs(doc: Iterable[str]) -> tuple[Paragraph, ...]:
    """Split a comment at blank lines; the templates escape its text."""
    blocks = re.split(r"\n(?:[ \t]*\n)+", visible("\n".join(doc)).strip("\n"))
    return tuple(
        Paragraph(block, preformatted=bool(_PREFORMATTED.search(block))) for block in blocks if block.strip()
    )


def pages(catalog: Catalog) -> Iterator[dict[str, Any]]:
    """Yield the values of the page of each interface; `root` is the relative path to the first page.

    Messages without a title are whole interfaces. `lines` are the lines of the definition, as code and
    comment.
    """
    interfaces, sizes, hasher = catalog.interfaces, SizeCalculator(catalog.known), Hasher(catalog)
    users: dict[TypeName, set[TypeName]] = {}
    for name, interface in interfaces.items():
        for element in (element_of(field.type) for each in sections_of(interface) for field in each.fields):
            if isinstance(element, Named):
                users.setdefault(element.name, set()).add(name)
    for name, interface in interfaces.items():
        links = _Links(interfaces, "../" * path_of(name).count("/"), name.package)
        messages = sections_of(interface)
        source = catalog.sources.get(name)
        derived = [each for each, _ in structures_of(interface) if each != name]
        yield {
            "name": name,
            "kind": kind_of(name),
            "root": links.root,
            "sections": [
                _section(title, message, sizes.of(message), links)
                for title, message in zip(TITLES[len(messages)], messages, strict=True)
            ],
            "source": source.relative if source else "",
            "lines": _lines(source) if source else (),
            "snippets": snippets(interface, catalog.known),
            "users": links.links(users.get(name, ())),
            # The types that every action uses implicitly.
            "needs": links.links(ACTION_DEPENDENCIES if isinstance(interface, Action) else ()),
            "hash": hasher.hash(name),
            "derived": [{"name": str(each), "hash": hasher.hash(each)} for each in derived],
        }


def _section(title: str, message: Message, sizes: MessageSize, links: _Links) -> dict[str, Any]:
    prefix = f"{title.lower()}."
    members = zip(message.members, sizes.members, strict=True) if message.fields else ()
    return {
        "title": title,
        "doc": paragraphs(message.doc),
        "fields": [
            links.row(prefix, each, value_text(each.default), each.unit or "") for each in message.fields
        ],
        "constants": [links.row(prefix, each, value_text(each.value)) for each in message.constants],
        "size": _size_of(sizes),
        "bytes": [_bytes(member.name, size) for member, size in members],
    }


@frozen
class _Links:
    """Creates links to types, relative to the folder of a page: a word, its page or "", the text after it."""

    interfaces: Mapping[TypeName, Interface]
    root: str
    package: str

    def row(self, prefix: str, declared: Field | Constant, value: str, unit: str = "") -> dict[str, Any]:
        type_ = type_text(declared.type, self.package)
        name = type_.name if type_.name in self.interfaces else None
        page = f"{self.root}{path_of(name)}" if name else ""
        return {
            "anchor": f"{prefix}{declared.name}",
            "name": declared.name,
            "type": {"word": type_.word, "page": page, "after": type_.suffix},
            "value": value,
            "unit": visible(unit),
            "doc": paragraphs(declared.doc),
        }

    def links(self, names: Collection[TypeName]) -> list[dict[str, str]]:
        """Return links to interfaces, sorted by name."""
        linked_names = sorted(name for name in names if name in self.interfaces)
        return [
            {"word": str(name), "page": f"{self.root}{path_of(name)}", "after": ""} for name in linked_names
        ]


def path_of(name: TypeName) -> str:
    return f"{name.package}/{name.kind}/{name.name}.html"


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
    if size.max_size is None:
        return f"{_count(size.min_size)} or more"
    if size.min_size == size.max_size:
        return f"always {_count(size.min_size)}"
    return f"{size.min_size:,} to {_count(size.max_size)}"


def _bytes(name: str, member: MemberSize) -> dict[str, Any]:
    offset = f"{member.offset:,}" if member.fixed else f"{member.offset:,} or later"
    low, high = member.min_size, member.max_size
    upper = "or more" if high is None else f"to {high:,}"
    size = f"{low:,}" if low == high else f"{low:,} {upper}"
    return {"name": name, "offset": offset, "alignment": member.alignment, "size": size}


def _count(count: int) -> str:
    return "1 byte" if count == 1 else f"{count:,} bytes"


_ASSIGNMENTS = 2
_DEPTH = 3
_PYTHON = {"boolean": "True", "octet": 'b"\\x01"', "char": "1", "float": "1.0", "double": "1.0"}
_CPP = {"boolean": "true", "float": "1.0F", "double": "1.0"}
_WORD = "text"


@frozen
class _Leaf:
    """A member to assign: its path, and a value in each language."""

    path: str
    python: str
    cpp: str


def snippets(interface: Interface, messages: Mapping[TypeName, Message]) -> dict[str, str]:
    """Return the example for an interface in both languages; `messages` contains all nested messages."""
    name = interface.name
    python = [f"from {name.package}.{name.kind} import {name.name}", ""]
    cpp = [f'#include "{name.package}/{name.kind}/{snake_case(name.name)}.hpp"', ""]
    for variable, part, message in _variables(interface):
        leaves = _leaves(message, messages)
        python += [
            f"{variable} = {name.name}{part}()",
            *(f"{variable}.{leaf.path} = {leaf.python}" for leaf in leaves),
        ]
        type_ = f"{name.package}::{name.kind}::{name.name}{part.replace('.', '::')}"
        cpp += [f"{type_} {variable};", *(f"{variable}.{each.path} = {each.cpp};" for each in leaves)]
    return {"python": "\n".join(python) + "\n", "cpp": "\n".join(cpp) + "\n"}


def _variables(interface: Interface) -> Iterator[tuple[str, str, Message]]:
    """Yield each message to create: the variable's name, the suffix of the class name, the message."""
    match interface:
        case Message():
            yield "message", "", interface
        case Service(_, request, response):
            yield "request", ".Request", request
            yield "response", ".Response", response
        case Action(_, goal, result, feedback):
            yield "goal", ".Goal", goal
            yield "feedback", ".Feedback", feedback
            yield "result", ".Result", result


def _leaves(message: Message, messages: Mapping[TypeName, Message]) -> list[_Leaf]:
    """Return a few members that one statement can assign, direct members before nested ones."""
    candidates = (_leaf(member.name, member.type, messages, _DEPTH) for member in message.fields)
    leaves = [leaf for leaf in candidates if leaf]
    return sorted(leaves, key=lambda leaf: leaf.path.count("."))[:_ASSIGNMENTS]


def _leaf(path: str, type_: Type, messages: Mapping[TypeName, Message], depth: int) -> _Leaf | None:
    match type_:
        case Primitive(name) if name != "wchar":
            return _Leaf(path, _PYTHON.get(name, "1"), _CPP.get(name, "1"))
        case String(wide, bound):
            word = _WORD[:bound]
            return _Leaf(path, f'"{word}"', f'{"u" if wide else ""}"{word}"')
        case Named(name) if depth:
            leaves = (
                _leaf(f"{path}.{member.name}", member.type, messages, depth - 1)
                for member in messages[name].fields
            )
            return next((leaf for leaf in leaves if leaf), None)
        case Array(Primitive(name)) if name not in {"wchar", "octet"}:
            return _Leaf(f"{path}[0]", _PYTHON.get(name, "1"), _CPP.get(name, "1"))
        case Sequence(Primitive(name)) if name not in {"wchar", "octet"}:
            return _Leaf(path, f"[{_PYTHON.get(name, '1')}]", f"{{{_CPP.get(name, '1')}}}")
        case _:
            return None
