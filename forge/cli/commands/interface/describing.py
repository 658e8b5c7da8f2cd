"""The verbs hash and schema of `forge interface`."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, NoReturn

from forge.base.errors import ForgeError, InterfaceError, Problem
from forge.base.frozen import frozen
from forge.base.names import did_you_mean
from forge.base.options import option, options_of
from forge.cli.commands.interface.inputs import (
    IncludeOptions,
    InputOptions,
    catalog_of,
    known_library,
    require_built,
)
from forge.cli.options import add_verb
from forge.interfaces.hashing import hashes
from forge.interfaces.model import Catalog, TypeName
from forge.interfaces.resolve.dependencies import require
from forge.interfaces.resolve.resolution import nested_messages
from forge.interfaces.schema import ENCODINGS, schema_text
from forge.interfaces.show import parse_type_name

if TYPE_CHECKING:
    from forge.interfaces.read.sources import Library


@frozen
class _HashOptions:
    what: tuple[str, ...] = option(
        "names of types; with --package a folder of definitions",
        default=(),
        positional=True,
        metavar="TYPE|SOURCE_DIR",
    )
    json: bool = option("print one JSON object", default=False)
    inputs: InputOptions = options_of(InputOptions)


@frozen
class _SchemaOptions:
    type: str = option("full name of the type", positional=True, metavar="TYPE")
    encoding: str = option(
        "format of the definitions (default: %(default)s)", default=ENCODINGS[0], choices=tuple(ENCODINGS)
    )
    others: IncludeOptions = options_of(IncludeOptions)


def register(verbs: Any) -> None:
    add_verb(
        verbs,
        "hash",
        "print type hashes (RIHS01) of types or of a folder of definitions",
        _HashOptions,
        _hash,
    )
    add_verb(
        verbs,
        "schema",
        "print a definition with all definitions it refers to, as stored in MCAP and rosbag2 files",
        _SchemaOptions,
        _schema,
    )


def _hash(options: _HashOptions) -> int:
    inputs = options.inputs
    library = known_library(inputs.others.rosdistro, inputs.others.folders)
    if not (inputs.package or inputs.files or options.what):
        hint = "name types, or a folder of definitions with --package"
        raise ForgeError(Problem("missing names of types", hint=hint))
    if inputs.files and not inputs.package:
        raise ForgeError(Problem("missing package name for --file", hint="add --package NAME"))
    if inputs.package:
        found = hashes(catalog_of(inputs, _folder(options), library))
    else:
        found = {name: _hash_of(name, library) for name in map(parse_type_name, options.what)}
    if options.json:
        print(json.dumps({str(name): text for name, text in found.items()}, indent=1))
    else:
        for name, text in found.items():
            print(name, text)
    return 0


def _folder(options: _HashOptions) -> str | None:
    """Return the folder of definitions for --package, None without one."""
    if options.what[1:]:
        hint = "without --package, arguments are names of types"
        raise ForgeError(Problem("--package accepts only one folder of definitions", hint=hint))
    return options.what[0] if options.what else None


def _schema(options: _SchemaOptions) -> int:
    library = known_library(options.others.rosdistro, options.others.folders)
    name = parse_type_name(options.type)
    parsed = library.find(name) or _missing(name, library)
    nested_messages(parsed, library)
    print(schema_text(parsed, lambda below: require(below, library), options.encoding), end="")
    return 0


def _hash_of(name: TypeName, library: Library) -> str:
    """Return the type hash of an interface or of a type derived from one; raises InterfaceError."""
    # A struct of an .idl file may have '_' in its name without being a derived type.
    for base in dict.fromkeys((name, TypeName(name.package, name.kind, name.name.partition("_")[0]))):
        parsed = library.find(base)
        if parsed:
            below = nested_messages(parsed, library)
            catalog = Catalog(base.package, {base: parsed.interface}, below, {base: parsed.source})
            found = hashes(catalog).get(name)
            if found:
                return found
    return _missing(name, library)


def _missing(name: TypeName, library: Library) -> NoReturn:
    require_built(name.package, library)
    hint = did_you_mean(str(name), [str(each) for each in library.names()])
    raise InterfaceError(Problem(f"unknown type '{name}'", hint=hint))
