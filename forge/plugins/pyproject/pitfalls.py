"""Detect mistakes in Python packages that build backends do not report and that fail at run time.

Entry points of scripts that are not NAME = MODULE:FUNCTION are reported with their location. The output of a
failed backend is shortened to the failure.
"""

from __future__ import annotations

import ast
import configparser
import os
import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from forge.base.errors import Location, Problem, WorkspaceError, raise_if_any
from forge.base.files import read_file, text_or_nothing
from forge.base.names import did_you_mean
from forge.build.inputs.fingerprints import source_files
from forge.build.wheels.install_wheel import DISK_FULL

_VERSION = re.compile(r"python3\.(\d+)")
_POINT = re.compile(r"([\w.]+)\s*:\s*(\w+)")


def refuse_what_no_backend_reads(source: Path, site: Path) -> None:
    """Raise WorkspaceError for a folder without build configuration, or an invalid setup.py."""
    setup = source / "setup.py"
    if setup.is_file():
        problem = _syntax_problem(setup, setup) if _same_version(site) else None
        raise_if_any((problem,) if problem else (), WorkspaceError)
        return
    if (source / "pyproject.toml").is_file():
        return
    from forge.workspace.python_metadata import read_setup_cfg

    if not read_setup_cfg(text_or_nothing(source / "setup.cfg")).name:
        hint = "'forge pkg create --build-type ament_python NAME' creates a complete package"
        raise WorkspaceError(
            Problem("there is neither a setup.py nor a pyproject.toml", Location(source), hint)
        )


def wheel_warnings(source: Path, site: Path, installed: Sequence[Path]) -> Iterator[Problem]:
    """Yield problems that occur when modules are imported or scripts started; `site` is site-packages."""
    points = next((path for path in installed if path.match(f"*-info/{ENTRY_POINTS}")), None)
    if points:
        # The package may install its modules elsewhere, with their metadata.
        site = points.parent.parent
    modules = {
        _module(path.relative_to(site)): path
        for path in installed
        if path.is_relative_to(site) and path.suffix in {".py", ".so"}
    }
    broken = set()
    if _same_version(site):
        for name, path in sorted(modules.items()):
            problem = _syntax_problem(path, _origin(source, site, path)) if path.suffix == ".py" else None
            if problem:
                broken.add(name)
                yield problem
    text = text_or_nothing(points) if points else ""
    yield from invalid_scripts(text, source)
    for script, target in scripts(text):
        if not (match := _POINT.match(target)):
            continue
        module, function = match.groups()
        folder = source / module.partition(".")[0]
        if module in modules:
            if modules[module].suffix != ".py" or module in broken:
                continue
            names, complete = _defined(ast.parse(text_or_nothing(modules[module])))
            if complete and function not in names:
                message = f"'{script}' calls '{function}', which '{module}' does not define"
                yield Problem(message, Location(defining_file(source)), did_you_mean(function, names))
        elif folder.is_dir() or folder.name in modules:
            missing_init = folder.is_dir() and not (folder / "__init__.py").exists()
            hint = f"add an empty {folder}/__init__.py" if missing_init else did_you_mean(module, modules)
            message = f"the script '{script}' starts '{module}', which the package does not install"
            yield Problem(message, Location(defining_file(source)), hint)


def _defined(tree: ast.Module) -> tuple[set[str], bool]:
    """Return the names that a module binds, and True if the list is complete."""
    names: set[str] = set()
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                names.add(name)
            case ast.Import(names=aliases) | ast.ImportFrom(names=aliases):
                names.update((alias.asname or alias.name).partition(".")[0] for alias in aliases)
            case ast.Name(id=name, ctx=ast.Store()):
                names.add(name)
    return names, names.isdisjoint({"*", "__getattr__"})


def _syntax_problem(path: Path, shown: Path) -> Problem | None:
    """Return a problem for a syntax error in a file, with the path `shown`, or None."""
    try:
        compile(read_file(path), str(shown), "exec", ast.PyCF_ONLY_AST)
    except SyntaxError as error:
        line = (error.text or "").rstrip("\r\n")
        place = Location(shown, error.lineno, error.offset or None, line or None)
        return Problem(error.msg or "invalid syntax", place)
    except ValueError as error:
        return Problem(str(error), Location(shown))
    return None


def _module(path: Path) -> str:
    parts = [*path.parts[:-1], path.name.partition(".")[0]]
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _origin(source: Path, site: Path, path: Path) -> Path:
    """Return the source file of a module if it has the same relative path, else the module itself."""
    name = path.relative_to(site)
    return next((at / name for at in (source, source / "src") if (at / name).is_file()), path)


def _same_version(site: Path) -> bool:
    """Return True if `site` is for the Python version that runs forge; others may have another syntax."""
    match = _VERSION.search(str(site))
    return match is None or int(match[1]) == sys.version_info.minor


ENTRY_POINTS = "entry_points.txt"
"""The metadata file of a wheel that lists entry points."""

_SECTIONS = ("console_scripts", "gui_scripts")
_VALID = re.compile(r"[^=]*[^\s=]\s*=\s*[\w.]+\s*:\s*[\w.]+\s*(?:\[.*\]\s*)?")
"""Entry points that installers accept; a backend may accept more."""
_MEANT = re.compile(r"([^\s=:]+)[\s=]+([\w./]+?)(?:\s*:\s*([\w.]+)(?:\(\))?)?\s*")
_OF_SCRIPTS = re.compile(r"_scripts|^\[project\.(?:gui-)?scripts\]", re.MULTILINE)
_FILES = ("setup.py", "pyproject.toml", "setup.cfg")


def scripts(text: str) -> Iterator[tuple[str, str]]:
    """Yield name and target of each script of an entry_points.txt; nothing if it is malformed."""
    parser = configparser.RawConfigParser(delimiters=("=",))
    parser.optionxform = str  # type: ignore[assignment, method-assign]  # (names have upper case, too)
    try:
        parser.read_string(text)
    except configparser.Error:
        return
    for section in _SECTIONS:
        yield from parser[section].items() if parser.has_section(section) else ()


def invalid_scripts(text: str, source: Path) -> Iterator[Problem]:
    """Yield a problem for each invalid script of an entry_points.txt, with its location in the sources."""
    for name, target in scripts(text):
        point = f"{name} = {target}"
        if not _VALID.fullmatch(point):
            yield _problem(point, _place(source, name, target))


def without_invalid_scripts(text: str) -> str:
    valid = (f"{name} = {target}" for name, target in scripts(text))
    return "\n".join(("[console_scripts]", *filter(_VALID.fullmatch, valid), ""))


def invalid_scripts_of_setup(setup: Path) -> Iterator[Problem]:
    """Yield a problem for each invalid script that a setup.py without syntax errors names literally."""
    text = text_or_nothing(setup)
    lines = text.splitlines()
    for node in _literals(ast.parse(text)):
        point = node.value.strip() if isinstance(node.value, str) else ""
        if not point or "\n" in point or point.startswith("#"):
            continue
        place = Location(setup, node.lineno, node.col_offset + 1, lines[node.lineno - 1])
        if not _VALID.fullmatch(point):
            yield _problem(point, place)
        elif re.search(r"[/\\]", point.partition("=")[0]):
            yield Problem(f"the name of the script '{point}' contains a path separator", place)


def defining_file(source: Path) -> Path:
    paths = [source / name for name in _FILES]
    return next((path for path in paths if _OF_SCRIPTS.search(text_or_nothing(path))), paths[0])


def _literals(tree: ast.Module) -> Iterator[ast.Constant]:
    for node in ast.walk(tree):
        for key, value in zip(node.keys, node.values, strict=True) if isinstance(node, ast.Dict) else ():
            if isinstance(key, ast.Constant) and key.value in _SECTIONS:
                elements = value.elts if isinstance(value, ast.List | ast.Tuple) else []
                yield from (element for element in elements if isinstance(element, ast.Constant))


def _problem(point: str, place: Location) -> Problem:
    name, equals, target = (part.strip() for part in point.partition("="))
    meant = _MEANT.fullmatch(point)
    if not equals:
        message = f"the entry point '{point}' lacks '='"
    elif name and re.fullmatch(r"[\w.]+", target):
        message = f"the entry point '{point}' lacks ':FUNCTION'"
    else:
        message = f"the entry point '{point}' is not of the form 'NAME = MODULE:FUNCTION'"
    hint = meant and f"write '{meant[1]} = {meant[2].replace('/', '.')}:{meant[3] or 'main'}'"
    return Problem(message, place, hint)


def _place(source: Path, name: str, target: str) -> Location:
    """Return the line that names a script and its target, or the file if there is none."""
    path = defining_file(source)
    written = re.compile(rf"(?<![\w-]){re.escape(name)}\b.*=.*{re.escape(target)}")
    for number, line in enumerate(text_or_nothing(path).splitlines(), 1):
        if written.search(line):
            return Location(path, number, source=line)
    return Location(path)


_NOT_UTF8 = "surrogates not allowed"
"""The text of Python's error for a name that is not UTF-8."""
_OF_ENTRY_POINT = re.compile(r"Pair\.__new__|entry.?point|in script names", re.IGNORECASE)
"""The errors of setuptools for an invalid entry point."""
_FAILED_WRITE = re.compile(
    r"^(?:Traceback \(most recent call last\):\n(?:  .*\n)+"
    r"|Exception ignored in: .*\n|\w*[eE]rror: \[Errno .*\n)",
    re.MULTILINE,
)
_OF_SETUPTOOLS = re.compile(r"^running (?:bdist_wheel|install|egg_info)$", re.MULTILINE)
_PROGRESS = re.compile(
    r"^(?:running [a-z_]+|(?:creating|writing|reading|adding|removing|installing|byte-compiling) .*"
    r"|(?:copying|copying and adjusting|moving|hard linking) .* -> .*"
    r"|warning: \w+: byte-compiling is disabled, skipping\.\n?)\n",
    re.MULTILINE,
)
"""Progress messages of setuptools, which are omitted from the output of a failed backend."""
_CODE = r"(?:    .*\n)*"
_OUTER_FRAMES = re.compile(
    r"^(Traceback \(most recent call last\):\n)"
    rf'(?:  File ".*(?:setup_install|_in_process|setuptools/build_meta)\.py", .*\n{_CODE})+'
    r'(?:  File "(?:<string>|setup\.py)", line (\d+), in <module>\n'
    rf"({_CODE})|(?=  File ))",
    re.MULTILINE,
)
"""The stack frames that start a backend, and the frame of setup.py, whose name may be missing."""


def progress_and_failure(output: str, source: Path) -> tuple[str, str]:
    """Return the progress messages of setuptools, and the remaining output of a failed backend.

    Tracebacks start in the package's setup.py, or in the backend, not in the code that starts it. Raises
    WorkspaceError for invalid entry points and file names.
    """
    setup = source / "setup.py"
    if _NOT_UTF8 in output:
        raise_if_any(_non_utf8_names(source), WorkspaceError)
    if _OF_ENTRY_POINT.search(output):
        raise_if_any(invalid_scripts_of_setup(setup), WorkspaceError)
    progress = "".join(_PROGRESS.findall(output)) if _OF_SETUPTOOLS.search(output) else ""
    failure = _PROGRESS.sub("", output) if progress else output
    if DISK_FULL.search(output):
        return progress, _FAILED_WRITE.sub("", failure)
    lines = text_or_nothing(setup).splitlines()

    def shortened(match: re.Match[str]) -> str:
        title, line, code = match.groups()
        if line is None:
            return title
        source = "".join(f"    {text.strip()}\n" for text in lines[int(line) - 1 : int(line)])
        return f'{title}  File "{setup}", line {line}, in <module>\n{code or source}'

    return progress, _OUTER_FRAMES.sub(shortened, failure)


def _non_utf8_names(source: Path) -> Iterator[Problem]:
    """Yield a problem for each file whose name is not UTF-8, which a wheel cannot contain."""
    for path in source_files(str(source)):
        name = os.path.relpath(path, source)
        if not name.isascii() and name != name.encode(errors="replace").decode():
            hint = "rename it, or remove it from 'package_data' and 'data_files'"
            yield Problem(
                f"the file name {os.fsencode(name)!r} is not UTF-8, as wheels require", Location(source), hint
            )
