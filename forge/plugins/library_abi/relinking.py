"""Decide that linking a package again is redundant: only the code of shared libraries has changed.

The digest of the ABI of a library covers everything that linking with it depends on. A linker reads its
dynamic symbols, not its code: linking with a library of the same ABI produces an identical program. A program
that is not position-independent holds copies of the variables that it uses. Their location and size follow
from size, alignment and section of each symbol that is not a function, whatever its type says; symbols of the
same variable refer to one copy.
"""

from __future__ import annotations

import hashlib
import json
import re
import struct
from collections.abc import Iterator, Mapping
from dataclasses import replace

from forge.base.files import open_regular, read_json, replace_file
from forge.build.build_dir import dependency_changes
from forge.build.inputs.elf import (
    DYNAMIC,
    NAMES,
    SHT_DYNAMIC,
    SHT_DYNSYM,
    SYMBOL,
    Library,
    read_library,
    text_at,
)
from forge.build.inputs.fingerprints import Changes
from forge.build.inputs.native_graph import NativeGraph, read_native_graph
from forge.build.installed_lists import STATES_PER_PACKAGE, InstalledStates
from forge.build.model import BuildRecord
from forge.build.records import read_record
from forge.build.reuse import is_affected
from forge.build.tasks import Task
from forge.build.up_to_date import changed_input
from forge.engine.accesses import ObservedCommands
from forge.workspace.model import CMAKE_TYPES

_SHARED_LIBRARY = re.compile(r"/lib[^/]+\.so(\.[\d.]+)?$")
"""Paths of shared libraries, by the names that linkers look for."""
_INTERFACES = "interfaces"
"""The interface of each shared library in the states of a package, by the digest of its content."""
_LIBRARIES = 64

_FUNCTIONS = frozenset({2, 10})
"""STT_FUNC and STT_GNU_IFUNC."""
_SHN_UNDEF, _SHN_LORESERVE = 0, 0xFF00
_FLAGS = frozenset({16, 22, 30, 0x6FFFFFFB})
"""DT_SYMBOLIC, DT_TEXTREL, DT_FLAGS and DT_FLAGS_1."""
_WHOLE = (
    *(".gnu.version", ".gnu.version_d", ".gnu.version_r", ".note.gnu.property"),
    *(".gnu.attributes", ".ARM.attributes", ".riscv.attributes"),
)
_WARNING = ".gnu.warning"


def keep_interfaces(name: str, contents: Mapping[str, str], states: InstalledStates) -> None:
    """Record the interfaces of the shared libraries among a package's installed files."""
    libraries = {content: path for path, content in contents.items() if _SHARED_LIBRARY.search(path)}
    if libraries:
        file = states.folder(name) / _INTERFACES
        interfaces = read_json(file)
        now = {content: interfaces.get(content) or abi_digest(path) for content, path in libraries.items()}
        older = {content: interface for content, interface in interfaces.items() if content not in now}
        kept = max(_LIBRARIES, STATES_PER_PACKAGE * len(now))
        updated = dict([*older.items()][-kept:]) | now
        if updated != interfaces:
            replace_file(file, json.dumps(updated).encode())


def relinking_is_redundant(
    task: Task, record: BuildRecord, needs: Mapping[str, str], states: InstalledStates
) -> bool:
    """Return True if building a task would only link it with shared libraries whose interfaces are unchanged.

    All installed files of the package would stay the same, byte for byte. `record` describes its last,
    successful build. `needs` has a digest of each dependency's installed files.
    """
    only_needs_changed = changed_input(replace(task.inputs, needs=record.inputs.needs), record.inputs) is None
    if task.package.build_type not in CMAKE_TYPES or not only_needs_changed:
        return False
    last = read_record(task.build_dir)
    if last is None or not last.complete or last.saved or last.needs.keys() != needs.keys():
        return False
    changed = [(name, last.needs[name], needs[name]) for name in needs if last.needs[name] != needs[name]]
    if not changed or not all(_only_library_code_changed(*each, states) for each in changed):
        return False
    needed = dependency_changes(last.needs, needs, states)
    return needed is not None and _would_only_link(read_native_graph(task.build_dir), needed, last.commands)


def _only_library_code_changed(name: str, then: str, now: str, states: InstalledStates) -> bool:
    """Return whether two states of a package differ only in the code of shared libraries.

    Linking with either gives the same program: the libraries have equal interfaces.
    """
    changes = states.changes(name, then, now)
    if not changes or changes.names:
        return False
    one, other = (states.contents(name, digest) or {} for digest in (then, now))
    interfaces = read_json(states.folder(name) / _INTERFACES)
    return all(
        _SHARED_LIBRARY.search(path)
        and (interface := interfaces.get(one[path]))
        and interface == interfaces.get(other[path])
        for path in changes.modified
    )


def _would_only_link(graph: NativeGraph, needed: Changes, seen: ObservedCommands) -> bool:
    """Return True if a change of shared libraries only requires linking again.

    `needed` are the changes of installed files. False if anything else read them, or if some process was not
    observed.
    """
    if graph.tool != "ninja" or needed.names or seen.configure is None or seen.rest is None:
        return False
    edges = [edge for edge in graph.edges if edge.outputs[0] in seen.edges]
    others = (
        seen.configure,
        seen.rest,
        *(seen.edges[edge.outputs[0]] for edge in edges if not edge.links_dynamically),
    )
    return not any(each.blind or is_affected(each, seen, needed) for each in others)


def abi_digest(path: str) -> str:
    """Return a digest of a shared library's interface; '' if a file has no interface or an unknown one."""
    try:
        with open(path, "rb", opener=open_regular) as stream:
            content = stream.read()
        library = read_library(content)
        if library is None:
            return ""
        digest = hashlib.blake2b(digest_size=16)
        for line in _lines(library):
            digest.update(repr(line).encode() + b"\n")
    except (OSError, ValueError, LookupError, struct.error):
        return ""
    return digest.hexdigest()


def _lines(library: Library) -> Iterator[object]:
    """Yield the facts that linkers use; raises LookupError for a library without dynamic symbols."""
    yield library.machine
    sections = library.sections
    for section in sections:
        if section.name in _WHOLE or section.name.startswith(_WARNING):
            yield section.name, section.body
    dynamic = next((section for section in sections if section.type == SHT_DYNAMIC), None)
    if dynamic is None:
        raise LookupError("there is no dynamic section")
    for tag, value in DYNAMIC.iter_unpack(dynamic.body):
        if tag in NAMES:
            yield tag, text_at(sections[dynamic.link].body, value)
        elif tag in _FLAGS:
            yield tag, value
    yield from _symbols(library)


def _symbols(library: Library) -> Iterator[object]:
    symbols = next((section for section in library.sections if section.type == SHT_DYNSYM), None)
    if symbols is None:
        raise LookupError("there are no dynamic symbols")
    texts = library.sections[symbols.link].body
    first: dict[tuple[int, int], int] = {}
    """The first symbol at each address."""
    for number, (name, info, other, home, value, size) in enumerate(SYMBOL.iter_unpack(symbols.body)):
        if home == _SHN_UNDEF:
            place: object = "undefined"
        elif home >= _SHN_LORESERVE:
            place = home, value, size
        elif info & 15 in _FUNCTIONS:
            place = "function"
        else:
            place = _variable(library, home, value, size)
            if size:
                place = place, first.setdefault((home, value), number)
        yield text_at(texts, name), info, other, place


def _variable(library: Library, home: int, value: int, size: int) -> tuple[object, ...]:
    """Return the properties of a variable's address that linkers use; without a size, nothing is copied."""
    section = library.sections[home]
    read_only = any(start <= value < end for start, end in library.relro)
    alignment = (section.alignment, value % max(section.alignment, 1)) if size else ()
    return size, section.name, section.flags, read_only, alignment
