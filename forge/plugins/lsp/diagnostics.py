"""The problems of one file: those that the compiler reports, and those of `--strict` as warnings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property
from itertools import islice
from pathlib import Path

from forge.base.errors import InterfaceError, Location, Problem, Severity
from forge.base.extensions import OPTIONS, find, is_installed
from forge.base.frozen import frozen
from forge.base.names import nearest
from forge.build.build_types import known_types, unknown_type
from forge.interfaces.model import Catalog, Message, TypeName
from forge.interfaces.read.parsing import Parsed
from forge.interfaces.resolve.resolution import (
    MAX_EXPLAINED,
    nested_messages,
    same_output,
    undeclared_dependencies,
)
from forge.plugins.lsp.index import Index
from forge.plugins.lsp.manifests import ManifestReading
from forge.plugins.lsp.occurrences import Reading
from forge.plugins.lsp.text import Span, span_at


@frozen
class Diagnostic:
    """A problem with a part of a file."""

    span: Span
    severity: Severity
    message: str


def diagnose(index: Index, path: Path) -> tuple[Diagnostic, ...]:
    """Return the problems of a file, in the order of their lines."""
    manifest, reading = index.manifests.get(path), index.readings.get(path)
    if manifest:
        lines = manifest.text.split("\n")
        diagnostics = [*_all(manifest.errors, "error", lines), *_all(manifest.warnings, "warning", lines)]
        diagnostics += _unsupported(index, manifest)
    elif reading:
        lines = reading.source.text.splitlines()
        errors = (*reading.problems, *_unresolved(index, reading))
        diagnostics = _all(errors, "error", lines)
        error_lines = {each.span.line for each in diagnostics}
        diagnostics += [
            diagnostic
            for diagnostic in _all(_doubtful(index, reading), "warning", lines)
            if diagnostic.span.line not in error_lines
        ]
    else:
        diagnostics = []
    return tuple(sorted(dict.fromkeys(diagnostics), key=lambda each: (each.span.line, each.span.start)))


def _all(problems: Iterable[Problem], severity: Severity, lines: list[str]) -> list[Diagnostic]:
    return [Diagnostic(span_at(problem.location, lines), severity, _message(problem)) for problem in problems]


def _message(problem: Problem) -> str:
    return f"{problem.message}\nhint: {problem.hint}" if problem.hint else problem.message


def _unsupported(index: Index, reading: ManifestReading) -> Iterator[Diagnostic]:
    """Yield the problem of a build type that is unknown, unless the workspace assigns another one."""
    manifest, span = reading.manifest, reading.build_type
    if manifest and span and not (manifest.build_type in known_types() or reading.path in index.assigned):
        yield Diagnostic(span, "error", _message(unknown_type(manifest)))


def _unresolved(index: Index, reading: Reading) -> Iterator[Problem]:
    """Yield unknown types and cycles; errors in other files are reported there."""
    if reading.interface is None:
        return
    try:
        nested_messages(Parsed(reading.source, reading.interface), _NearbyTypes(index, reading))
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
    if not reading.problems and is_installed(OPTIONS, "strict"):
        yield from find(OPTIONS, "strict", "option").lint([Parsed(reading.source, reading.interface)])


class _NearbyTypes:
    """The types that a file refers to, and those that contain it; all others are treated as empty.

    Only messages that contain the file's own message can form a cycle with it.
    """

    def __init__(self, index: Index, reading: Reading) -> None:
        self._index = index
        self._reading = reading
        self._containers = {reading.name}
        pending = [reading.name]
        while pending:
            users = filter(None, (index.readings.get(user) for user, _ in index.uses(pending.pop())))
            new_names = {user.name for user in users} - self._containers
            self._containers |= new_names
            pending += new_names

    def find(self, name: TypeName) -> Parsed | None:
        """Return an interface; the contents of a message that cannot lead to a cycle are left out."""
        parsed = self._index.find(name)
        if parsed is None or name in self._containers or not isinstance(parsed.interface, Message):
            return parsed
        return Parsed(parsed.source, Message(name))

    def names(self) -> Iterable[TypeName]:
        """Return the names that are similar to an unknown one in the file, of its own or another package."""
        return self._names

    @cached_property
    def _names(self) -> tuple[TypeName, ...]:
        missing = (
            each.type
            for each in self._reading.occurrences
            if each.type and self._index.find_or_none(each.type) is None
        )
        unknown = set(islice(missing, MAX_EXPLAINED))
        names = list(self._index.names())
        packages = {name.package for name in names}
        wanted = {name.package for name in unknown}
        near_packages = wanted | {nearest(package, packages) for package in wanted}
        stems = {name.name for name in unknown}
        return tuple(name for name in names if name.package in near_packages or name.name in stems)

    def distribution_hint(self, name: TypeName) -> str | None:
        """Return which ROS distributions have an interface that this one lacks, or None."""
        return self._index.distribution_hint(name)

    def declares(self, package: str) -> bool:
        """Return whether the manifest of the file's package declares a package."""
        manifest = self._index.manifest_of(self._reading.source.path)
        return manifest is not None and package in manifest.dependencies
