"""correct definitions of ROS 1, and definitions with invalid names"""

from __future__ import annotations

import os
from collections.abc import Collection, Container, Iterable, Iterator, Mapping
from difflib import unified_diff
from pathlib import Path, PurePosixPath

from forge.base.errors import InterfaceError, Location, Problem, SelectionError, WorkspaceError, raise_if_any
from forge.base.files import text_or_nothing
from forge.base.frozen import frozen
from forge.base.options import flag, option
from forge.base.text import counted
from forge.interfaces.model import Source, sections_of
from forge.interfaces.read.parsing import parse_leniently
from forge.interfaces.read.sources import read_source
from forge.plugins.interface_versions.rewriting import (
    BUILT_IN,
    Renamed,
    retyped,
    rewritten,
    texts_of_ros1,
    type_name,
)
from forge.plugins.interface_versions.versions import definitions_in, packages_in, workspace_packages


@frozen
class Options:
    EPILOG = "Without --write, no file is changed: the exit code is 1 if files would change, else 0."
    folders: tuple[str, ...] = option(
        "folders with packages (default: this folder)", default=(".",), positional=True, metavar="DIR"
    )
    write: bool = flag("change and rename the files")


@frozen
class Fix:
    """A definition and its corrected version."""

    source: Source
    relative: str
    text: str
    names: tuple[Renamed, ...]

    @property
    def target(self) -> Path:
        return self.source.path.parent / PurePosixPath(self.relative).name

    @property
    def changes(self) -> bool:
        return not self.source.path.is_symlink() and self.has_faults

    @property
    def has_faults(self) -> bool:
        return self.text != self.source.text or self.target != self.source.path


def run(options: Options) -> int:
    """Print or apply the changes; returns 1 if something would change.

    Raises InterfaceError for remaining errors, after printing or applying everything else.
    """
    packages = [
        each for folder in options.folders for each in packages_in(Path(folder), Path(folder).resolve().name)
    ]
    if not any(any(definitions_in(home)) for _, home in packages):
        hint = "name folders with packages that have folders msg, srv or action"
        raise SelectionError(Problem(f"found no interfaces in '{', '.join(options.folders)}'", hint=hint))
    unread: list[Problem] = []
    sources = {home: [*_sources(package, home, unread)] for package, home in packages}
    types = dict(pair for home in sources for pair in _new_names(sources[home]))
    fixes_by_home = {
        home: [_fix(each, of_package, types) for each in of_package] for home, of_package in sources.items()
    }
    fixes = [each for of_package in fixes_by_home.values() for each in of_package]
    used = [*_uses_elsewhere(types, {home.resolve() for home in sources}, unread)]
    changed = [each for each in (*fixes, *used) if each.changes]
    raise_if_any(_collisions(changed), WorkspaceError)
    if options.write:
        _write(changed)
    else:
        print("".join(map(_preview, changed)), end="")
    for package, home in packages:
        for line in _what_follows(package, home, fixes_by_home[home]):
            print(line)
    verb = "changed" if options.write else "would change"
    print(f"{verb} {counted(len(changed), 'file')} of {len(fixes) + len(used)}")
    raise_if_any((*unread, *_left(fixes, written=options.write)), InterfaceError)
    return int(bool(changed) and not options.write)


def _sources(package: str, home: Path, unread: list[Problem]) -> Iterator[Source]:
    """Yield the definitions of a package, without .idl files, which are not changed.

    The problems of those that cannot be read are added to `unread`.
    """
    for relative in definitions_in(home):
        if not relative.endswith(".idl"):
            try:
                yield read_source(package, home, relative)
            except InterfaceError as error:
                unread += error.problems


def _new_names(sources: Iterable[Source]) -> Iterator[tuple[str, str]]:
    """Yield the full names of the invalid types of a package, and valid replacements."""
    stems = {PurePosixPath(each.relative).stem: each.package for each in sources}
    for stem, package in stems.items():
        if (better := type_name(stem)) != stem and better not in stems:
            yield f"{package}/{stem}", better


def _fix(source: Source, siblings: Iterable[Source], types: Mapping[str, str]) -> Fix:
    """Return the fix of a definition, which may be valid already.

    `siblings` are the definitions of its package.
    """
    own = {PurePosixPath(each.relative).stem for each in siblings}
    text, names = rewritten(source.text, source.package, own, types)
    path = PurePosixPath(source.relative)
    stem = types.get(f"{source.package}/{path.stem}", path.stem)
    return Fix(source, path.with_name(f"{stem}{path.suffix}").as_posix(), text, tuple(names))


def _uses_elsewhere(types: Mapping[str, str], homes: Container[Path], unread: list[Problem]) -> Iterator[Fix]:
    """Yield the definitions in other packages of the workspace that use renamed types."""
    for package, home in workspace_packages().items() if types else ():
        if home.resolve() not in homes:
            for source in _sources(package, home, unread):
                if (text := retyped(source.text, types)) != source.text:
                    yield Fix(source, source.relative, text, ())


def _preview(fix: Fix) -> str:
    """Return the change of a file as a unified diff."""
    old, new = map(os.path.relpath, (fix.source.path, fix.target))
    renamed = f"rename {old} => {new}\n" if old != new else ""
    lines = unified_diff(fix.source.text.splitlines(), fix.text.splitlines(), old, new, n=1, lineterm="")
    return renamed + "".join(f"{line}\n" for line in lines)


def _collisions(fixes: Iterable[Fix]) -> Iterator[Problem]:
    """Yield a problem for each new name that another definition has or will get."""
    new: dict[Path, Path] = {}
    for fix in fixes:
        source, target = fix.source.path, fix.target
        if target == source:
            continue
        other = new.setdefault(target, source)
        if other != source:
            paths = " and ".join(f"'{os.path.relpath(path)}'" for path in (source, other))
            yield Problem(f"{paths} would both be called '{target.name}'", hint="rename one of them")
        for path in dict.fromkeys((target, target.with_suffix(".idl"))):
            if os.path.lexists(path):
                yield Problem(f"'{os.path.relpath(path)}' exists already", hint=f"remove it, or '{source}'")


def _write(fixes: Iterable[Fix]) -> None:
    """Write all files beside the old ones before the first of these is replaced or removed."""
    drafts: dict[Path, Fix] = {}
    try:
        for fix in fixes:
            draft = fix.target.with_name(f".{fix.target.name}.forge-draft")
            drafts[draft] = fix
            draft.write_bytes(fix.text.encode())
            draft.chmod(fix.source.path.stat().st_mode & 0o777)
    except BaseException:
        for draft in drafts:
            draft.unlink(missing_ok=True)
        raise
    for draft, fix in drafts.items():
        draft.replace(fix.target)
        if fix.target != fix.source.path:
            fix.source.path.unlink()


def _what_follows(package: str, home: Path, fixes: Collection[Fix]) -> Iterator[str]:
    """Yield further required changes of the package: in its manifest, CMake code and programs."""
    changed = [each for each in fixes if each.changes]
    text = "".join(fix.text for fix in changed)
    declared, listed = (text_or_nothing(home / name) for name in ("package.xml", "CMakeLists.txt"))
    needed = {
        name.partition("/")[0] for name in BUILT_IN.values() if f"{name} " in text or f"{name}[" in text
    }
    if missing := sorted(each for each in needed if f">{each}<" not in declared):
        yield f"{package}: declare the dependencies of the definitions: forge add {' '.join(missing)}"
    for fix in changed:
        old = PurePosixPath(fix.source.relative).name
        if old != fix.target.name and old in listed:
            yield f"{package}: in CMakeLists.txt, write {fix.target.name} instead of {old}"
    for fix in changed:
        if fix.names:
            pairs = ", ".join(f"{each.old} -> {each.new}" for each in fix.names)
            yield f"{package}: update code that uses {fix.target.stem}: {pairs}"
    for fix in fixes if changed else ():
        interface, _ = parse_leniently(Source(fix.source.package, fix.relative, fix.target, fix.text))
        for section, before in zip(sections_of(interface), texts_of_ros1(fix.text), strict=False):
            for each in section.constants:
                if before.get(each.name, each.value) != each.value:
                    text = f"is {str(each.value)!r}; in ROS 1, it was {before[each.name]!r}"
                    yield f"{package}: the constant {each.name} of {fix.target.stem} {text}"


def _left(fixes: Iterable[Fix], *, written: bool) -> Iterator[Problem]:
    """Yield the remaining problems of definitions."""
    for fix in fixes:
        path = fix.target if written and fix.changes else fix.source.path
        if fix.source.path.is_symlink() and fix.has_faults:
            hint = "name a folder with the file that it refers to"
            yield Problem("a symbolic link to a definition is not changed", Location(path), hint)
            continue
        _, problems = parse_leniently(Source(fix.source.package, fix.relative, path, fix.text))
        yield from problems
