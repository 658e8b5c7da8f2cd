"""correct definitions of ROS 1, and definitions with invalid names"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from difflib import unified_diff
from pathlib import Path, PurePosixPath

from forge.base.errors import InterfaceError, Problem, SelectionError, WorkspaceError, raise_if_any
from forge.base.files import replace_file
from forge.base.frozen import frozen
from forge.base.options import flag, option
from forge.base.text import counted
from forge.interfaces.model import Source
from forge.interfaces.read.parsing import parse_leniently
from forge.interfaces.read.sources import read_source
from forge.plugins.interface_versions.packages import definitions_in, packages_in
from forge.plugins.interface_versions.rewriting import BUILT_IN, Renamed, rewritten, type_name


@frozen
class Options:
    EPILOG = "Without --write, nothing changes: the exit code is 1 if something would, 0 if not."
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
        return self.text != self.source.text or self.target != self.source.path


def run(options: Options) -> int:
    """Print or apply the changes; returns 1 if something would change.

    Raises InterfaceError for remaining errors, after printing or applying everything else.
    """
    fixes: list[Fix] = []
    packages = [each for folder in options.folders for each in packages_in(Path(folder), _name_of(folder))]
    if not any(any(definitions_in(home)) for _, home in packages):
        hint = "name folders with packages that have folders msg, srv or action"
        raise SelectionError(Problem(f"found no interfaces in '{', '.join(options.folders)}'", hint=hint))
    for package, home in packages:
        found = list(_fixes(package, home))
        fixes += found
        changed = [each for each in found if each.changes]
        if options.write:
            _write(changed)
        else:
            print("".join(map(_preview, changed)), end="")
        for line in _what_follows(package, home, changed):
            print(line)
    changed = [each for each in fixes if each.changes]
    verb = "changed" if options.write else "would change"
    print(f"{verb} {counted(len(changed), 'file')} of {len(fixes)}")
    raise_if_any(_left(fixes, written=options.write), InterfaceError)
    return int(bool(changed) and not options.write)


def _name_of(folder: str) -> str:
    return Path(folder).resolve().name


def _fixes(package: str, home: Path) -> Iterator[Fix]:
    """Yield a fix for each definition of a package, also for valid ones; .idl files stay as they are."""
    sources = [read_source(package, home, relative) for relative in definitions_in(home)]
    sources = [each for each in sources if not each.relative.endswith(".idl")]
    stems = {PurePosixPath(each.relative).stem for each in sources}
    types = {stem: better for stem in stems if (better := type_name(stem)) != stem and better not in stems}
    for source in sources:
        text, names = rewritten(source.text, package, stems, types)
        path = PurePosixPath(source.relative)
        relative = path.with_name(f"{types.get(path.stem, path.stem)}{path.suffix}").as_posix()
        yield Fix(source, relative, text, tuple(names))


def _preview(fix: Fix) -> str:
    """Return the change of a file as a unified diff."""
    old, new = _displayed(fix.source.path), _displayed(fix.target)
    renamed = f"rename {old} => {new}\n" if old != new else ""
    lines = unified_diff(fix.source.text.splitlines(), fix.text.splitlines(), old, new, n=1, lineterm="")
    return renamed + "".join(f"{line}\n" for line in lines)


def _write(fixes: Iterable[Fix]) -> None:
    """Write the files; raises WorkspaceError, before anything is written, if a new name is taken."""
    taken = [each for each in fixes if each.target != each.source.path and os.path.lexists(each.target)]
    problems = (
        Problem(f"'{_displayed(each.target)}' exists already", hint=f"remove it, or '{each.source.path}'")
        for each in taken
    )
    raise_if_any(problems, WorkspaceError)
    for fix in fixes:
        if fix.target != fix.source.path:
            fix.source.path.rename(fix.target)
        replace_file(fix.target, fix.text.encode(), mode=fix.target.stat().st_mode & 0o777)


def _what_follows(package: str, home: Path, fixes: Iterable[Fix]) -> Iterator[str]:
    """Yield further changes that the package needs: in its manifest, CMake code and programs."""
    fixes = tuple(fixes)
    text = "".join(fix.text for fix in fixes)
    manifest = home / "package.xml"
    declared = manifest.read_text(encoding="utf-8", errors="replace") if manifest.is_file() else ""
    needed = {
        name.partition("/")[0] for name in BUILT_IN.values() if f"{name} " in text or f"{name}[" in text
    }
    if missing := sorted(each for each in needed if f">{each}<" not in declared):
        yield f"{package}: declare what the definitions use now: forge add {' '.join(missing)}"
    cmake = home / "CMakeLists.txt"
    listed = cmake.read_text(encoding="utf-8", errors="replace") if cmake.is_file() else ""
    for fix in fixes:
        old = PurePosixPath(fix.source.relative).name
        if old != PurePosixPath(fix.relative).name and old in listed:
            yield f"{package}: in CMakeLists.txt, write {PurePosixPath(fix.relative).name} instead of {old}"
    for fix in fixes:
        if fix.names:
            pairs = ", ".join(f"{each.old} -> {each.new}" for each in fix.names)
            yield f"{package}: update code that uses {PurePosixPath(fix.relative).stem}: {pairs}"


def _left(fixes: Iterable[Fix], *, written: bool) -> Iterator[Problem]:
    """Yield the remaining problems of definitions."""
    for fix in fixes:
        path = fix.target if written else fix.source.path
        _, problems = parse_leniently(Source(fix.source.package, fix.relative, path, fix.text))
        yield from problems


def _displayed(path: Path) -> str:
    return os.path.relpath(path)
