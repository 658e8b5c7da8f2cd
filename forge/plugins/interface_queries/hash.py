"""print type hashes (RIHS01) of types or of a folder of definitions"""

from __future__ import annotations

import json
from typing import NoReturn

from forge.base.errors import ForgeError, InterfaceError, Problem
from forge.base.frozen import frozen
from forge.base.names import did_you_mean
from forge.base.options import flag, option, options_of
from forge.cli.commands.interface.inputs import InputOptions, catalog_of, known_library, require_built
from forge.cli.options import profile_option
from forge.interfaces.hashing import hashes
from forge.interfaces.model import Catalog, TypeName
from forge.interfaces.read.sources import Library
from forge.interfaces.resolve.resolution import nested_messages
from forge.interfaces.show import parse_type_name


@frozen
class Options:
    what: tuple[str, ...] = option(
        "names of types; with --package a folder of definitions",
        default=(),
        positional=True,
        metavar="TYPE|SOURCE_DIR",
    )
    json: bool = flag("print one JSON object")
    inputs: InputOptions = options_of(InputOptions)
    profile: str | None = profile_option()


def run(options: Options) -> int:
    inputs = options.inputs
    library = known_library(inputs.others.rosdistro, inputs.others.folders, options.profile)
    if not (inputs.package or inputs.files or options.what):
        hint = "name types, or a folder of definitions with --package"
        raise ForgeError(Problem("missing names of types", hint=hint))
    if inputs.files and not inputs.package:
        raise ForgeError(Problem("missing package name for --file", hint="add --package NAME"))
    if inputs.package:
        if options.what[1:]:
            hint = "without --package, arguments are names of types"
            raise ForgeError(Problem("--package accepts only one folder of definitions", hint=hint))
        folder = options.what[0] if options.what else None
        type_hashes = hashes(catalog_of(inputs, folder, library, options.profile))
    else:
        type_hashes = {
            name: _hash_of(name, library, options.profile) for name in map(parse_type_name, options.what)
        }
    if options.json:
        print(json.dumps({str(name): text for name, text in type_hashes.items()}, indent=1))
    else:
        for name, text in type_hashes.items():
            print(name, text)
    return 0


def _hash_of(name: TypeName, library: Library, profile: str | None) -> str:
    """Return the type hash of an interface or of a type derived from one; raises InterfaceError."""
    # A struct of an .idl file may have '_' in its name without being a derived type.
    for base in dict.fromkeys((name, TypeName(name.package, name.kind, name.name.partition("_")[0]))):
        parsed = library.find(base)
        if parsed:
            below = nested_messages(parsed, library)
            catalog = Catalog(base.package, {base: parsed.interface}, below, {base: parsed.source})
            type_hash = hashes(catalog).get(name)
            if type_hash:
                return type_hash
    return unknown_type(name, library, profile)


def unknown_type(name: TypeName, library: Library, profile: str | None) -> NoReturn:
    """Raise InterfaceError for a type that is not defined."""
    require_built(name.package, library, profile)
    hint = did_you_mean(str(name), [str(each) for each in library.names()])
    raise InterfaceError(Problem(f"unknown type '{name}'", hint=hint))
