"""Keys of the package cache: path-independent digests of the inputs of a package.

The files that a build reads outside the workspace are known only after it ran. Therefore a package has two
keys. The first covers all inputs known before the build; its entry contains lists of external files recorded
by earlier builds. The second covers the first key and the current contents of the files in one list; its
entry is a result and its origin. A further key covers the path of the workspace, too: its entry is a result
for that path only. Only build scripts, options and the files that they make can make a result depend on its
path: if these are the same as for a result that was shown to be independent of it, a result of other source
code is independent, too.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge import __version__
from forge.base.frozen import Pairs, frozen
from forge.base.layout import NO_CODE, PACKAGE, own_folders
from forge.build.inputs.fingerprints import FileTable, contents_of, digest_of, source_files
from forge.build.inputs.native_graph import read_native_graph
from forge.build.records import read_record
from forge.engine.accesses import NOT_OBSERVED
from forge.toolchain.programs import program_of
from forge.toolchain.python_modules import os_release

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from forge.build.tasks import Task
    from forge.plugins.package_cache.relocation import Relocator
    from forge.plugins.package_cache.trees import Tree

_VERSION = 3
_MAX_LISTS = 4
"""The number of file lists stored for one key."""


@frozen
class Origin:
    """The workspace in which a result was built, and what builds elsewhere have shown.

    `shown` is True if a build at a sufficiently different path had the same result; `different` is a file
    that differed. `scripts` is the key for results of other source code that the same build scripts make, if
    any.
    """

    root: str
    shown: bool = False
    different: str = ""
    scripts: str = ""

    def is_unlike(self, root: str) -> bool:
        """Return True if path-dependent output would differ in `root`: length, depth and name differ."""
        here, there = Path(self.root), Path(root)
        return len(self.root) != len(root) and len(here.parts) != len(there.parts) and here.name != there.name


def shared_inputs(tools: Pairs, table: FileTable) -> tuple[str, ...]:
    """Return the inputs shared by all packages: forge's files, the programs and the system."""
    own = [path for folder in own_folders() for path in source_files(str(folder), NO_CODE)]
    data = contents_of(own, table)
    own_digests = [f"{os.path.relpath(path, PACKAGE.parent)} {data[path]}" for path in own]
    programs = {name: os.path.realpath(program_of(identity)) for name, identity in tools}
    program_digests, release = contents_of(programs.values(), table), os_release()
    forge_digest = hashlib.sha256("\n".join(own_digests).encode(errors="surrogateescape")).hexdigest()
    return (
        f"{__version__} {forge_digest}",
        *(f"{name} {program_digests[path]}" for name, path in sorted(programs.items())),
        # Results are not shared between different systems.
        *(platform.system(), platform.machine(), *platform.libc_ver()),
        *(release.get("ID", ""), release.get("VERSION_ID", "")),
    )


def settings_key(task: Task, shared: tuple[str, ...], relocator: Relocator, values: Mapping[str, str]) -> str:
    """Return the key of the inputs of a task that are known before it runs, without sources and dependencies.

    `values` are the values of variables that may contain paths of the workspace; tasks contain only their
    digests.
    """
    inputs = task.inputs
    return _key(
        task.name,
        shared,
        [relocator.relativize_word(word) for word in inputs.options],
        [[name, relocator.relativize_word(values.get(name, value))] for name, value in inputs.environment],
        inputs.underlays,
        relocator.arrangement,
    )


def input_key(settings: str, task: Task, needs: Sequence[tuple[str, str]]) -> str:
    """Return the key of all inputs of a task that are known before it runs, including dependencies."""
    return _key(settings, task.inputs.sources, needs)


def scripts_key(settings: str, words: Sequence[str], contents: Mapping[str, str], scripts: str) -> str:
    """Return the key of the origin record of build scripts with this digest; '' if it is empty."""
    return _key(settings, digest_of(words, contents), "scripts", scripts) if scripts else ""


def result_key(first: str, words: Sequence[str], contents: Mapping[str, str], root: str = "") -> str:
    """Return the key of a result from the first key and the contents of external files.

    `contents` maps `words` to content digests. With `root`, it is the key for this path only.
    """
    return _key(first, digest_of(words, contents), root)


def encode_lists(lists: Iterable[tuple[str, ...]]) -> bytes:
    """Return the first _MAX_LISTS lists of inputs as JSON."""
    return json.dumps({"forge_inputs": _VERSION, "lists": [*dict.fromkeys(lists)][:_MAX_LISTS]}).encode()


def decode_lists(data: bytes) -> tuple[tuple[str, ...], ...]:
    """Decode the result of `encode_lists`; return nothing for other data."""
    try:
        document: Mapping[str, Any] = json.loads(data)
        lists = document["lists"][:_MAX_LISTS] if document["forge_inputs"] == _VERSION else ()
        return tuple(map(tuple, lists)) if all(isinstance(word, str) for one in lists for word in one) else ()
    except (ValueError, LookupError, TypeError, RecursionError):
        return ()


def encode_origin(origin: Origin) -> bytes:
    """Return the origin of a result as JSON."""
    return json.dumps(asdict(origin)).encode()


def decode_origin(data: bytes) -> Origin:
    """Decode the result of `encode_origin`; raises ValueError for other data."""
    try:
        origin = Origin(**json.loads(data))
    except (TypeError, RecursionError) as error:
        raise ValueError("invalid origin of a result") from error
    texts = {type(text) for text in (origin.root, origin.different, origin.scripts)}
    if type(origin.shown) is not bool or texts != {str}:
        raise ValueError("invalid origin of a result")
    return origin


def _key(*data: object) -> str:
    return hashlib.sha256(json.dumps([_VERSION, *data]).encode()).hexdigest()


class ExternalInputs:
    """Files outside the workspace that builds have read, such as system headers, by relocatable path.

    Many packages read the same files. While a build only restores packages, each file is checked once; from
    the first step that runs, it is checked each time, since a step may write anywhere.
    """

    def __init__(self, relocator: Relocator, table: FileTable) -> None:
        self._relocator = relocator
        self._table = table
        self._known: dict[str, tuple[str, str]] = {}
        self._caching = True

    def stop_caching(self) -> None:
        """Check every file each time from now on, since a step is about to run."""
        self._caching = False
        self._known = {}

    def look(self, words: Iterable[str]) -> dict[str, tuple[str, str]]:
        """Return path and content of files by relocatable path, for keys as well as records."""
        cache = self._known if self._caching else {}
        entries = {}
        for word in words:
            if word not in cache:
                path = self._relocator.absolutize_input(word)
                cache[word] = path, contents_of((path,), self._table)[path]
            entries[word] = cache[word]
        return entries

    def contents(self, words: Iterable[str]) -> dict[str, str]:
        return {word: content for word, (_, content) in self.look(words).items()}


_OPTIONS = re.compile(r"^  (?:DEFINES|FLAGS) = (.*)$", re.MULTILINE)
_MAP = re.compile(r"-f\w+-prefix-map=\S+")


def scripts_digest(build: Path, source: Path, tree: Tree, relocator: Relocator) -> str:
    """Return a digest of all inputs of a build, except compiled sources and copied files.

    It is '' if that is unknown, or if compilers could see a path of the workspace: in a definition, or in a
    file. Then other code may depend on that path, if only on its length. The same holds for a source that
    contains the path: in an installed copy, no placeholder may replace it.
    """
    graph, record = read_native_graph(build), read_record(build)
    seen = record.commands if record else NOT_OBSERVED
    if graph.tool != "ninja" or graph.has_dyndeps or seen.configure is None or seen.rest is None:
        return ""
    edges = [(edge, seen.edges[edge.outputs[0]]) for edge in graph.edges if edge.outputs[0] in seen.edges]
    options = (_MAP.sub("", option) for edge in graph.edges for option in _OPTIONS.findall(edge.text))
    if any(each.blind for each in seen.all) or any(relocator.occur_in(os.fsencode(each)) for each in options):
        return ""
    compiling = [(each.read, frozenset(graph.inputs_of(edge))) for edge, each in edges if edge.compiles]
    others = (each.read for edge, each in edges if not edge.compiles and not edge.links_dynamically)
    scripts = seen.configure.read.union(*others, *(read - code for read, code in compiling))
    outputs = seen.rest.written.union(*(each.written for _, each in edges))
    generated = seen.configure.written | outputs
    compiled = frozenset[str]().union(*(read | code for read, code in compiling))
    copied = {leaf.hash for leaf in tree.leaves}
    lines = []
    for path in sorted(scripts | seen.rest.read | compiled):
        is_generated = path in compiled and path in generated
        is_script = (path in scripts or path in seen.rest.read) and path not in outputs
        word = relocator.relativize_word(path)
        is_seen = is_generated or (path in compiled and word != path)
        is_source = path.startswith(f"{source}/") and path not in generated
        if not (is_script or is_seen) or not os.path.isfile(path):  # noqa: PTH113
            continue
        content = Path(path).read_bytes()
        if (is_seen or is_source) and relocator.occur_in(content):
            return ""
        digest = hashlib.sha256(relocator.relativize(content)).hexdigest()
        if is_generated or (is_script and (path in scripts or digest not in copied)):
            lines.append(f"{word} {digest}")
    return hashlib.sha256("\n".join(lines).encode(errors="surrogateescape")).hexdigest()
