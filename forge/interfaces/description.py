"""The type description that Iron and later store beside an interface, with its hashes (spec 8)."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from forge.interfaces.hashing import Hasher
from forge.interfaces.model import File

if TYPE_CHECKING:
    from collections.abc import Iterator

    from forge.interfaces.hashing import Description
    from forge.interfaces.model import Catalog, TypeName


def files(catalog: Catalog) -> Iterator[File]:
    """Yield 'PACKAGE/KIND/Name.json' for each interface."""
    hasher = Hasher(catalog)
    for name in catalog.interfaces:
        text = json.dumps(describe(hasher, name), indent=2) + "\n"
        yield File(f"{name.package}/{name.kind}/{name.name}.json", text)


def describe(hasher: Hasher, name: TypeName) -> Description:
    """Return the stored object: the type, all that it refers to, and the hash of each."""
    referenced = hasher.referenced(name)
    return {
        "type_description_msg": {
            "type_description": _with_defaults(hasher, name),
            "referenced_type_descriptions": [_with_defaults(hasher, each) for each in referenced],
        },
        "type_hashes": [
            {"type_name": str(each), "hash_string": hasher.hash(each)} for each in (name, *referenced)
        ],
    }


def _with_defaults(hasher: Hasher, name: TypeName) -> Description:
    """Return a type's description with the defaults, which are stored but not hashed."""
    fields = [
        {**described, "default_value": "" if member.default is None else str(member.default)}
        for described, member in zip(hasher.described_fields(name), hasher.fields(name), strict=True)
    ]
    return {"type_name": str(name), "fields": fields}
