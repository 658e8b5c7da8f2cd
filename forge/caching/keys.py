"""Keys of the package cache: what a package is made from, in words that are the same at every path.

A build tells which files outside of the workspace it read only after it has run. So a package has two
keys. The first is of all that is known before; it leads to lists of such files, each as an earlier build
had it. The second is of the first and of what the files of one list say now; it leads to the result.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import platform
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge import __version__
from forge.caching.relocation import PLAIN, SPACED
from forge.digests import contents_of, digest_of, source_files
from forge.frozen import frozen
from forge.tools import program_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from forge.caching.relocation import Places
    from forge.digests import FileTable
    from forge.model import Pairs, Task

_VERSION = 1
_MOST_LISTS = 4
"""Lists of files that are remembered for one key; builds of one source seldom read more kinds of sets."""


@frozen
class Inputs:
    """Files outside of the workspace that a build read, and where its result holds.

    `bound` says why it holds at one path alone, '' if it does not; `kind` is that of the paths where it was
    made.
    """

    paths: tuple[str, ...]
    bound: str = ""
    kind: str = PLAIN

    def holds_at(self, places: Places) -> bool:
        """Tell if the result can be put where these places are: quotes may be too many, never too few."""
        return bool(self.bound) or places.kind == self.kind or (places.kind == PLAIN and self.kind == SPACED)


def circumstances(tools: Pairs, table: FileTable) -> tuple[str, ...]:
    """Return what holds for every package: forge by its own files, the programs by theirs, the system.

    `table` is for these files alone, and saved.
    """
    home = Path(__file__).parents[1]
    own = [path for folder in _own_folders(home) for path in source_files(str(folder), "embedded")]
    said = contents_of(own, table)
    mine = [f"{os.path.relpath(path, home.parent)} {said[path]}" for path in own]
    programs = {name: os.path.realpath(program_of(identity)) for name, identity in tools}
    found = contents_of(programs.values(), table)
    table.forget_others({*said, *found})
    with contextlib.suppress(OSError):  # a home that may only be read
        table.save()
    return (
        f"{__version__} {hashlib.sha256(chr(10).join(mine).encode(errors='surrogateescape')).hexdigest()}",
        *(f"{name} {found[path]}" for name, path in sorted(programs.items())),
        *_system(),
        f"umask {_umask():03o}",
    )


def first_key(task: Task, needs: Sequence[tuple[str, str]], held: tuple[str, ...], places: Places) -> str:
    """Return the key of all that is known of a task before it runs, what it needs included."""
    parts = task.parts
    return _key(
        task.name,
        held,
        [places.loose_word(word) for word in parts.options],
        [[name, places.loose_word(value)] for name, value in parts.environment],
        parts.sources,
        needs,
    )


def second_key(first: str, inputs: Inputs, contents: Mapping[str, str], places: Places) -> str:
    """Return the key of a result: of the first, and of what the files outside of the workspace say.

    `contents` has that by the words of `inputs.paths`.
    """
    said = digest_of(inputs.paths, contents)
    where = [[name, path.decode(errors="replace")] for name, path in places.paths] if inputs.bound else []
    return _key(first, said, inputs.kind, where)


def written(lists: Iterable[Inputs]) -> bytes:
    """Return lists of inputs as JSON, the first as many as are kept."""
    found = list(dict.fromkeys(lists))[:_MOST_LISTS]
    said = [[*one.paths, one.kind, one.bound] for one in found]
    return json.dumps({"forge_inputs": _VERSION, "lists": said}).encode()


def read(said: bytes) -> tuple[Inputs, ...]:
    """Return the lists that `written` wrote; nothing for what it did not."""
    try:
        found: Mapping[str, Any] = json.loads(said)
        if found["forge_inputs"] != _VERSION:
            return ()
        lists = [[_text(word) for word in one] for one in found["lists"][:_MOST_LISTS]]
        return tuple(Inputs(tuple(words), bound, kind) for *words, kind, bound in lists)
    except (ValueError, LookupError, TypeError, RecursionError):
        return ()


def _key(*said: object) -> str:
    return hashlib.sha256(json.dumps([_VERSION, *said]).encode()).hexdigest()


def _own_folders(home: Path) -> list[Path]:
    return [home] if (home / "_templates").is_dir() else [home, home.parent / "templates"]


def _system() -> tuple[str, ...]:
    """Return what tells systems apart whose results do not run on each other."""
    try:
        release = platform.freedesktop_os_release()
    except OSError:
        release = {}
    words = (platform.system(), platform.machine(), *platform.libc_ver())
    return (*words, release.get("ID", ""), release.get("VERSION_ID", ""))


def _umask() -> int:
    """Return what rights the files of a build lack; /proc says so without changing it for a moment."""
    with contextlib.suppress(OSError, ValueError, StopIteration):
        lines = Path("/proc/self/status").read_text(encoding="utf-8", errors="replace").splitlines()
        return int(next(line for line in lines if line.startswith("Umask:")).split()[1], 8)
    mask = os.umask(0o077)
    os.umask(mask)
    return mask


def _text(said: object) -> str:
    if not isinstance(said, str):
        raise TypeError("no text")
    return said
