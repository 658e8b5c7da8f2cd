"""The problems of one file: those that the compiler reports, and those of `--strict` as warnings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.errors import InterfaceError, Location, Problem
from forge.base.frozen import frozen
from forge.build.build_types import is_known_type, unknown_type
from forge.interfaces.model import Catalog
from forge.interfaces.read.lint import lint
from forge.interfaces.read.parsing import Parsed
from forge.interfaces.resolve.dependencies import undeclared_dependencies
from forge.interfaces.resolve.resolution import nested_messages, same_output
from forge.plugins.lsp.nearby import NearbyTypes
from forge.plugins.lsp.text import span_at

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from forge.base.errors import Severity
    from forge.interfaces.read.occurrences import Reading
    from forge.plugins.lsp.index import Index
    from forge.plugins.lsp.manifests import ManifestReading
    from forge.plugins.lsp.text import Span


@frozen
class Diagnostic:
    """A problem with a part of a file."""

    span: Span
    severity: Severity
    message: str


def diagnose(index: Index, path: Path) -> tuple[Diagnostic, ...]:
    """Return the problems of a file, in the order of their lines."""
    manifest, reading = index.manifest(path), index.reading(path)
    if manifest:
        lines = manifest.text.split("\n")
        found = [*_all(manifest.errors, "error", lines), *_all(manifest.warnings, "warning", lines)]
        found += _unsupported(index, manifest)
    elif reading:
        lines = reading.source.text.splitlines()
        errors = (*reading.problems, *_unresolved(index, reading))
        found = _all(errors, "error", lines)
        wrong = {each.span.line for each in found}
        found += [d for d in _all(_doubtful(index, reading), "warning", lines) if d.span.line not in wrong]
    else:
        found = []
    return tuple(sorted(dict.fromkeys(found), key=lambda each: (each.span.line, each.span.start)))


def _all(problems: Iterable[Problem], severity: Severity, lines: list[str]) -> list[Diagnostic]:
    return [Diagnostic(span_at(problem.location, lines), severity, _message(problem)) for problem in problems]


def _message(problem: Problem) -> str:
    return f"{problem.message}\nhint: {problem.hint}" if problem.hint else problem.message


def _unsupported(index: Index, reading: ManifestReading) -> Iterator[Diagnostic]:
    """Yield the problem of a build type that is unknown, unless the workspace assigns another one."""
    manifest, span = reading.manifest, reading.build_type
    if manifest and span and not (is_known_type(manifest.build_type) or index.assigns_type(reading.path)):
        yield Diagnostic(span, "error", _message(unknown_type(manifest)))


def _unresolved(index: Index, reading: Reading) -> Iterator[Problem]:
    """Yield unknown types and cycles; those in other files are problems of these files."""
    if reading.interface is None:
        return
    try:
        nested_messages(Parsed(reading.source, reading.interface), NearbyTypes(index, reading))
    except InterfaceError as error:
        own = str(reading.source.path)
        for problem in error.problems:
            if problem.location is None or str(problem.location.path) == own:
                yield problem


def _doubtful(index: Index, reading: Reading) -> Iterator[Problem]:
    """Yield conflicts of files, missing dependencies of the package, and what `--strict` rejects.

    Conflicts are warnings, since CMake decides which files of the package are generated.
    """
    own = reading.source.path
    for path, name in index.same_outputs(reading.name).items():
        if name != reading.name:
            yield same_output(reading.name, name, own)
        elif path != own:
            yield Problem(f"'{name}' is also defined in '{path.relative_to(index.root)}'", Location(own))
    if reading.interface is None:
        return
    manifest = index.manifest_of(reading.source.path)
    if manifest:
        catalog = Catalog(reading.source.package, {reading.name: reading.interface}, {}, {})
        yield from undeclared_dependencies(catalog, manifest.dependencies, index)
    if not reading.problems:
        yield from lint([Parsed(reading.source, reading.interface)])
