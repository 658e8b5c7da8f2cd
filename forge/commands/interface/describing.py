"""hash and schema: what tells a type from others, and what it is in full."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, NoReturn

from forge.commands.interface.inputs import add_includes, add_inputs, catalog_of, library_of
from forge.errors import ForgeError, InterfaceError, Problem
from forge.interfaces.hashing import hashes
from forge.interfaces.model import Catalog, TypeName
from forge.interfaces.resolution import demand, messages_below
from forge.interfaces.schema import ENCODINGS, schema_text
from forge.interfaces.showing import parse_type_name
from forge.names import did_you_mean

if TYPE_CHECKING:
    import argparse

    from forge.commands.interface.inputs import Verbs
    from forge.interfaces.sources import Library


def register(verbs: Verbs) -> None:
    """Add what describes types to the words that follow `forge interface`."""
    summary = "print type hashes (RIHS01), of named types or of a folder of definitions"
    hashing = verbs.add_parser("hash", help=summary, description=summary)
    hashing.add_argument("what", metavar="TYPE|SOURCE_DIR", nargs="*", help="types; a folder with --package")
    hashing.add_argument("--json", action="store_true", help="print one object")
    add_inputs(hashing)
    hashing.set_defaults(verb=_hash)
    summary = "print a definition and all that it refers to, as MCAP and rosbag2 store them"
    schema = verbs.add_parser("schema", help=summary, description=summary)
    schema.add_argument("type", metavar="TYPE", help="its full name")
    schema.add_argument("--encoding", choices=ENCODINGS, default=ENCODINGS[0], help="(default: %(default)s)")
    add_includes(schema)
    schema.set_defaults(verb=_schema)


def _hash(options: argparse.Namespace) -> int:
    library = library_of(options)
    if not (options.package or options.files or options.what):
        hint = "name types, or a folder of definitions with --package"
        raise ForgeError(Problem("there is nothing to hash", hint=hint))
    if options.files and not options.package:
        raise ForgeError(Problem("a file belongs to a package", hint="add --package NAME"))
    if options.package:
        found = hashes(catalog_of(options, _folder(options), library))
    else:
        found = {name: _hash_of(name, library) for name in map(parse_type_name, options.what)}
    if options.json:
        print(json.dumps({str(name): text for name, text in found.items()}, indent=1))
    else:
        for name, text in found.items():
            print(name, text)
    return 0


def _folder(options: argparse.Namespace) -> str | None:
    """Return the one folder that --package is about."""
    if options.what[1:]:
        hint = "without --package the words are names of types"
        raise ForgeError(Problem("a package has one folder of definitions", hint=hint))
    return options.what[0] if options.what else None


def _schema(options: argparse.Namespace) -> int:
    library = library_of(options)
    name = parse_type_name(options.type)
    parsed = library.find(name) or _missing(name, library)
    messages_below(parsed, library)
    print(schema_text(parsed, lambda below: demand(below, library), options.encoding), end="")
    return 0


def _hash_of(name: TypeName, library: Library) -> str:
    """Return the hash of an interface or of a type derived from one; raises InterfaceError."""
    # A struct of an .idl file may have '_' in its name without being derived from anything.
    for base in dict.fromkeys((name, TypeName(name.package, name.kind, name.name.partition("_")[0]))):
        parsed = library.find(base)
        if parsed:
            below = messages_below(parsed, library)
            catalog = Catalog(base.package, {base: parsed.interface}, below, {base: parsed.source})
            found = hashes(catalog).get(name)
            if found:
                return found
    return _missing(name, library)


def _missing(name: TypeName, library: Library) -> NoReturn:
    hint = did_you_mean(str(name), [str(each) for each in library.names()])
    raise InterfaceError(Problem(f"there is no type '{name}'", hint=hint))
