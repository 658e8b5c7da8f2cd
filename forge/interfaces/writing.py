"""Rendered files to a folder: only what changed is touched, and what is no longer made is removed."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from forge.errors import EnvironmentFault, Place, Problem
from forge.files import write_if_changed
from forge.interfaces.model import TypeName

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from forge.interfaces.model import File

_RECORDS = ".forge"
_VERSION = 2


@dataclass(frozen=True, slots=True)
class Record:
    """What one package's run left in a folder: its files, and the types of others among them."""

    files: tuple[str, ...] = ()
    needs: tuple[TypeName, ...] = ()
    folders: Mapping[str, Path] = field(default_factory=dict)
    """Where the definitions of needed packages were."""


def read_records(out: Path) -> dict[str, Record]:
    """Return the records of all packages that were generated into a folder; broken ones count as none."""
    return {path.stem: _read(path) for path in sorted((out / _RECORDS).glob("*.json"))}


def write(
    files: Iterable[File],
    out: Path,
    package: str,
    needs: Iterable[TypeName] = (),
    folders: Mapping[str, Path] | None = None,
) -> tuple[Path, ...]:
    """Write the files of a package's run below `out`; return those that were new or had changed.

    `needs` and `folders` are for the record: types of other packages, and where their definitions are.
    Files of an earlier run of the same package are removed, unless this one or another package
    still makes them, or their language (the first folder of a path) is not of this run.
    Raises EnvironmentFault when the folder cannot be written to.
    """
    texts = {file.path: file.text for file in files}
    languages = {_language(path) for path in texts}
    records = read_records(out)
    before = records.pop(package, Record()).files
    others = [path for path in before if _language(path) not in languages]
    kept = {*others, *(path for record in records.values() for path in record.files)}
    try:
        written = tuple(out / path for path, text in texts.items() if write_if_changed(out / path, text))
        for path in before:
            if path not in texts and path not in kept:
                (out / path).unlink(missing_ok=True)
        record = Record(tuple({*texts, *others}), tuple(needs), folders or {})
        write_if_changed(out / _RECORDS / f"{package}.json", _text(record))
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise EnvironmentFault(Problem(f"cannot write: {reason}", Place(error.filename or out))) from error
    return written


def write_depfile(path: Path, target: Path, sources: Iterable[Path]) -> None:
    """Say, in make's words, which files `target` was made from."""
    names = " \\\n  ".join(map(_for_make, sources))
    write_if_changed(path, f"{_for_make(target)}: {names}\n" if names else f"{_for_make(target)}:\n")


def write_stamp(path: Path) -> None:
    """Make an empty file, or make it young again."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()


def _read(path: Path) -> Record:
    try:
        written = json.loads(path.read_text(encoding="utf-8"))
        if written["version"] != _VERSION:
            return Record()
        return Record(
            tuple(written["files"]),
            tuple(TypeName(*name.split("/")) for name in written["needs"]),
            {name: Path(folder) for name, folder in written["folders"].items()},
        )
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return Record()


def _language(path: str) -> str:
    return path.partition("/")[0]


def _text(record: Record) -> str:
    content = {
        "version": _VERSION,
        "needs": sorted(map(str, record.needs)),
        "folders": {name: str(folder) for name, folder in sorted(record.folders.items())},
        "files": sorted(record.files),
    }
    return json.dumps(content, indent=1) + "\n"


def _for_make(path: Path) -> str:
    """Return a path with what make takes for syntax escaped."""
    return str(path).replace("$", "$$").replace("#", "\\#").replace(" ", "\\ ")
