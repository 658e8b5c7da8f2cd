"""Create Python classes from definitions at run time, in memory and without writing files.

Each set of definitions gets its own in-memory package, named after a hash of its contents. Two versions
of a type, such as that of an old recording and that of an installed package, therefore do not conflict.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib import import_module
from importlib.abc import InspectLoader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import CodeType
from typing import Any

from forge.base.distributions import EMBEDDED, check_distribution, distribution_in
from forge.base.errors import InterfaceError, Problem
from forge.interfaces.model import Catalog, TypeName
from forge.interfaces.python.target import files
from forge.interfaces.python.types import module_name
from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library, read_folder
from forge.interfaces.resolve.resolution import dependency_catalogs, resolve
from forge.interfaces.schema import parse_name, read_schema

_RUNTIME = EMBEDDED / "rosidl_default_runtime" / "python"


class Types(Mapping[str, Any]):
    """Classes by full name, such as 'std_msgs/msg/Header'; each is created on first access."""

    def __init__(self, root: str, names: Iterable[TypeName]) -> None:
        self._modules = {str(name): (f"{root}.{module_name(name)}", name.name) for name in names}

    def __getitem__(self, name: str) -> Any:
        module, attribute = self._modules[name]
        return getattr(import_module(module), attribute)

    def __iter__(self) -> Iterator[str]:
        """Yield all names: those of the definitions, then those that they refer to."""
        return iter(self._modules)

    def __len__(self) -> int:
        return len(self._modules)

    def __repr__(self) -> str:
        return f"<types {', '.join(self)}>"


def load(
    definitions: Path | str,
    name: str | None = None,
    *,
    includes: Mapping[str, Path] | None = None,
    rosdistro: str | None = None,
) -> Types:
    """Create classes from a folder of definitions or from the text of a schema.

    A Path is a folder that contains msg, srv, action or .idl files, and `name` is the package, by default the
    name of the folder. A str is the text of a schema as stored by MCAP ('ros2msg' or 'ros2idl'), and `name`
    is its type. Definitions of other packages are searched in the folders of `includes`, then in the embedded
    packages of `rosdistro`, by default the variable ROS_DISTRO, else Humble. Raises InterfaceError with all
    errors in the definitions, SelectionError for an unknown distribution.
    """
    check_distribution(rosdistro, "rosdistro")
    chosen = rosdistro or distribution_in(os.environ)
    library = Library(includes=dict(includes or {}), rosdistro=chosen)
    if isinstance(definitions, Path):
        package = name or definitions.absolute().name
        parsed = parse_all(read_folder(package, definitions, chosen))
    elif name is None:
        hint = "pass the name of the type; to load a folder, pass a pathlib.Path"
        raise InterfaceError(Problem("missing type name of the schema", hint=hint))
    else:
        type_name = parse_name(name)
        package = type_name.package
        parsed = parse_all(read_schema(definitions, type_name))
        library.given = {each.interface.name: each for each in parsed}
        parsed = tuple(each for each in parsed if each.interface.name.package == package)
    catalog = resolve(package, parsed, library, events=library.has_events)
    return _import((catalog, *dependency_catalogs(catalog, library)))


def _import(catalogs: Sequence[Catalog]) -> Types:
    """Register the rendered modules of some catalogs with the import system."""
    texts = {
        file.path: file.text
        for catalog in catalogs
        for file in files(catalog, root="...")
        if file.path.endswith(".py")
    }
    digest = hashlib.sha256("\0".join(f"{path}\0{texts[path]}" for path in sorted(texts)).encode())
    root = f"forge_types_{digest.hexdigest()[:12]}"
    if f"{root}/__init__.py" not in _MEMORY.texts:
        _MEMORY.texts[f"{root}/__init__.py"] = ""
        _MEMORY.texts.update((f"{root}/{path}", text) for path, text in texts.items())
    if _MEMORY not in sys.meta_path:
        sys.meta_path.append(_MEMORY)
    return Types(root, (name for catalog in catalogs for name in catalog.interfaces))


class _Memory(MetaPathFinder, InspectLoader):
    """Finds and loads modules whose source is in memory, and finds the run time that they import."""

    def __init__(self) -> None:
        self.texts: dict[str, str] = {}
        """The source of modules, by the path that their file would have."""

    def find_spec(self, fullname: str, path: object, target: object = None) -> ModuleSpec | None:
        """Return the spec of an in-memory module or of a module of the run time, or None."""
        del path, target
        if self._path(fullname) in self.texts:
            return ModuleSpec(fullname, self, origin="in memory", is_package=self.is_package(fullname))
        # The run time, unless a sourced workspace or ROS provides it: other finders are asked first.
        return PathFinder.find_spec(fullname, [str(_RUNTIME)]) if "." not in fullname else None

    def get_source(self, fullname: str) -> str:
        return self.texts[self._path(fullname)]

    def get_code(self, fullname: str) -> CodeType:
        """Return the code of a module, with a file name that identifies it in tracebacks."""
        return self.source_to_code(self.get_source(fullname), f"<{fullname}>")

    def is_package(self, fullname: str) -> bool:
        return self._path(fullname).endswith("/__init__.py")

    def _path(self, fullname: str) -> str:
        folder = fullname.replace(".", "/")
        package = f"{folder}/__init__.py"
        return package if package in self.texts else f"{folder}.py"


_MEMORY = _Memory()
