"""Keys of the package cache: path-independent digests of the inputs of a package.

The files that a build reads outside the workspace are known only after it ran. Therefore a package has two
keys. The first covers all inputs known before the build; its entry contains lists of external files recorded
by earlier builds. The second covers the first key and the current contents of the files in one list; its
entry is the result.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import platform
import re
from typing import TYPE_CHECKING, Any

from forge import __version__
from forge.base.files import text_or_nothing
from forge.base.frozen import frozen
from forge.base.layout import NO_CODE, PACKAGE, own_folders
from forge.build.inputs.fingerprints import contents_of, digest_of, source_files
from forge.cache.relocation import QuotingClass
from forge.toolchain.programs import program_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from forge.base.frozen import Pairs
    from forge.build.inputs.fingerprints import FileTable
    from forge.build.tasks import Task
    from forge.cache.relocation import Relocator

_VERSION = 1
_MAX_LISTS = 4
"""The number of file lists stored for one key."""


@frozen
class ExternalFileList:
    """The files outside the workspace that a build read, and the paths at which its result is valid.

    `absolute_path_reason` tells why it is valid at one path only, '' if it is relocatable; `quoting` is that
    of the paths where it was built.
    """

    paths: tuple[str, ...]
    absolute_path_reason: str = ""
    quoting: QuotingClass = QuotingClass.PLAIN

    def valid_for(self, relocator: Relocator) -> bool:
        """Return True if the result can be relocated to these paths: extra quotes are harmless."""
        return (
            bool(self.absolute_path_reason)
            or relocator.quoting == self.quoting
            or (relocator.quoting == QuotingClass.PLAIN and self.quoting == QuotingClass.SPACED)
        )


def shared_inputs(tools: Pairs, table: FileTable) -> tuple[str, ...]:
    """Return the inputs shared by all packages: forge's files, the programs, the system and the umask.

    `table` is used for these files only, and saved.
    """
    own = [path for folder in own_folders() for path in source_files(str(folder), NO_CODE)]
    data = contents_of(own, table)
    own_digests = [f"{os.path.relpath(path, PACKAGE.parent)} {data[path]}" for path in own]
    programs = {name: os.path.realpath(program_of(identity)) for name, identity in tools}
    found = contents_of(programs.values(), table)
    table.forget_others({*data, *found})
    with contextlib.suppress(OSError):  # a read-only home folder
        table.save()
    forge_digest = hashlib.sha256("\n".join(own_digests).encode(errors="surrogateescape")).hexdigest()
    return (
        f"{__version__} {forge_digest}",
        *(f"{name} {found[path]}" for name, path in sorted(programs.items())),
        *_system(),
        f"umask {_umask():03o}",
    )


def input_key(
    task: Task,
    needs: Sequence[tuple[str, str]],
    shared: tuple[str, ...],
    relocator: Relocator,
    values: Mapping[str, str],
) -> str:
    """Return the key of all inputs of a task that are known before it runs, including dependencies.

    `values` are those of variables that may contain paths of the workspace; tasks have only digests of them.
    """
    inputs = task.inputs
    return _key(
        task.name,
        shared,
        [relocator.relativize_word(word) for word in inputs.options],
        [[name, relocator.relativize_word(values.get(name, value))] for name, value in inputs.environment],
        inputs.sources,
        needs,
    )


def result_key(
    first: str, inputs: ExternalFileList, contents: Mapping[str, str], relocator: Relocator
) -> str:
    """Return the key of a result from the first key and the contents of external files.

    `contents` maps `inputs.paths` to content digests.
    """
    data = digest_of(inputs.paths, contents)
    locations = (
        [[name, path.decode(errors="replace")] for name, path in relocator.paths]
        if inputs.absolute_path_reason
        else []
    )
    return _key(first, data, inputs.quoting, locations)


def encode_lists(lists: Iterable[ExternalFileList]) -> bytes:
    """Return the first _MAX_LISTS lists of inputs as JSON."""
    found = list(dict.fromkeys(lists))[:_MAX_LISTS]
    data = [[*one.paths, one.quoting, one.absolute_path_reason] for one in found]
    return json.dumps({"forge_inputs": _VERSION, "lists": data}).encode()


def decode_lists(data: bytes) -> tuple[ExternalFileList, ...]:
    """Return the lists that `encode_lists` wrote; nothing for what it did not."""
    try:
        found: Mapping[str, Any] = json.loads(data)
        if found["forge_inputs"] != _VERSION:
            return ()
        lists = found["lists"][:_MAX_LISTS]
        if not all(isinstance(word, str) for one in lists for word in one):
            return ()
        return tuple(
            ExternalFileList(tuple(words), reason, QuotingClass(quoting)) for *words, quoting, reason in lists
        )
    except (ValueError, LookupError, TypeError, RecursionError):
        return ()


def _key(*data: object) -> str:
    return hashlib.sha256(json.dumps([_VERSION, *data]).encode()).hexdigest()


def _system() -> tuple[str, ...]:
    """Return the identity of the system: results are not shared between different systems."""
    try:
        release = platform.freedesktop_os_release()
    except OSError:
        release = {}
    words = (platform.system(), platform.machine(), *platform.libc_ver())
    return (*words, release.get("ID", ""), release.get("VERSION_ID", ""))


def _umask() -> int:
    """Return the umask; /proc provides it without changing it temporarily."""
    if found := re.search(r"^Umask:\s*([0-7]+)$", text_or_nothing("/proc/self/status"), re.MULTILINE):
        return int(found[1], 8)
    mask = os.umask(0o077)
    os.umask(mask)
    return mask
