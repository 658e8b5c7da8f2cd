"""Run a distribution's generators and scripts in a warm process, which imports and parses only once.

Runs in the workspace's interpreter. The modules and data that all generators share are loaded before the
fork: EmPy, rosidl_parser and the parsed .idl files of the package. Each generator runs in its own fork,
isolated from the others.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import importlib.machinery
import json
import os
import runpy
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import ModuleType

    from lark import Lark

_ARGUMENTS_OPTION = "--generator-arguments-file"
"""The arguments of every rosidl generator, followed by a JSON file."""
_SETUP = ["setup.py", "egg_info"]
"""The program with which ament_cmake_python describes a package."""
SCRIPTS = {"package_xml_2_cmake.py": "catkin_pkg.package", "templates_2_cmake.py": "ament_package.templates"}
"""Scripts of ament_cmake_core that CMake runs to configure a package, and the modules that they import."""

_LIBRARIES = ("em", "lark", "rosidl_parser.definition", "rosidl_parser.parser")
_HELPERS = ("rosidl_pycommon", "rosidl_cmake")
"""Imports of generators; the second module is the older one, deprecated where both exist."""

_GRAMMAR = Path(__file__).with_name("rosidl.lark")
_PROBES = Path(__file__).with_name("probes")
"""Files with every construct that the fast parser supports."""


class DeclinedError(Exception):
    """The command has to run in a separate process, for the reason in the message."""


def fast_parser() -> Lark:
    """Return a parser with the same trees as rosidl_parser, but linear run time."""
    from lark import Lark

    grammar = _GRAMMAR.read_text(encoding="utf-8")
    return Lark(grammar, start="specification", parser="lalr", maybe_placeholders=False)


class Generators:
    """State shared by the generators of all packages, and the parsed .idl files of one package."""

    def __init__(self, cache: Path | None) -> None:
        """Store the folder for data that can be kept across builds."""
        self._cache = cache
        self._path = list(sys.path)
        self._modules: dict[str, ModuleType] = {}
        self._accelerated = False
        self._called: set[str] = set()
        self._arguments_file = ""
        self._contents: dict[str, tuple[tuple[int, int], Any]] = {}

    def prepare(self, argv: list[str], environment: dict[str, str]) -> bool:
        """Before the fork: import shared modules, and parse the .idl files of a generator's arguments.

        Return False for other programs, which would not be faster. Errors are left to the fork, where they
        occur again.
        """
        if not (_ARGUMENTS_OPTION in argv[:-1] or _library_of_script(argv)):
            return False
        with contextlib.suppress(Exception), self._search_path(environment):
            if library := _library_of_script(argv):
                # The fork of the first package imports it: with a single package, this process saves 10 MB.
                if library in self._called:
                    self._import(library)
                self._called.add(library)
                return True
            if not self._accelerated:
                self._import(*_LIBRARIES)
                self._accelerate()
                self._import(_HELPERS[0])
                if _HELPERS[0] not in self._modules:
                    self._import(_HELPERS[1])
            arguments_file = argv[argv.index(_ARGUMENTS_OPTION) + 1]
            if Path(arguments_file).parent != Path(self._arguments_file).parent:
                self._contents.clear()
            self._arguments_file = arguments_file
            parser: Any = self._modules["rosidl_parser.parser"]
            locator: Any = self._modules["rosidl_parser.definition"]
            for pair in json.loads(Path(arguments_file).read_bytes()).get("idl_tuples", ()):
                idl_locator = locator.IdlLocator(*pair.rsplit(":", 1))
                path = str(idl_locator.get_absolute_path())
                signature = _signature(path)
                if path not in self._contents or self._contents[path][0] != signature:
                    self._contents.pop(path, None)
                    self._contents[path] = signature, parser.parse_idl_file(idl_locator)
        return True

    def run(self, argv: list[str], environment: dict[str, str]) -> None:
        """In the fork: run `python PROGRAM ...`; raises DeclinedError unless it succeeds."""
        program = argv[1]
        sys.path[:] = [str(Path(program).resolve().parent), *self._entries(environment), *self._path]
        library = _library_of_script(argv)
        modules = {name: module for name, module in self._modules.items() if library in {None, name}}
        for name, module in modules.items():
            top, _, _ = name.partition(".")
            spec = importlib.machinery.PathFinder.find_spec(top)
            if spec is None or spec.origin != sys.modules[top].__spec__.origin:  # type: ignore[union-attr]
                raise DeclinedError(f"it imports a different {top} than {module.__file__}")
        sys.argv[:] = argv[1:]
        try:
            runpy.run_path(program, run_name="__main__")
        except SystemExit as leaving:
            if leaving.code:
                raise DeclinedError(f"it ended with {leaving.code}") from None
        except Exception as error:
            raise DeclinedError(f"{type(error).__name__}: {error}") from error

    def _accelerate(self) -> None:
        """Make EmPy and rosidl_parser faster, once in this process."""
        from lark.exceptions import LarkError

        from forge.plugins.fast_rosidl.empy import CompiledTemplates, install

        self._accelerated = True
        em, parser = self._modules["em"], cast("Any", self._modules["rosidl_parser.parser"])
        install(em, CompiledTemplates(em, self._cache))
        fast = fast_parser()
        if self._is_same_parser(fast, parser):
            slow = parser.get_ast_from_idl_string

            def get_ast_from_idl_string(text: str) -> Any:
                """Return the tree of a file; fall back to the slow parser for unsupported constructs."""
                try:
                    return fast.parse(text)
                except LarkError:
                    return slow(text)

            parser.get_ast_from_idl_string = get_ast_from_idl_string
        parse = parser.parse_idl_file

        def parse_idl_file(locator: Any, png_file: str | None = None) -> Any:
            # Return a new object for each call, as rosidl_parser does: the caller may change it.
            path = str(locator.get_absolute_path())
            signature, content = self._contents.pop(path, (None, None))
            if png_file is None and signature is not None and signature == _signature(path):
                return content
            return parse(locator, png_file)

        parser.parse_idl_file = parse_idl_file

    def _import(self, *names: str) -> None:
        for name in names:
            with contextlib.suppress(ImportError):
                self._modules[name] = importlib.import_module(name)

    @contextlib.contextmanager
    def _search_path(self, environment: dict[str, str]) -> Iterator[None]:
        before = list(sys.path)
        sys.path[:0] = self._entries(environment)
        try:
            yield
        finally:
            sys.path[:] = before

    @staticmethod
    def _entries(environment: dict[str, str]) -> list[str]:
        return [entry for entry in environment.get("PYTHONPATH", "").split(os.pathsep) if entry]

    def _is_same_parser(self, fast: Lark, parser: Any) -> bool:
        """Return whether the fast parser gives the results of this rosidl_parser, for all probes."""
        names = ("parse_idl_string", "get_ast_from_idl_string", "extract_content_from_ast", "grammar_file")
        if not all(hasattr(parser, name) for name in names):
            return False
        probes = sorted(_PROBES.glob("*.idl"))
        definition, lark = self._modules["rosidl_parser.definition"], self._modules["lark"]
        digest = hashlib.sha256(f"{lark.__version__} {sys.version}".encode())
        sources = (parser.__file__, definition.__file__, parser.grammar_file, __file__, _GRAMMAR, *probes)
        for source in sources:
            digest.update(Path(source or "").read_bytes())
        cache_file = self._cache / f"{digest.hexdigest()}.parser" if self._cache else None
        if cache_file:
            with contextlib.suppress(OSError):
                return cache_file.read_text(encoding="utf-8") == "same"
        same = all(_agrees(fast, parser, probe.read_text(encoding="utf-8")) for probe in probes)
        if cache_file:
            with contextlib.suppress(OSError):
                cache_file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
                cache_file.write_text("same" if same else "different", encoding="utf-8")
        return same


def _library_of_script(argv: list[str]) -> str | None:
    """Return the module in which a script spends its time, None for generators."""
    if argv[1:] == _SETUP:
        return "setuptools"
    return SCRIPTS.get(Path("".join(argv[1:2])).name)


def _agrees(fast: Lark, parser: Any, text: str) -> bool:
    try:
        content = parser.extract_content_from_ast(fast.parse(text))
        return described(content) == described(parser.parse_idl_string(text))
    except Exception:
        return False


def described(thing: object) -> object:
    """Return an object of rosidl_parser.definition as plain data: the types and values of all its parts."""
    if type(thing).__module__ == "rosidl_parser.definition":
        slots = [name for type_ in type(thing).__mro__ for name in _slots(type_)]
        return type(thing).__name__, {name: described(getattr(thing, name)) for name in slots}
    if isinstance(thing, dict):
        return {key: described(value) for key, value in thing.items()}
    if isinstance(thing, list | tuple):
        return [described(part) for part in thing]
    return type(thing).__name__, str(thing)


def _slots(type_: type) -> list[str]:
    slots = vars(type_).get("__slots__", ())
    return [slots] if isinstance(slots, str) else list(slots)


def _signature(path: str) -> tuple[int, int]:
    status = os.stat(path)  # noqa: PTH116  (as fast as it gets)
    return status.st_mtime_ns, status.st_size
