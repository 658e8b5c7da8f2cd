"""Rendered files to a folder: only what changed is touched, and what is no longer made is removed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.errors import EnvironmentFault, Place, Problem
from forge.files import write_if_changed
from forge.frozen import frozen
from forge.interfaces.records import Made, Record, mark_of, read_records, write_record

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from forge.interfaces.rendering import Part


@frozen
class Written:
    """What a run did: the files that were new or had changed, of how many."""

    changed: tuple[Path, ...]
    total: int


def write(parts: Iterable[Part], out: Path, package: str, record: Record | None = None) -> Written:
    """Write the parts of a package's run below `out`; one that is there, made from the same, is left alone.

    `record` says what else to remember of the run. Files of an earlier run of the same package are
    removed, unless this one or another package still makes them, or their language is not of this run.
    Raises EnvironmentFault when the folder cannot be written to.
    """
    records = read_records(out)
    before = records.pop(package, Record())
    changed: list[Path] = []
    made: dict[str, Made] = {}
    try:
        for part in parts:
            made[part.key] = before.fresh(part.key, part.digest, out) or _make(part, out, changed)
        languages = {_language(key) for key in made}
        total = sum(len(each.marks) for each in made.values())
        made |= {key: each for key, each in before.parts.items() if _language(key) not in languages}
        new = Record(made, *((record.needs, record.folders) if record else ()))
        kept = {*new.files, *(path for each in records.values() for path in each.files)}
        for path in set(before.files) - kept:
            (out / path).unlink(missing_ok=True)
        write_record(out, package, new)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise EnvironmentFault(Problem(f"cannot write: {reason}", Place(error.filename or out))) from error
    return Written(tuple(changed), total)


def _make(part: Part, out: Path, changed: list[Path]) -> Made:
    """Render a part and write what is not there already, to be found in `changed`."""
    marks = {}
    for file in part.files():
        path = out / file.path
        if write_if_changed(path, file.text):
            changed.append(path)
        marks[file.path] = mark_of(out, file.path)
    return Made(part.digest, marks)


def write_depfile(path: Path, target: Path, sources: Iterable[Path]) -> None:
    """Say, in make's words, which files `target` was made from.

    Raises EnvironmentFault for a path that make has no word for.
    """
    listed = tuple(sources)
    unfit = [each for each in (target, *listed) if not _fits_a_rule(str(each))]
    if unfit:
        hint = "move it to a folder without ';' and line breaks in its name"
        raise EnvironmentFault(Problem(f"{str(unfit[0])!r} cannot stand in a make rule", hint=hint))
    names = " \\\n  ".join(map(_for_make, listed))
    write_if_changed(path, f"{_for_make(target)}: {names}\n" if names else f"{_for_make(target)}:\n")


def write_stamp(path: Path) -> None:
    """Make an empty file, or make it young again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()


def _language(key: str) -> str:
    return key.partition(" ")[0]


def _fits_a_rule(path: str) -> bool:
    return not any(sign in path for sign in "\n\r\0;")


def _for_make(path: Path) -> str:
    """Return a path with what make takes for syntax escaped."""
    return str(path).replace("$", "$$").replace("#", "\\#").replace(" ", "\\ ")
