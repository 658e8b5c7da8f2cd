"""Make a package's wheel with its own build backend (PEP 517), and find out what the backend read."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import warnings
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyproject_hooks

from forge.backend_inputs import external_files, parse_list, parse_make_rules, parse_trace
from forge.digests import source_files
from forge.errors import EnvironmentFault, Place, Problem, WorkspaceError, raise_if_any
from forge.externals import READ_BY_BACKEND, WRITTEN_BY_BACKEND, external_inputs
from forge.files import read_file, replace_file
from forge.formats import read_toml
from forge.lending import lent_setuptools

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

_SETUPTOOLS: dict[str, Any] = {"build-backend": "setuptools.build_meta:__legacy__", "requires": []}
_OURS = "setuptools.build_meta"
_NOT_UTF8 = "surrogates not allowed"
"""What Python says of a name that is not UTF-8."""
_START = """\
import sys
if sys.path[:1] == [""]:
    del sys.path[0]
from importlib.util import module_from_spec, spec_from_file_location
spec = spec_from_file_location("backend_tracer", {tracer!r})
tracer = module_from_spec(spec)
spec.loader.exec_module(tracer)
tracer.main(sys.argv)
"""
"""A module is compiled once, a program each time; and nothing is imported from the package's folder."""

_SITECUSTOMIZE = """\
# Logs what the Python programs read that a build backend starts, as of the backend itself.
import os, sys
from importlib.machinery import PathFinder
from importlib.util import module_from_spec, spec_from_file_location

def _run(spec):
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module

_folder = os.path.dirname(os.path.abspath(__file__))
sys.path[:] = [entry for entry in sys.path if os.path.abspath(entry) != _folder]
try:
    _run(spec_from_file_location("backend_tracer", {tracer!r})).trace({log!r})
except Exception:
    pass  # as with a Python that is too old
_next = PathFinder.find_spec("sitecustomize", sys.path)
if _next is not None and _next.loader is not None:
    _run(_next)
"""
"""What Python imports at its start; the module of this name that it would have found is run as well."""


def build_wheel(source: Path, build: Path, prefix: Path, python: str) -> tuple[Path, str]:
    """Return the wheel that the package's backend makes, and what the backend printed.

    Nothing is written into the source folder.
    """
    system = _build_system(source)
    backend, *_ = system["build-backend"].split(":")
    _remove_leftovers(build)
    out = build / "wheel"
    out.mkdir(parents=True)
    settings = build / "distutils.cfg"
    settings.write_text(f"[egg_info]\negg_base = {build}\n[build]\nbuild_base = {build / 'build'}\n", "utf-8")
    os.environ["DIST_EXTRA_CONFIG"] = str(settings)
    trace = _Trace(source, build, prefix)
    caller = pyproject_hooks.BuildBackendHookCaller(
        str(source),
        system["build-backend"],
        backend_path=system.get("backend-path"),
        runner=partial(_run_backend, trace=trace, surroundings=_surroundings(system, python, trace)),
        python_executable=python,
    )
    try:
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            wheel = caller.build_wheel(str(out))
    except pyproject_hooks.BackendUnavailable:
        hint = f"install it there: {python} -m pip install {backend.split('.')[0]}"
        raise EnvironmentFault(Problem(f"the interpreter '{python}' has no '{backend}'", hint=hint)) from None
    except subprocess.CalledProcessError:
        remedy = f"if it lacks 'bdist_wheel': {python} -m pip install -U setuptools"
        message = f"the package's build backend '{backend}' failed; its own message stands above"
        raise EnvironmentFault(Problem(message, hint=remedy if backend == _OURS else None)) from None
    for warning in warned:
        # pyproject_hooks repeats here what the backend was warned of.
        print(f"{warning.category.__name__}: {warning.message}")
    read, written = trace.result()
    _write_list(build / "handover" / READ_BY_BACKEND, read)
    _write_list(build / "handover" / WRITTEN_BY_BACKEND, written)
    shutil.rmtree(trace.folder)
    return out / wheel, trace.said


class _Trace:
    """A folder in which a backend and what it starts log what they read."""

    def __init__(self, source: Path, build: Path, prefix: Path) -> None:
        """Make the folder; files below these three are no inputs."""
        self.folder = build / "handover" / "backend"
        self.folder.mkdir(parents=True)
        self._source = source
        self._products = build / "build"
        inside = (source, build, prefix)
        self._inside = {*map(str, inside), *map(os.path.realpath, inside)}
        self._lent: Path | None = None
        self.said = ""
        """What the backend printed."""

    def lend(self, python: str) -> Path | None:
        """Return a folder with a setuptools for an interpreter that lacks one, if it is of use."""
        self._lent = lent_setuptools(python, self.folder / "lent")
        return self._lent

    def argv(self, command: Sequence[str]) -> tuple[str, ...]:
        """Return the command of a Python script whose last word is its folder, as one that is traced."""
        python, script, *words = command
        self._inside |= {str(Path(script).parent), words[-1]}
        tracer = str(Path(__file__).with_name("backend_tracer.py"))
        children = self.folder / "children"
        children.mkdir(exist_ok=True)
        text = _SITECUSTOMIZE.format(tracer=tracer, log=str(self._log))
        (children / "sitecustomize.py").write_text(text, encoding="utf-8")
        return (python, "-c", _START.format(tracer=tracer), str(self.folder), script, *words)

    def variables(self) -> Mapping[str, str]:
        """Return what makes compilers log the headers that they read: one variable for gcc, two for clang.

        scikit-build-core would remove its build folder, and with it what CMake knows of headers.
        """
        return {
            "SKBUILD_BUILD_DIR": str(self._products / "cmake"),
            "SUNPRO_DEPENDENCIES": str(self.folder / "rules"),
            "CC_PRINT_HEADERS": "1",
            "CC_PRINT_HEADERS_FILE": str(self.folder / "headers"),
        }

    def result(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the inputs outside that were read, and the package's own files that were written."""
        source = str(self._source)
        rules, headers = (_text(self.folder / name) for name in ("rules", "headers"))
        files = {*parse_make_rules(rules, source), *parse_list(headers, source)}
        for cache in self._products.rglob("CMakeCache.txt"):
            files.update(external_inputs(cache.parent, self._source, ()))
        traced = parse_trace(_text(self._log))
        if self._lent:
            # It is of use until the interpreter has what it needs.
            traced.missing.update(setuptools=True, wheel=True)
            files.update(map(os.path.realpath, self._lent.glob("*.dist-info/RECORD")))
        real = os.path.realpath(source)
        written = {
            f"{source}{path[len(home) :]}"
            for home in (source, real)
            for path in traced.written
            if path.startswith(f"{home}{os.sep}")
        }
        return external_files(traced, files, tuple(self._inside)), tuple(sorted(written))

    @property
    def _log(self) -> Path:
        return self.folder / "log"


def _text(path: Path) -> str:
    with suppress(OSError), path.open(encoding="utf-8", errors="surrogateescape", newline="\n") as stream:
        return stream.read()
    return ""


def _remove_leftovers(build: Path) -> None:
    """Remove what an earlier build left: its modules and its list of sources would end up in the wheel."""
    for name in (
        "wheel",
        "build",
        "handover/backend",
        f"handover/{READ_BY_BACKEND}",
        f"handover/{WRITTEN_BY_BACKEND}",
    ):
        _remove(build / name)
    for path in build.glob("*.egg-info"):
        _remove(path)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _write_list(path: Path, paths: Iterable[str]) -> None:
    """Write paths, one a line."""
    replace_file(path, "".join(_lines(paths)).encode("utf-8", "surrogateescape"))


def _lines(paths: Iterable[str]) -> Iterator[str]:
    for path in paths:
        fits = "\n" not in path and "\r" not in path
        yield f"{path}\n" if fits else f"# left out, for there is a line break in its name: {path!a}\n"


def _surroundings(system: Mapping[str, Any], python: str, trace: _Trace) -> Mapping[str, str]:
    """Return the environment of the backend, with a setuptools where the interpreter lacks one."""
    variables = {**os.environ, **trace.variables()}
    if system["build-backend"].startswith("setuptools.") or "backend-path" in system:
        lent = trace.lend(python)
        if lent is not None:
            path = os.pathsep.join(filter(None, (str(lent), os.environ.get("PYTHONPATH"))))
            variables["PYTHONPATH"] = path
    return variables


def _run_backend(
    cmd: Sequence[str],
    cwd: str | None = None,
    extra_environ: Mapping[str, str] | None = None,
    *,
    trace: _Trace,
    surroundings: Mapping[str, str],
) -> None:
    """Run the backend; what it says goes to stdout, since backends chatter on stderr when all is well.

    Raises CalledProcessError after its words went to stderr.
    """
    done = subprocess.run(
        trace.argv(cmd),
        cwd=cwd,
        env={**surroundings, **(extra_environ or {})},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        check=False,
    )
    trace.said += done.stdout
    if done.returncode and _NOT_UTF8 in done.stdout:
        raise_if_any(_names_of_no_wheel(Path(cwd or ".")), WorkspaceError)
    print(done.stdout, end="", file=sys.stderr if done.returncode else sys.stdout)
    done.check_returncode()


def _names_of_no_wheel(source: Path) -> Iterator[Problem]:
    """Yield the files of a package that no wheel can hold, since their names are not UTF-8."""
    for path in source_files(str(source)):
        name = os.path.relpath(path, source)
        if not name.isascii() and name != name.encode(errors="replace").decode():
            hint = "rename it, or leave it out of 'package_data' and 'data_files'"
            yield Problem(
                f"the name of {os.fsencode(name)!r} is not UTF-8, as all names in a wheel are",
                Place(source),
                hint,
            )


def _build_system(source: Path) -> dict[str, Any]:
    """Return the build-system table of pyproject.toml, or setuptools' when there is none."""
    path = source / "pyproject.toml"
    if not path.is_file():
        return dict(_SETUPTOOLS)
    table = read_toml(read_file(path), path).get("build-system", {})
    system = {**_SETUPTOOLS, **(table if isinstance(table, dict) else {"build-backend": None})}
    folders = system.get("backend-path", [])
    if not isinstance(system["build-backend"], str) or not isinstance(folders, list):
        hint = "write 'build-backend' as a text, and 'backend-path' as a list, if at all"
        raise WorkspaceError(Problem("'build-system' names no backend", Place(path), hint))
    return system
