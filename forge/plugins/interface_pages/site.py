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
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from forge.base.frozen import frozen
from forge.base.templating import render
from forge.interfaces.model import Catalog, File, Interface, Message, Source, TypeName, sections_of
from forge.interfaces.notation import KINDS, visible
from forge.plugins.interface_pages.pages import pages, paragraphs, path_of

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
