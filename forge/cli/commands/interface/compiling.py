"""The verb generate of `forge interface`: generate code and descriptions from definitions."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from forge.base.distributions import EMBEDDED
from forge.base.env_vars import compiled_templates
from forge.base.errors import InterfaceError, Problem, print_warnings, raise_if_any
from forge.base.files import text_or_nothing
from forge.base.frozen import frozen
from forge.base.options import flag, option, options_of
from forge.base.templating import keep_compiled
from forge.base.text import counted
from forge.cli.commands.interface.inputs import InputOptions, catalog_of, library_of
from forge.cli.options import add_verb
from forge.engine.observed import keep
from forge.interfaces import writing
from forge.interfaces.model import Catalog
from forge.interfaces.read.lint import python_keywords
from forge.interfaces.read.sources import read_runtime
from forge.interfaces.rendering import Part, fingerprints, parts
from forge.interfaces.resolve.resolution import dependency_catalogs, undeclared_dependencies

_DEFAULT_LANGUAGES = ("python", "cpp")


@frozen
class _Options:
    EPILOG = "@FILE reads arguments from FILE, one per line"
    source: str | None = option(
        "folder with subfolders msg, srv or action", positional=True, nargs="?", metavar="SOURCE_DIR"
    )
    inputs: InputOptions = options_of(InputOptions)
    output: Path = option(
        "output folder; files go to python/NAME, cpp/NAME and so on",
        parse=Path,
        required=True,
        metavar="DIR",
    )
    languages: tuple[str, ...] | None = option(
        "output to generate: python, cpp, c, idl, json, jsonschema or docs; repeatable (default: "
        f"{' and '.join(_DEFAULT_LANGUAGES)})",
        flag="--lang",
        repeats=True,
        metavar="LANG",
    )
    no_runtime: bool = flag(
        "do not write run-time files and types of other packages; allow only types of included packages"
    )
    stamp: Path | None = option("file to touch after success", parse=Path, metavar="FILE")
    depfile: Path | None = option(
        "write a make rule with all files read to this file", parse=Path, metavar="FILE"
    )


def register(verbs: Any) -> None:
    summary = "compile definitions to Python, C++, C, IDL, JSON, JSON Schema or Markdown"
    add_verb(verbs, "generate", summary, _Options, _generate, fromfile_prefix_chars="@")


def _generate(options: _Options) -> int:
    inputs = options.inputs
    states = writing.read_states(options.output)
    before = states.get(inputs.package or "", writing.OutputState())
    if before.parts:
        # Also if this run fails.
        ledger = writing.ledger_of(inputs.package or "", options.output)
        content = text_or_nothing(ledger).encode()
        earlier = [f"{options.output}/{path}" for path in before.files]
        keep(ledger, content, (*earlier, *filter(None, (options.depfile,))))
    library = library_of(inputs.others)
    bases = (options.source, *(base for base, _ in inputs.files))
    library.manifest = next((Path(base) / "package.xml" for base in bases if base), None)
    catalog = catalog_of(inputs, options.source, library)
    if options.no_runtime:
        raise_if_any(undeclared_dependencies(catalog, dict(inputs.others.includes), library), InterfaceError)
    print_warnings(python_keywords(catalog.interfaces.values()))
    needed = () if options.no_runtime else dependency_catalogs(catalog, library)
    others = () if options.no_runtime else _others(catalog, options, states)
    folders = {each.package: library.folder(each.package) for each in needed}
    state = writing.OutputState(
        needs=tuple(name for each in needed for name in each.interfaces),
        folders={
            package: folder.absolute()
            for package, folder in folders.items()
            if folder and not folder.is_relative_to(EMBEDDED)
        },
    )
    keep_compiled(*compiled_templates(os.environ, options.output / writing.STATE_FOLDER / "templates"))
    catalogs = (catalog, *others)
    languages = tuple(dict.fromkeys(options.languages or _DEFAULT_LANGUAGES))
    digests = fingerprints(catalogs, f"{writing.generator_digest()} {library.rosdistro}")
    found = [part for language in languages for each in catalogs for part in parts(each, language, digests)]
    if not options.no_runtime:
        found += [
            Part(language, "run-time files", None, partial(read_runtime, language)) for language in languages
        ]
    written = writing.write(found, options.output, catalog.package, state, states)
    keep(writing.ledger_of(catalog.package, options.output), written.ledger)
    if options.depfile:
        sources = [source.path for each in (catalog, *others) for source in each.sources.values()]
        writing.write_depfile(options.depfile, options.stamp or options.output, dict.fromkeys(sources))
    if options.stamp:
        options.stamp.parent.mkdir(parents=True, exist_ok=True)
        options.stamp.touch()
    else:
        print(f"{len(written.changed)} of {counted(written.total, 'file')} written to '{options.output}'")
    return 0


def _others(
    catalog: Catalog, options: _Options, found: Mapping[str, writing.OutputState]
) -> tuple[Catalog, ...]:
    """Return the types of other packages that the packages in the output folder need.

    Several packages may share the output folder: one run must not remove files that another package needs.
    Packages that are generated as a whole into the folder are left out.
    """
    states = {package: state for package, state in found.items() if package != catalog.package}
    whole = {catalog.package, *states}
    folders = dict(pair for state in states.values() for pair in state.folders.items())
    library = library_of(options.inputs.others, folders)
    needs = []
    for package, state in states.items():
        partial = [name for name in state.needs if name.package not in whole]
        if lost := [name for name in partial if library.find(name) is None]:
            message = f"cannot find '{lost[0]}', which '{package}' needs"
            hint = f"generate '{package}' again, or remove '{options.output}'"
            raise InterfaceError(Problem(message, hint=hint))
        needs += partial
    return tuple(
        other for other in dependency_catalogs(catalog, library, needs) if other.package not in whole
    )
