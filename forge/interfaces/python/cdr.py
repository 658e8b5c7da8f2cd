"""Generate Python serializers: a module beside each message module, imported on first use.

For each message, a module has a factory of its writer and one of its reader; a factory first creates the
tables that the function looks up. Messages too large to be inlined have two more, for use inside other
messages. All code is little-endian. Data that it rejects is passed to the run time's generic codec, which
handles every case and reports errors.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.base.names import snake_case
from forge.base.templating import render
from forge.interfaces.model import File, messages_of
from forge.interfaces.python.cdr_read import References, emit_part_reader, emit_reader
from forge.interfaces.python.cdr_text import FunctionSource, Names
from forge.interfaces.python.cdr_write import emit_part_writer, emit_writer
from forge.interfaces.python.modules import module_name
from forge.interfaces.wire.flattening import LayoutBuilder
from forge.interfaces.wire.layout import START, UNKNOWN, MessageCall, MessageLayout

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from forge.interfaces.model import Catalog, Interface, TypeName


_IMPORTS = (
    ("_array(", "from array import array as _array"),
    ("_repeat(", "from itertools import repeat as _repeat"),
    ("_lazy.", "from forge_cdr import lazy as _lazy"),
    ("_pieces.", "from forge_cdr import pieces as _pieces"),
    ("_ndarray(", "import numpy as _numpy"),
)
"""What a generated module imports if its text contains a use of it."""

_CONSTANTS = ("HEADER", "HEADER_BYTES", "LITTLE_ENDIAN")


@frozen
class _Function:
    """The factory of a reader or a writer, for the template."""

    name: str
    inner: str
    """The name and parameters of the function that it creates."""
    tables: tuple[str, ...]
    lines: tuple[str, ...]

    @property
    def made(self) -> str:
        return self.inner.partition("(")[0]


@dataclass(slots=True)
class _Module:
    """Collects the classes and modules that a generated module refers to."""

    layouts: LayoutBuilder
    own: frozenset[TypeName]
    all_classes: frozenset[str]
    """The names of all classes of the catalog, one set for all modules."""
    classes: dict[TypeName, str] = field(default_factory=dict)
    modules: dict[str, str] = field(default_factory=dict)

    def class_of(self, name: TypeName) -> str:
        if name not in self.classes:
            taken = name.name in self.classes.values()
            self.classes[name] = f"_{name.package}_{name.kind}_{name.name}" if taken else name.name
        return self.classes[name]

    def factory_call(self, prefix: str, name: TypeName) -> str:
        if name in self.own:
            return f"{prefix}_{name.name}()"
        path = f"{module_name(name)}__cdr"
        alias = self.modules.setdefault(path, f"_{path.replace('.', '_')}")
        return f"{alias}.{prefix}_{name.name}()"


def interface_files(catalog: Catalog, root: str = "") -> Callable[[Interface], Iterator[File]]:
    """Return a function that yields the serializer module of one interface; for `root`, see modules.py."""
    layouts = LayoutBuilder(catalog.known)
    all_classes = frozenset(name.name for name in catalog.known)

    def module(interface: Interface) -> Iterator[File]:
        path = f"{module_name(interface.name).replace('.', '/')}__cdr.py"
        yield File(path, _serializers(interface, layouts, all_classes, root))

    return module


def _serializers(interface: Interface, layouts: LayoutBuilder, all_classes: frozenset[str], root: str) -> str:
    own = [message.name for message in messages_of(interface)]
    module = _Module(layouts, frozenset(own), all_classes)
    for name in own:
        module.class_of(name)
    functions = [function for name in own for function in _functions(name, module)]
    text = "\n".join(line for function in functions for line in (*function.tables, *function.lines))
    home = module_name(interface.name)
    classes = [
        (home if name in module.own else module_name(name), name.name, local)
        for name, local in sorted(module.classes.items())
    ]
    others = [(*path.rsplit(".", 1), local) for path, local in sorted(module.modules.items())]
    return render(
        "python/cdr.py.j2",
        title=str(interface.name),
        shared=[line for use, line in _IMPORTS if use in text],
        imported=[(f"{root}{path}", name, local) for path, name, local in (*classes, *others)],
        # Functions look up names faster as module globals than as attributes.
        constants=[
            *(["_ndarray = _numpy.ndarray"] if "_ndarray(" in text else []),
            *(f"_{name} = _pieces.{name}" for name in _CONSTANTS if re.search(rf"_{name}\b", text)),
        ],
        functions=functions,
    )


def _functions(name: TypeName, module: _Module) -> Iterator[_Function]:
    large = module.layouts.is_large(name)
    if large:
        layout = module.layouts.of(name, UNKNOWN)
        yield _writing(f"part_writer_{name.name}", "write(message, append, o)", layout, module)
        yield _reading(f"part_reader_{name.name}", "read(buffer, view, o, limit)", name, layout, module)
        inlined = MessageLayout((MessageCall((), name, START),), (), START, UNKNOWN)
    else:
        inlined = module.layouts.of(name)
    yield _writing(f"writer_{name.name}", "write(message)", inlined, module)
    yield _reading(f"reader_{name.name}", "read(buffer, limit)", name, inlined, module)


def _writing(name: str, inner: str, layout: MessageLayout, module: _Module) -> _Function:
    lines = FunctionSource(_names(module))

    def shared(other: TypeName) -> str:
        return lines.table(f"write_{snake_case(other.name)}", module.factory_call("part_writer", other))

    (emit_part_writer if layout.start == UNKNOWN else emit_writer)(lines, layout, shared)
    return _Function(name, inner, tuple(lines.tables), tuple(lines.lines))


def _reading(name: str, inner: str, message: TypeName, layout: MessageLayout, module: _Module) -> _Function:
    lines = FunctionSource(_names(module))

    def shared(other: TypeName) -> str:
        return lines.table(f"read_{snake_case(other.name)}", module.factory_call("part_reader", other))

    others = References(module.class_of, shared)
    (emit_part_reader if layout.start == UNKNOWN else emit_reader)(lines, message, layout, others)
    return _Function(name, inner, tuple(lines.tables), tuple(lines.lines))


def _names(module: _Module) -> Names:
    """Return the local names of a function; all class names of the catalog are reserved."""
    return Names({"message", "read", "write"}, module.all_classes)
