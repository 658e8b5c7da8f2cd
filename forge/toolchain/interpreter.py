"""Finds the Python interpreter of a workspace and checks its modules."""

from __future__ import annotations

import contextlib
import importlib.util
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import EnvironmentFault, Problem
from forge.base.frozen import frozen
from forge.base.layout import PACKAGE

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

OLDEST = (3, 10)

_TRAITS = """import importlib.metadata as m, importlib.util as u, os, sys, sysconfig
print("version=%d.%d.%d" % sys.version_info[:3])
header = sysconfig.get_path("include") + "/Python.h"
os.path.exists(header) and print("header=" + header)
for name in sys.argv[1:]:
    u.find_spec(name) and print(name + "=there")
try:
    print("setuptools=" + m.version("setuptools"))
except m.PackageNotFoundError:
    pass
"""


@frozen
class Interpreter:
    """A Python program and its version."""

    path: Path
    version: tuple[int, int]

    @property
    def site_packages(self) -> str:
        """Return the folder for Python code below a prefix, such as 'lib/python3.11/site-packages'."""
        return f"lib/python{self.version[0]}.{self.version[1]}/site-packages"

    @property
    def own(self) -> bool:
        """Tell whether this interpreter runs forge."""
        return self.path in {own_path(), Path(sys.executable)}


def own_path() -> Path:
    """Return the interpreter that runs forge, with the same name however forge was started."""
    return _usual_name(Path(sys.executable))


def own_command(*words: str) -> tuple[str, ...]:
    """Return the command that starts forge, or with '-m' one of its modules, regardless of PYTHONPATH."""
    return (sys.executable, str(PACKAGE.parent / "_ros_forge.py"), *words)


def find_interpreter(python: str | None, variables: Mapping[str, str]) -> Interpreter:
    """Return the workspace's interpreter: the option's, else the virtual environment's, else forge's own.

    `python` is a path, or a name on PATH. Raises EnvironmentFault if it is missing, does not run or is too
    old.
    """
    path = _locate(python, variables)
    if path in {own_path(), Path(sys.executable)}:
        return Interpreter(path, sys.version_info[:2])
    interpreter = Interpreter(path, _ask_version(path))
    if interpreter.version < OLDEST:
        version = "{}.{}".format(*interpreter.version)
        problem = Problem(
            f"python {version} at '{path}' is too old", hint="forge requires python 3.10 or newer"
        )
        raise EnvironmentFault(problem)
    return interpreter


def require_modules(interpreter: Interpreter, names: Iterable[str]) -> None:
    """Raise EnvironmentFault with the modules that `interpreter` lacks and how to install them."""
    missing = missing_modules(interpreter, names)
    if missing:
        raise EnvironmentFault(missing_modules_problem(interpreter, missing))


def missing_modules_problem(interpreter: Interpreter, modules: Iterable[str]) -> Problem:
    """Return a problem for modules that the build needs and an interpreter lacks."""
    names = list(modules)
    wanted = " ".join({"em": "'empy<4'", "yaml": "PyYAML"}.get(name, name) for name in names)
    return Problem(
        f"'{interpreter.path}' lacks modules required by the build: {', '.join(map(repr, names))}",
        hint=f"{interpreter.path} -m pip install {wanted}",
    )


def interpreter_properties(interpreter: Interpreter, names: Iterable[str]) -> Mapping[str, str]:
    """Return properties of an interpreter; raises EnvironmentFault if it does not run.

    The keys are 'version'; 'header', if C extensions can be compiled; 'setuptools', its version; and the
    names of those modules in `names` that exist.
    """
    return dict(line.split("=", 1) for line in _ask(interpreter.path, _TRAITS, *names).splitlines())


def missing_modules(interpreter: Interpreter, names: Iterable[str]) -> list[str]:
    """Return the modules that an interpreter lacks; raises EnvironmentFault if it does not run."""
    wanted = list(names)
    if interpreter.own:
        return [name for name in wanted if not _has_module(name)]
    return _ask_missing(interpreter, wanted)


def _locate(python: str | None, variables: Mapping[str, str]) -> Path:
    """Return the interpreter's absolute path without resolving links, which identify virtual environments."""
    if python:
        found = shutil.which(python, path=variables.get("PATH"))
        if found is None:
            problem = Problem(f"python '{python}' not found", hint="pass an existing program to '--python'")
            raise EnvironmentFault(problem)
        return Path(found).absolute()
    active = variables.get("VIRTUAL_ENV")
    if not active or Path(active).resolve() == Path(sys.prefix).resolve():
        return own_path()
    path = _usual_name(Path(active).absolute() / "bin" / "python")
    if not path.exists():
        raise EnvironmentFault(
            Problem(
                f"the active virtual environment '{active}' has no 'bin/python'",
                hint="run 'deactivate', or choose an interpreter with '--python'",
            )
        )
    return path


def _usual_name(path: Path) -> Path:
    """Return the python3 next to a program if both are the same file, for a stable path."""
    usual = path.with_name("python3")
    with contextlib.suppress(OSError):
        if usual.samefile(path):
            return usual
    return path


def _ask_version(path: Path) -> tuple[int, int]:
    """Return the version that the interpreter reports."""
    answer = _ask(path, "import sys; print(*sys.version_info[:2])").split()
    if len(answer) == 2 and all(word.isdecimal() for word in answer):  # noqa: PLR2004  (major and minor)
        return int(answer[0]), int(answer[1])
    raise EnvironmentFault(Problem(f"'{path}' is not a python interpreter"))


def _ask_missing(interpreter: Interpreter, names: list[str]) -> list[str]:
    """Return the modules that another interpreter does not find."""
    program = "import importlib.util as u, sys; print(*(n for n in sys.argv[1:] if not u.find_spec(n)))"
    return _ask(interpreter.path, program, *names).split()


def _ask(path: Path, program: str, *arguments: str) -> str:
    """Run Python code in another interpreter and return its output."""
    import subprocess  # noqa: PLC0415  (not needed for forge's own interpreter)

    try:
        # Python would import modules from the working directory.
        done = subprocess.run(
            [path, "-c", program, *arguments], cwd="/", capture_output=True, text=True, check=True
        )
    except OSError as error:
        raise EnvironmentFault(
            Problem(f"cannot run the Python interpreter '{path}': {error.strerror}")
        ) from error
    except subprocess.CalledProcessError as error:
        message = f"cannot run the Python interpreter '{path}': exit code {error.returncode}"
        raise EnvironmentFault(Problem(message)) from error
    return done.stdout


def _has_module(name: str) -> bool:
    """Tell whether forge's own interpreter finds a module, without importing it."""
    return importlib.util.find_spec(name) is not None
