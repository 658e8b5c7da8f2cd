"""Chooses the Python interpreter of a workspace, the same for all commands.

Only the option, the environment and the underlays decide, not how forge itself was installed. Programs of
the workspace keep the interpreter in their first line, and would break with the tool's own environment.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import field
from pathlib import Path

from forge.base.errors import HostError, Problem
from forge.base.files import names_in
from forge.base.frozen import frozen
from forge.base.layout import LAYOUT_MARKER, PACKAGE, PACKAGE_LOCK
from forge.environment.install_state import recorded_python

OLDEST = (3, 10)

_VERSIONED = re.compile(r"python(\d+)\.(\d+)")
_RECEIPTS = ("uv-receipt.toml", "pipx_metadata.json")
"""Files that mark environments of tools installed by uv and pipx."""
_CACHED_BY_UV = "archive-v0"
"""The folder of uv's cache that holds the environments of `uvx`."""
_BASE_OF_CONDA = frozenset({"base", "root"})
_PROGRAM = "import sys; print(*sys.version_info[:2]); print(sys.executable)"

ENVIRONMENT_FOLDER = ".venv"
"""The virtual environment that `forge fetch` creates in a workspace with a lock."""

_FOLDER = re.compile(r".*/python(\d+)\.(\d+)")
_SHEBANG = re.compile(rb"#!\s*(/\S*/python3?(?:\.\d+)?)\s")
_SCRIPTS_READ = 20
"""The maximum number of scripts that are read per prefix: most have the same interpreter."""

OPTION = "'--python'"
ON_PATH = "'python3' on PATH"
LAST_BUILD = "the last build"
_ENVIRONMENT = "the active virtual environment"
_CONDA = "the active conda environment"
_OF_WORKSPACE = f"the workspace's '{ENVIRONMENT_FOLDER}'"
_CHOSEN = frozenset({OPTION, _ENVIRONMENT, _CONDA})
_KEPT = frozenset({*_CHOSEN, LAST_BUILD, _OF_WORKSPACE})
"""Origins that fix the program, even if it is a script that starts another one."""
_OTHER_VERSION = {
    OPTION: "pass '--python {0}'",
    _ENVIRONMENT: "run 'deactivate', or activate one of {0}: {0} -m venv --system-site-packages .venv",
    _CONDA: "run 'conda deactivate', or source an underlay for this environment",
    _OF_WORKSPACE: f"remove '{ENVIRONMENT_FOLDER}', and run 'forge fetch' with {{0}} on PATH",
}
"""Remedies for an underlay of another version, by the origin of the interpreter."""


@frozen
class Interpreter:
    """A Python program, its version, and how it was chosen."""

    path: Path
    version: tuple[int, int]
    origin: str = field(default="", compare=False)

    @property
    def site_packages(self) -> str:
        """Return the folder for Python code below a prefix, such as 'lib/python3.11/site-packages'."""
        return f"lib/python{self.release}/site-packages"

    @property
    def release(self) -> str:
        return "{}.{}".format(*self.version)

    @property
    def chosen(self) -> bool:
        """Whether an option or an active environment chose the interpreter."""
        return self.origin in _CHOSEN


_Choice = tuple[Path, str]
"""A program and how it was chosen."""


def own_path() -> Path:
    """Return the interpreter that runs forge, by a name that does not depend on how forge was started."""
    return _usual_name(Path(sys.executable))


def is_own(path: Path) -> bool:
    return path in {own_path(), Path(sys.executable)}


def own_command(*words: str) -> tuple[str, ...]:
    """Return the command that starts forge, or with '-m' one of its modules, regardless of PYTHONPATH."""
    return (sys.executable, str(PACKAGE.parent / "_ros_forge.py"), *words)


def find_interpreter(
    python: str | None,
    variables: Mapping[str, str],
    underlays: Sequence[Path] = (),
    recorded: str | None = None,
    root: Path | None = None,
) -> Interpreter:
    """Return the workspace's interpreter.

    The first of these: `python`, a path or a name on PATH; `recorded`, the one of the last build; the one of
    the active virtual environment; of the environment in `root`, a workspace with a lock; of the highest
    sourced underlay; python3 on PATH. Environments that uv or pipx created for forge do not count.
    `underlays` are roots, lowest first. Raises HostError if the interpreter is missing, does not run, is too
    old, or of another version than an underlay.
    """
    if python:
        path = shutil.which(python, path=variables.get("PATH"))
        if path is None:
            hint = "pass an existing program to '--python'"
            raise HostError(Problem(f"python '{python}' not found", hint=hint))
        # Links are not resolved, because they identify virtual environments.
        choice = Path(path).absolute(), OPTION
    elif recorded and not _is_of_tool(Path(recorded)):
        choice = Path(recorded), LAST_BUILD
    else:
        choice = (
            _active(variables)
            or (_of_workspace(root) if root else None)
            or _of_underlays(underlays, variables)
            or _on_path(variables)
        )
    interpreter = _examined(*choice)
    if interpreter.version < OLDEST:
        message = f"python {interpreter.release} at '{interpreter.path}' is too old"
        raise HostError(Problem(message, hint="forge requires python 3.10 or newer"))
    for root in underlays:
        versions = python_versions(root)
        if versions and interpreter.version not in versions:
            program = "python{}.{}".format(*max(versions))
            usual = "source only underlays for the same version, or rebuild one of them"
            raise HostError(
                Problem(
                    f"the underlay '{root}' is for {_listed(versions)}, but {interpreter.origin} is python "
                    f"{interpreter.release} ('{interpreter.path}')",
                    hint=_OTHER_VERSION.get(interpreter.origin, usual).format(program),
                )
            )
    return interpreter


def ask_python(path: Path, program: str, *arguments: str, isolated: bool = False) -> str:
    """Return the output of Python code; `isolated` code starts faster, without packages. Raises HostError."""
    import subprocess

    argv = [path, *(("-I", "-S") if isolated else ()), "-c", program, *arguments]
    # Unless it is isolated, Python would import modules from the working directory; shims depend on that
    # folder.
    folder = None if isolated else "/"
    try:
        done = subprocess.run(argv, cwd=folder, capture_output=True, text=True, check=True)
    except OSError as error:
        raise HostError(Problem(f"cannot run the Python interpreter '{path}': {error.strerror}")) from error
    except subprocess.CalledProcessError as error:
        message = f"cannot run the Python interpreter '{path}': exit code {error.returncode}"
        raise HostError(Problem(message)) from error
    return done.stdout


def _active(variables: Mapping[str, str]) -> _Choice | None:
    """Return the interpreter of the active virtual or conda environment.

    conda's base environment is active in every shell, even if unwanted: it counts only as python3
    on PATH. conda environments may lack Python.
    """
    active = variables.get("VIRTUAL_ENV")
    if active and Path(active).resolve() != _own_tool():
        path = _program_in(Path(active))
        if path is None:
            message = f"the active virtual environment '{active}' has no 'bin/python'"
            hint = "run 'deactivate', or choose an interpreter with '--python'"
            raise HostError(Problem(message, hint=hint))
        return path, _ENVIRONMENT
    conda = variables.get("CONDA_PREFIX")
    if not conda or variables.get("CONDA_DEFAULT_ENV") in _BASE_OF_CONDA:
        return None
    path = _program_in(Path(conda))
    return (path, _CONDA) if path else None


def _of_workspace(root: Path) -> _Choice | None:
    path = root / ENVIRONMENT_FOLDER / "bin/python3"
    return (path, _OF_WORKSPACE) if (root / PACKAGE_LOCK).exists() and path.exists() else None


def _program_in(environment: Path) -> Path | None:
    """Return the interpreter of a virtual environment; that of forge's own always has the same name."""
    if environment.resolve() == Path(sys.prefix).resolve():
        return own_path()
    path = _usual_name(environment.absolute() / "bin" / "python")
    return path if path.exists() else None


def _of_underlays(underlays: Sequence[Path], variables: Mapping[str, str]) -> _Choice | None:
    """Return the interpreter of the highest underlay that has one; raises HostError if it is missing."""
    for root in reversed(underlays):
        path = underlay_python(root)
        if path is None or _is_of_tool(path):
            path = _of_version(root, variables)
        if path is not None:
            return _usual_name(path), f"the underlay '{root}'"
    return None


def _of_version(root: Path, variables: Mapping[str, str]) -> Path | None:
    """Return the program for the version of an underlay's modules, None without modules."""
    versions = python_versions(root)
    if not versions:
        return None
    with suppress(HostError):
        usual = _examined(*_on_path(variables))
        if usual.version in versions:
            return usual.path
    name = "python{}.{}".format(*max(versions))
    program = _which(name, variables)
    if program is None:
        message = f"the underlay '{root}' is for {_listed(versions)}, but '{name}' is not on PATH"
        hint = "install it, or pass the path of such an interpreter to '--python'"
        raise HostError(Problem(message, hint=hint))
    return program


def _on_path(variables: Mapping[str, str]) -> _Choice:
    path = _which("python3", variables) or _which("python", variables)
    if path is None:
        hint = "install Python, activate a virtual environment, or pass an interpreter to '--python'"
        raise HostError(Problem("'python3' is not on PATH", hint=hint))
    return _usual_name(path), ON_PATH


def _which(program: str, variables: Mapping[str, str]) -> Path | None:
    """Return a program on PATH, except in the environment of a tool, which `uvx` prepends."""
    tool = _own_tool()
    folders = filter(None, variables.get("PATH", os.defpath).split(os.pathsep))
    others = [folder for folder in folders if tool is None or Path(folder).parent.resolve() != tool]
    path = shutil.which(program, path=os.pathsep.join(others))
    return Path(path).absolute() if path else None


def _is_of_tool(python: Path) -> bool:
    """Return whether an interpreter is in the environment that uv or pipx created for forge."""
    return python.parent.parent.resolve() == _own_tool()


def _own_tool() -> Path | None:
    """Return the environment in which forge runs if uv or pipx created it for forge."""
    prefix = Path(sys.prefix).resolve()
    marked = any((prefix / name).is_file() for name in _RECEIPTS)
    return prefix if marked or _CACHED_BY_UV in prefix.parts else None


def _examined(path: Path, origin: str) -> Interpreter:
    """Return the interpreter with its version; no process is started if a file name contains the version."""
    if is_own(path):
        return Interpreter(path, sys.version_info[:2], origin)
    real = path.resolve()
    match = _VERSIONED.fullmatch(real.name)
    with suppress(OSError):
        if match and os.access(real, os.X_OK):
            with real.open("rb") as stream:
                if stream.read(2) != b"#!":
                    return Interpreter(path, (int(match[1]), int(match[2])), origin)
    answer = re.match(r"(\d+) (\d+)\n(.*)", ask_python(path, _PROGRAM, isolated=True))
    if not answer:
        raise HostError(Problem(f"'{path}' is not a python interpreter"))
    # The shims of pyenv, asdf and mise start another program, which depends on the current folder.
    if origin not in _KEPT and Path(answer[3]).is_file():
        path = _usual_name(Path(answer[3]))
    return Interpreter(path, (int(answer[1]), int(answer[2])), origin)


def _listed(versions: frozenset[tuple[int, int]]) -> str:
    return " and ".join("python {}.{}".format(*version) for version in sorted(versions))


def _usual_name(path: Path) -> Path:
    """Return the python3 next to a program if both are the same file, for a stable path."""
    usual = path.with_name("python3")
    with suppress(OSError):
        if usual.samefile(path):
            return usual
    return path


def python_versions(root: Path) -> frozenset[tuple[int, int]]:
    """Return the Python versions of an underlay's modules in lib/pythonX.Y; empty without modules."""
    versions = (frozenset(version for _, version in _module_folders(prefix)) for prefix in _prefixes(root))
    return next(filter(None, versions), frozenset())


def lacks_modules(root: Path, variables: Mapping[str, str]) -> bool:
    """Return whether a prefix has Python modules that PYTHONPATH lacks, as after `sudo -E`."""
    python_path = {
        os.path.realpath(entry) for entry in variables.get("PYTHONPATH", "").split(os.pathsep) if entry
    }
    folders = [folder for folder, _ in _module_folders(root)]
    return bool(folders) and python_path.isdisjoint(map(os.path.realpath, folders))


def underlay_python(root: Path) -> Path | None:
    """Return the interpreter that an underlay was built with: recorded by forge, else that of its scripts."""
    if (recorded := recorded_python(root)) is not None:
        return Path(recorded)
    for prefix in _prefixes(root):
        for name in names_in(f"{prefix}/bin")[:_SCRIPTS_READ]:
            with suppress(OSError), Path(prefix, "bin", name).open("rb") as stream:
                match = _SHEBANG.match(stream.readline(512))
                python = Path(os.fsdecode(match[1])) if match else None  # no path if `env` finds it
                if python is not None and python.exists():
                    return python
    return None


def _prefixes(root: Path) -> Iterator[Path]:
    yield root
    if (root / LAYOUT_MARKER).is_file():
        yield from (root / name for name in names_in(f"{root}"))


def _module_folders(prefix: Path) -> Iterator[tuple[str, tuple[int, int]]]:
    """Yield the folders with Python modules of one prefix, and the versions in their names."""
    for library in ("lib", "local/lib"):
        for folder in (f"{library}/{name}" for name in names_in(f"{prefix}/{library}")):
            match = _FOLDER.fullmatch(folder)
            for modules in ("site-packages", "dist-packages") if match else ():
                # Empty folders of that name also belong to underlays without modules.
                if match and names_in(f"{prefix}/{folder}/{modules}"):
                    yield f"{prefix}/{folder}/{modules}", (int(match[1]), int(match[2]))
