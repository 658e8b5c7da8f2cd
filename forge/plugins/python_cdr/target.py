"""Serializers of the messages of an interface: a Python module that is imported on first use."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Final

from forge.base.templating import render
from forge.interfaces.model import Catalog, File, Interface, TypeName, messages_of
from forge.interfaces.python.types import imports, module_name, names_in
from forge.interfaces.wire.layout import START, UNKNOWN, LayoutBuilder, MessageCall, MessageLayout
from forge.plugins.python_cdr.reading import emit_part_reader, emit_reader
from forge.plugins.python_cdr.source import FunctionSource, Module
from forge.plugins.python_cdr.writing import emit_part_writer, emit_writer

_CDR_IMPORTS: Final = (
    "from array import array as _array",
    "from itertools import repeat as _repeat",
    "from forge_cdr import lazy as _lazy",
    "from forge_cdr import pieces as _pieces",
    "import numpy as _numpy",
)
_CDR_CONSTANTS: Final = ("HEADER", "HEADER_BYTES", "LITTLE_ENDIAN")


def interface_files(catalog: Catalog, root: str) -> Callable[[Interface], Iterator[File]]:
    """Return a function that yields the serializers of one interface; `root` precedes the names of packages.

    For each message, a module has a factory of its writer and one of its reader; a factory first creates the
    tables that the function looks up. Messages too large to be inlined have two more, for use inside other
    messages. All code is little-endian. Data that it rejects is passed to the run time's generic codec, which
    handles every case and reports errors.
    """
    layouts = LayoutBuilder(catalog.known)
    all_classes = frozenset(name.name for name in catalog.known)

    def files_of(interface: Interface) -> Iterator[File]:
        home = module_name(interface.name)
        own = [message.name for message in messages_of(interface)]
        module = Module(frozenset(own), all_classes)
        for name in own:
            module.class_of(name)
        functions = [function for name in own for function in _factories(name, module, layouts)]
        used = names_in(line for function in functions for line in (*function.tables, *function.lines))
        classes = [
            (home if name in module.own else module_name(name), name.name, local)
            for name, local in sorted(module.classes.items())
        ]
        others = [(*path.rsplit(".", 1), local) for path, local in sorted(module.modules.items())]
        source = render(
            "python_cdr/templates/cdr.py.j2",
            title=str(interface.name),
            shared=imports(_CDR_IMPORTS, used),
            imported=[(f"{root}{path}", name, local) for path, name, local in (*classes, *others)],
            # Functions look up names faster as module globals than as attributes.
            constants=[
                *(["_ndarray = _numpy.ndarray"] if "_ndarray" in used else []),
                *(f"_{name} = _pieces.{name}" for name in _CDR_CONSTANTS if f"_{name}" in used),
            ],
            functions=functions,
        )
        yield File(f"{home.replace('.', '/')}__cdr.py", source)

    return files_of


def _factories(name: TypeName, module: Module, layouts: LayoutBuilder) -> Iterator[SimpleNamespace]:
    """Yield the factories of the writers and readers of a message."""

    def factory(kind: str, inner: str, emit: Callable[[FunctionSource], None]) -> SimpleNamespace:
        source = FunctionSource(module)
        emit(source)
        inner_name = inner.partition("(")[0]
        return SimpleNamespace(
            name=f"{kind}_{name.name}", inner=inner, made=inner_name, tables=source.tables, lines=source.lines
        )

    if layouts.is_large(name):
        part = layouts.of(name, UNKNOWN)
        yield factory("part_writer", "write(message, append, o)", lambda to: emit_part_writer(to, part))
        yield factory(
            "part_reader", "read(buffer, view, o, limit)", lambda to: emit_part_reader(to, name, part)
        )
        layout = MessageLayout((MessageCall((), name, START),), (), START, UNKNOWN)
    else:
        layout = layouts.of(name)
    yield factory("writer", "write(message)", lambda to: emit_writer(to, layout))
    yield factory("reader", "read(buffer, limit)", lambda to: emit_reader(to, name, layout))
