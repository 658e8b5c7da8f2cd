"""The target 'json': type descriptions with hashes, as installed since ROS 2 Iron (REP 2011)."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from forge.interfaces.hashing import Hasher
from forge.interfaces.model import File

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from forge.interfaces.hashing import Description
    from forge.interfaces.model import Catalog, Interface, TypeName


def files(catalog: Catalog) -> Iterator[File]:
    """Yield 'PACKAGE/KIND/Name.json' for each interface."""
    files_of = interface_files(catalog)
    for interface in catalog.interfaces.values():
        yield from files_of(interface)


def package_files(_: Catalog) -> Iterator[File]:
    """Yield nothing: there are no files for the package as a whole."""
    return iter(())


def interface_files(catalog: Catalog) -> Callable[[Interface], Iterator[File]]:
    """Return a function that yields the file of one interface."""
    hasher = Hasher(catalog)

    def files_of(interface: Interface) -> Iterator[File]:
        name = interface.name
        text = json.dumps(describe(hasher, name), indent=2) + "\n"
        yield File(f"{name.package}/{name.kind}/{name.name}.json", text)

    return files_of


def describe(hasher: Hasher, name: TypeName) -> Description:
    """Return the description of a type and all referenced types, with the hash of each."""
    referenced = hasher.referenced(name)
    return {
        "type_description_msg": {
            "type_description": described_type(hasher, name),
            "referenced_type_descriptions": [described_type(hasher, each) for each in referenced],
        },
        "type_hashes": [
            {"type_name": str(each), "hash_string": hasher.hash(each)} for each in (name, *referenced)
        ],
    }


def described_type(hasher: Hasher, name: TypeName) -> Description:
    """Return the description of a type with default values, which are not part of the hash."""
    fields = [
        {**described, "default_value": "" if member.default is None else str(member.default)}
        for described, member in zip(hasher.described_fields(name), hasher.fields(name), strict=True)
    ]
    return {"type_name": str(name), "fields": fields}
