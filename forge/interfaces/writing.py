"""Write rendered files to a folder: write only changed files and remove obsolete ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.errors import HostError, Location, Problem
from forge.base.files import write_if_changed
from forge.base.frozen import frozen
from forge.interfaces.output_state import OutputState, PartState, file_stat, read_states, write_state

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from forge.interfaces.rendering import Part


@frozen
class Written:
    """The result of a run: the new or changed files, and the total number."""

    changed: tuple[Path, ...]
    total: int


def write(parts: Iterable[Part], out: Path, package: str, state: OutputState | None = None) -> Written:
    """Write the parts of a package below `out`; parts that are up to date are skipped.

    `state` contains the needed types to store. Files of an earlier run of the same package are removed,
    unless this run or another package generates them, or this run does not include their language.
    Raises HostError if the folder is not writable.
    """
    states = read_states(out)
    before = states.pop(package, OutputState())
    changed: list[Path] = []
    written: dict[str, PartState] = {}
    try:
        for part in parts:
            current = before.up_to_date(part.key, part.digest, out)
            if current is None:
                stats = {}
                for file in part.files():
                    if write_if_changed(out / file.path, file.text):
                        changed.append(out / file.path)
                    stats[file.path] = file_stat(out, file.path)
                current = PartState(part.digest, stats)
            written[part.key] = current
        languages = {_language(key) for key in written}
        total = sum(len(each.stats) for each in written.values())
        written |= {key: each for key, each in before.parts.items() if _language(key) not in languages}
        new = OutputState(written, *((state.needs, state.folders) if state else ()))
        current_files = {*new.files, *(path for each in states.values() for path in each.files)}
        for path in set(before.files) - current_files:
            (out / path).unlink(missing_ok=True)
        write_state(out, package, new)
    except OSError as error:
        raise unwritable(error, out) from error
    return Written(tuple(changed), total)


def unwritable(error: OSError, out: Path) -> HostError:
    """Return the error for a file below `out` that could not be written."""
    reason = (error.strerror or str(error)).lower()
    return HostError(Problem(f"cannot write: {reason}", Location(error.filename or out)))


def write_depfile(path: Path, target: Path, sources: Iterable[Path]) -> None:
    """Write a make depfile with the inputs of `target`.

    Raises HostError for a path that make cannot represent.
    """
    inputs = tuple(sources)
    invalid = [each for each in (target, *inputs) if any(sign in str(each) for sign in "\n\r\0;")]
    if invalid:
        hint = "rename the folder: paths must not contain ';' or line breaks"
        raise HostError(Problem(f"make cannot handle the path {str(invalid[0])!r}", hint=hint))
    names = " \\\n  ".join(map(_for_make, inputs))
    write_if_changed(path, f"{_for_make(target)}: {names}\n" if names else f"{_for_make(target)}:\n")


def write_stamp(path: Path) -> None:
    """Create an empty file, or update its modification time."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()


def _language(key: str) -> str:
    return key.partition(" ")[0]


def _for_make(path: Path) -> str:
    return str(path).replace("$", "$$").replace("#", "\\#").replace(" ", "\\ ")
