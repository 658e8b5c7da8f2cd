"""Run the build backend of a package, record the files that it read, and shorten the output of a failure.

setuptools installs a package itself, like with colcon; other backends build a wheel (PEP 517).
"""

from __future__ import annotations

import errno
import json
import os
import re
import subprocess
import sys
import warnings
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyproject_hooks

from forge.base.errors import HostError, Location, Problem, WorkspaceError, raise_if_any
from forge.base.files import (
    delete_tree,
    listed_paths,
    read_file,
    replace_file,
    text_if_exists,
    text_or_nothing,
)
from forge.base.formats import read_toml
from forge.base.frozen import frozen
from forge.base.layout import PACKAGE, SCRATCH_DIR
from forge.base.options import flag, option
from forge.build.inputs.depfiles import READ_BY_BACKEND, WRITTEN_BY_BACKEND
from forge.build.inputs.fingerprints import source_files
from forge.build.observed_writes import note_start, note_unobserved, note_written
from forge.build.wheels import setup_install
from forge.build.wheels.backend_inputs import Traced, external_inputs, parse_trace
from forge.build.wheels.pitfalls import invalid_scripts_of_setup
from forge.toolchain.python_modules import install_command, setuptools_path

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

_SETUPTOOLS: dict[str, Any] = {"build-backend": "setuptools.build_meta:__legacy__", "requires": []}
_BACKENDS_OF_SETUPTOOLS = frozenset({"setuptools.build_meta", "setuptools.build_meta:__legacy__"})
INSTALL_LOG = "install.log"
"""The record of setuptools, in the same file as with colcon."""
TARGET_PYTHON = "/usr/bin/python3"
"""The interpreter in the first line of scripts for another platform."""
_NOT_UTF8 = "surrogates not allowed"
"""The text of Python's error for a name that is not UTF-8."""
_OF_ENTRY_POINT = re.compile(r"Pair\.__new__|entry.?point|in script names", re.IGNORECASE)
"""The errors of setuptools for an invalid entry point."""
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
"""Imports the tracer as a module, which is compiled only once, and nothing from the package's folder."""

_SITECUSTOMIZE = """\
# Traces Python programs started by a build backend.
import os, sys
if sys.executable == {python!r} and {prefix!r}:
    sys.real_prefix = sys.prefix
    sys.prefix = sys.exec_prefix = {prefix!r}
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
"""Python imports this at its start; the original sitecustomize module is run as well.

`prefix` is that of the package if setuptools installs it: like with colcon, `sys.prefix` leads there.
"""

_SETTINGS = """\
[egg_info]
egg_base = {build}
[build]
build_base = {build}/build
build_lib = {build}/build/lib
build_temp = {build}/build/temp
build_scripts = {build}/build/scripts
[build_py]
build_lib = {build}/build/lib
[build_ext]
build_lib = {build}/build/lib
build_temp = {build}/build/temp
[build_clib]
build_clib = {build}/build/temp
build_temp = {build}/build/temp
[build_scripts]
build_dir = {build}/build/scripts
[bdist_wheel]
bdist_dir = {build}/build/wheel
"""
"""Keeps the intermediate files of a backend that wraps setuptools out of the sources."""


@frozen
class WheelInstall:
    source: Path = option("folder of the package", positional=True, parse=Path, metavar="SOURCE")
    package: str = option("name of the package", required=True)
    build: Path = option("build folder of the package", required=True, parse=Path, metavar="DIR")
    prefix: Path = option("prefix to install into", required=True, parse=Path, metavar="DIR")
    python: str = option("interpreter to build with and for", required=True, metavar="PATH")
    site_packages: str = option("site-packages folder, relative to the prefix", required=True, metavar="DIR")
    scripts: str | None = option(
        "folder for scripts of packages without setup.py, relative to the prefix (default: lib/PACKAGE)",
        metavar="DIR",
    )
    target: str = option("platform, if it is not this machine", default="", metavar="TARGET")
    link: bool = flag("install symbolic links instead of copies")


def uses_setuptools(source: Path) -> bool:
    """Return True if setuptools itself is the package's backend, as for each package that colcon builds."""
    system = _build_system(source)
    return "backend-path" not in system and system["build-backend"] in _BACKENDS_OF_SETUPTOOLS


def run_setup_install(options: WheelInstall, scripts: str | None) -> tuple[tuple[Path, ...], str]:
    """Run `setup.py install` like colcon; return the installed files and the output.

    `scripts` is their folder, with setuptools' variables such as `$base`; None for setuptools' own folder.
    The options and command classes of the package have the same effect as with colcon, since the same
    commands run, with the real prefix.
    """
    source, build = options.source, options.build
    _remove_leftovers(build)
    build.mkdir(parents=True, exist_ok=True)
    trace = _Trace(source, build, options.prefix)
    log = build / INSTALL_LOG
    egg_base = os.path.relpath(os.path.realpath(build), os.path.realpath(source))
    words = ["egg_info", "--egg-base", egg_base, "build", "--build-base", str(build / "build")]
    words += ["--executable", TARGET_PYTHON] if options.target else []
    words += ["install", "--record", str(log), "--single-version-externally-managed"]
    words += ["--install-scripts", scripts] if scripts else []
    words += ["--force", "--no-compile"]
    request = {
        "build": str(build / "build"),
        "prefix": str(options.prefix),
        "site_packages": options.site_packages,
        "words": words,
        "pure": bool(options.target),
    }
    file = trace.folder / "request.json"
    file.write_text(json.dumps(request), "utf-8")
    # A wheel also needs the distribution 'wheel' of old versions.
    wheels = not (source / "setup.py").is_file()

    def run(environment: Mapping[str, str]) -> None:
        argv = (options.python, setup_install.__file__, str(file))
        prefix = str(options.prefix)
        _run_backend(argv, str(source), trace=trace, environment=environment, prefix=prefix)

    def lend_setuptools() -> Mapping[str, str]:
        return _backend_environment(dict(_SETUPTOOLS), options.python, trace, wheels=wheels)

    try:
        try:
            run(lend_setuptools() if wheels else {**os.environ, **trace.variables()})
        except subprocess.CalledProcessError as error:
            # Nearly all interpreters have setuptools: to ask first, each package would start one more.
            if wheels or error.returncode != setup_install.UNAVAILABLE:
                raise
            run(lend_setuptools())
    except subprocess.CalledProcessError as error:
        if DISK_FULL.search(trace.output):
            raise _full_disk(options.prefix) from None
        outside = text_if_exists(trace.folder / setup_install.OUTSIDE) or ""
        raise _setup_fault(error.returncode, outside, options) from None
    finally:
        # After a failure, too: what was installed is removed again.
        traced = trace.finish()
        found = {*traced.written, *map(os.path.normpath, listed_paths(log))}
        # setuptools also lists folders: those of `data_files` without files.
        installed = sorted(path for path in _respelled(found, options.prefix) if _is_file(path))
        for path in installed:
            note_written(path)
        for started in traced.started:
            note_unobserved(started)
    if source.is_relative_to(PACKAGE):
        # The path from an embedded package to the build folder depends on where both are.
        for listing in filter(lambda path: path.name == "SOURCES.txt", map(Path, installed)):
            replace_file(listing, read_file(listing).replace(os.fsencode(f"{egg_base}/"), b""))
    return tuple(map(Path, installed)), trace.output


def _is_file(path: str) -> bool:
    """Tell whether a path is a file, or a link to anything."""
    return os.path.lexists(path) and (os.path.islink(path) or not os.path.isdir(path))  # noqa: PTH112, PTH114  (each installed file: no Path for each)


def _setup_fault(code: int, outside: str, options: WheelInstall) -> HostError | WorkspaceError:
    if outside:
        message = f"the package would install files into '{outside}', which is outside its prefix"
        hint = "check data_files, and the options of setuptools' install command, in its setup"
        return WorkspaceError(Problem(message, Location(options.source), hint))
    if code == setup_install.COMPILED:
        return compiled_modules(options.source, options.target)
    if code == setup_install.UNAVAILABLE:
        return _unavailable("setuptools.build_meta", options.python)
    message = "the package's build backend 'setuptools.build_meta' failed; see its output above"
    return HostError(Problem(message))


def compiled_modules(source: Path, target: str) -> WorkspaceError:
    """Return the error for a package with compiled modules, which would be for this machine."""
    message = f"compiled modules cannot be built for '{target}'"
    hint = "build them with CMake in a package of their own, or build this package on the target"
    return WorkspaceError(Problem(message, Location(source), hint))


def _full_disk(folder: Path) -> OSError:
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(folder))


def _unavailable(backend: str, python: str) -> HostError:
    hint = f"install it there: {install_command(Path(python), (backend.split('.', maxsplit=1)[0],))}"
    message = f"the build backend '{backend}' is not installed for the interpreter '{python}'"
    return HostError(Problem(message, hint=hint))


def build_wheel(source: Path, build: Path, prefix: Path, python: str) -> tuple[Path, str]:
    """Build the wheel without writing into the source folder; return its path and the backend's output."""
    system = _build_system(source)
    backend, *_ = system["build-backend"].split(":")
    _remove_leftovers(build)
    out = build / "wheel"
    out.mkdir(parents=True)
    settings = build / "distutils.cfg"
    settings.write_text(_SETTINGS.format(build=build), "utf-8")
    os.environ["DIST_EXTRA_CONFIG"] = str(settings)
    trace = _Trace(source, build, prefix)
    caller = pyproject_hooks.BuildBackendHookCaller(
        str(source),
        system["build-backend"],
        backend_path=system.get("backend-path"),
        runner=partial(_run_backend, trace=trace, environment=_backend_environment(system, python, trace)),
        python_executable=python,
    )
    try:
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            wheel = caller.build_wheel(str(out))
    except pyproject_hooks.BackendUnavailable:
        raise _unavailable(backend, python) from None
    except subprocess.CalledProcessError:
        if DISK_FULL.search(trace.output):
            raise _full_disk(build) from None
        message = f"the package's build backend '{backend}' failed; see its output above"
        raise HostError(Problem(message)) from None
    for warning in warned:
        # Warnings of pyproject_hooks about the backend.
        print(f"{warning.category.__name__}: {warning.message}")
    trace.finish()
    return out / wheel, trace.output


class _Trace:
    """A folder for the logs of a backend and the programs that it starts."""

    def __init__(self, source: Path, build: Path, prefix: Path) -> None:
        """Create the folder; files in these three folders are not inputs."""
        self.folder = build / SCRATCH_DIR / "backend"
        self.folder.mkdir(parents=True)
        self._source = source
        self._build = build
        self._products = build / "build"
        inside = (source, build, prefix)
        self._inside = {*map(str, inside), *map(os.path.realpath, inside)}
        self.bundled: Path | None = None
        """A folder with forge's setuptools, if the interpreter lacks one."""
        self.output = ""
        """The backend's output."""

    def argv(self, command: Sequence[str], prefix: str) -> tuple[str, ...]:
        """Return the traced version of a Python command whose last argument is its folder."""
        python, script, *words = command
        self._inside |= {str(Path(script).parent), words[-1]}
        tracer = str(Path(__file__).with_name("backend_tracer.py"))
        children = self.folder / "children"
        children.mkdir(exist_ok=True)
        text = _SITECUSTOMIZE.format(tracer=tracer, log=str(self._log), python=python, prefix=prefix)
        (children / "sitecustomize.py").write_text(text, encoding="utf-8")
        return (python, "-c", _START.format(tracer=tracer), str(self.folder), script, *words)

    def variables(self) -> Mapping[str, str]:
        """Return the variables that keep scikit-build-core out of the sources."""
        return {"SKBUILD_BUILD_DIR": str(self._products / "cmake")}

    def finish(self) -> Traced:
        """Record the external inputs, and the sources that were written; return the parsed log."""
        traced = parse_trace(text_if_exists(self._log) or "")
        if self.bundled:
            # The bundled setuptools is used until these modules are installed.
            traced.missing.update(setuptools=True, wheel=True)
            traced.read.update(map(os.path.realpath, self.bundled.glob("*.dist-info/RECORD")))
        scratch = self._build / SCRATCH_DIR
        _write_list(scratch / READ_BY_BACKEND, external_inputs(traced, tuple(self._inside)))
        _write_list(scratch / WRITTEN_BY_BACKEND, sorted(_respelled(traced.written, self._source)))
        delete_tree(self.folder)
        return traced

    @property
    def _log(self) -> Path:
        return self.folder / "log"


def _respelled(paths: Iterable[str], folder: Path) -> set[str]:
    """Return the paths below a folder, which may lead there through links, in the spelling of the folder."""
    homes = {f"{folder}{os.sep}", f"{os.path.realpath(folder)}{os.sep}"}
    return {
        f"{folder}{os.sep}{path[len(home) :]}" for home in homes for path in paths if path.startswith(home)
    }


def _remove_leftovers(build: Path) -> None:
    """Remove files of an earlier build, whose modules and list of sources would end up in the wheel."""
    for name in (
        "wheel",
        "build",
        INSTALL_LOG,
        f"{SCRATCH_DIR}/backend",
        f"{SCRATCH_DIR}/{READ_BY_BACKEND}",
        f"{SCRATCH_DIR}/{WRITTEN_BY_BACKEND}",
    ):
        _remove(build / name)
    for path in build.glob("*.egg-info"):
        _remove(path)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        delete_tree(path)
    else:
        path.unlink(missing_ok=True)


def _write_list(file: Path, paths: Iterable[str]) -> None:
    lines = (
        f"# omitted because of a line break in its name: {path!a}\n"
        if "\n" in path or "\r" in path
        else f"{path}\n"
        for path in paths
    )
    replace_file(file, "".join(lines).encode("utf-8", "surrogateescape"))


def _backend_environment(
    system: Mapping[str, Any], python: str, trace: _Trace, *, wheels: bool = True
) -> Mapping[str, str]:
    """Return the environment of the backend, with the bundled setuptools if needed."""
    variables = {**os.environ, **trace.variables()}
    if system["build-backend"].startswith("setuptools.") or "backend-path" in system:
        trace.bundled = setuptools_path(python, trace.folder / "lent", wheels=wheels)
        if trace.bundled is not None:
            path = os.pathsep.join(filter(None, (str(trace.bundled), os.environ.get("PYTHONPATH"))))
            variables["PYTHONPATH"] = path
    return variables


def _run_backend(
    cmd: Sequence[str],
    cwd: str | None = None,
    extra_environ: Mapping[str, str] | None = None,
    *,
    trace: _Trace,
    environment: Mapping[str, str],
    prefix: str = "",
) -> None:
    """Run the backend with its output on stdout, since backends also write to stderr on success.

    Raises CalledProcessError after printing the reason to stderr.
    """
    note_start(environment)
    done = subprocess.run(
        trace.argv(cmd, prefix),
        cwd=cwd,
        env={**environment, **(extra_environ or {})},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        check=False,
    )
    trace.output += done.stdout
    if done.returncode and _NOT_UTF8 in done.stdout:
        raise_if_any(_non_utf8_names(Path(cwd or ".")), WorkspaceError)
    if done.returncode and _OF_ENTRY_POINT.search(done.stdout):
        raise_if_any(invalid_scripts_of_setup(Path(cwd or ".") / "setup.py"), WorkspaceError)
    progress, failure = done.stdout, ""
    if done.returncode:
        progress, failure = progress_and_failure(done.stdout, Path(cwd or ".") / "setup.py")
    print(progress, end="", flush=True)
    print(failure, end="", file=sys.stderr)
    done.check_returncode()


def _non_utf8_names(source: Path) -> Iterator[Problem]:
    """Yield a problem for each file whose name is not UTF-8, which a wheel cannot contain."""
    for path in source_files(str(source)):
        name = os.path.relpath(path, source)
        if not name.isascii() and name != name.encode(errors="replace").decode():
            hint = "rename it, or remove it from 'package_data' and 'data_files'"
            yield Problem(
                f"the file name {os.fsencode(name)!r} is not UTF-8, as wheels require", Location(source), hint
            )


def _build_system(source: Path) -> dict[str, Any]:
    """Return the build-system table of pyproject.toml, or the setuptools default."""
    path = source / "pyproject.toml"
    if not path.is_file():
        return dict(_SETUPTOOLS)
    table = read_toml(read_file(path), path).get("build-system", {})
    system = {**_SETUPTOOLS, **(table if isinstance(table, dict) else {"build-backend": None})}
    folders = system.get("backend-path", [])
    if not isinstance(system["build-backend"], str) or not isinstance(folders, list):
        hint = "'build-backend' must be a string, and 'backend-path' a list"
        raise WorkspaceError(Problem("invalid 'build-system' table", Location(path), hint))
    return system


DISK_FULL = re.compile(
    r"\[Errno (?:28|122)\]|: (?:No space left on device|Disk quota exceeded)$", re.MULTILINE
)
"""In the output of a failed backend: where it was writing is of no interest."""
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
"""What setuptools prints before an error."""
_CODE = r"(?:    .*\n)*"
_OUTER_FRAMES = re.compile(
    r"^(Traceback \(most recent call last\):\n)"
    rf'(?:  File "<string>", .*\n{_CODE}(?=  File ".*backend_tracer\.py"))?'
    rf'(?:  File ".*(?:backend_tracer|setup_install|_in_process|setuptools/build_meta)\.py", .*\n{_CODE})+'
    r'(?:  File "(?:<string>|setup\.py)", line (\d+), in <module>\n'
    rf"({_CODE})|(?=  File ))",
    re.MULTILINE,
)
"""The frames of forge and setuptools that start a backend, and that of setup.py, which may lack its name."""


def progress_and_failure(output: str, setup: Path) -> tuple[str, str]:
    """Return the progress messages of setuptools, and the remaining output of a failed backend.

    Tracebacks start in the package's setup.py, or in the backend, not in the code that starts it.
    """
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
