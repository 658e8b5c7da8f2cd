"""Run the build backend of a package, and shorten the output of a failure.

setuptools installs a package itself, as with colcon; other backends build a wheel (PEP 517).
"""

from __future__ import annotations

import errno
import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from forge.base.errors import HostError, Location, Problem, WorkspaceError
from forge.base.extensions import OPTIONS, find, is_installed
from forge.base.files import (
    delete_tree,
    listed_paths,
    read_file,
    replace_file,
    text_if_exists,
)
from forge.base.formats import read_toml
from forge.base.frozen import frozen
from forge.base.layout import PACKAGE, SCRATCH_DIR
from forge.base.options import flag, option
from forge.build.copies import is_folder
from forge.build.observed_writes import note_start, note_written
from forge.build.wheels import setup_install
from forge.toolchain.python_modules import install_command, setuptools_path

_SETUPTOOLS: dict[str, Any] = {"build-backend": "setuptools.build_meta:__legacy__", "requires": []}
_BACKENDS_OF_SETUPTOOLS = frozenset({"setuptools.build_meta", "setuptools.build_meta:__legacy__"})
INSTALL_LOG = "install.log"
"""The record of setuptools, in the same file as with colcon."""
TARGET_PYTHON = "/usr/bin/python3"
"""The interpreter in the first line of scripts for another platform."""
_SITECUSTOMIZE = """\
# For Python programs that a setup.py starts: as with colcon, sys.prefix is that of the package.
import os, sys
from importlib.machinery import PathFinder
from importlib.util import module_from_spec

if sys.executable == {python!r}:
    sys.real_prefix = sys.prefix
    sys.prefix = sys.exec_prefix = {prefix!r}
_folder = os.path.dirname(os.path.abspath(__file__))
sys.path[:] = [entry for entry in sys.path if os.path.abspath(entry) != _folder]
_next = PathFinder.find_spec("sitecustomize", sys.path)
if _next is not None and _next.loader is not None:
    _next.loader.exec_module(module_from_spec(_next))
"""
"""Python imports this at startup; the original sitecustomize module is run as well."""


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


def find_pitfalls() -> Any:
    """Return the plugin that detects mistakes in Python packages, None if it is not installed."""
    found = is_installed(OPTIONS, "python-pitfalls")
    return find(OPTIONS, "python-pitfalls", "option") if found else None


def uses_setuptools(source: Path) -> bool:
    """Return True if setuptools itself is the package's backend, as for each package that colcon builds."""
    system = build_system(source)
    return "backend-path" not in system and system["build-backend"] in _BACKENDS_OF_SETUPTOOLS


def run_setup_install(options: WheelInstall, scripts: str | None) -> tuple[tuple[Path, ...], str]:
    """Run `setup.py install` like colcon; return the installed files and the output.

    `scripts` is their folder, with setuptools' variables such as `$base`; None for setuptools' own folder.
    The options and command classes of the package have the same effect as with colcon, since the same
    commands run, with the real prefix.
    """
    source, build = options.source, options.build
    backend = Backend(build, options.python)
    log = build / INSTALL_LOG
    egg_base = os.path.relpath(os.path.realpath(build), os.path.realpath(source))
    words = ["egg_info", "--egg-base", egg_base, "build", "--build-base", str(build / "build")]
    words += ["--executable", TARGET_PYTHON] if options.target else []
    words += ["install", "--record", str(log), "--single-version-externally-managed"]
    words += ["--install-scripts", scripts] if scripts else []
    words += ["--force", "--no-compile"]
    children = backend.folder / "children"
    children.mkdir()
    text = _SITECUSTOMIZE.format(python=options.python, prefix=str(options.prefix))
    (children / "sitecustomize.py").write_text(text, encoding="utf-8")
    request = {
        "build": str(build / "build"),
        "children": str(children),
        "prefix": str(options.prefix),
        "site_packages": options.site_packages,
        "words": words,
        "pure": bool(options.target),
    }
    file = backend.folder / "request.json"
    file.write_text(json.dumps(request), "utf-8")
    argv = (options.python, setup_install.__file__, str(file))
    # With old versions, a wheel also needs the distribution 'wheel'.
    wheels = not (source / "setup.py").is_file()
    if wheels:
        backend.lend_setuptools(wheels=True)
    try:
        try:
            backend.run(argv, str(source))
        except subprocess.CalledProcessError as error:
            # Nearly all interpreters have setuptools; checking first would start another one per package.
            if wheels or error.returncode != setup_install.UNAVAILABLE:
                raise
            backend.lend_setuptools(wheels=False)
            backend.run(argv, str(source))
    except subprocess.CalledProcessError as error:
        if DISK_FULL.search(backend.output):
            raise full_disk(options.prefix) from None
        outside = text_if_exists(backend.folder / setup_install.OUTSIDE) or ""
        raise _setup_fault(error.returncode, outside, options) from None
    finally:
        delete_tree(backend.folder)
        # setuptools also lists folders: entries of `data_files` without files.
        paths, prefix = {*map(os.path.normpath, listed_paths(log))}, str(options.prefix)
        # A package may have resolved links.
        real = f"{os.path.realpath(prefix)}/"
        paths = {path.replace(real, f"{prefix}/", 1) if path.startswith(real) else path for path in paths}
        inside = (path for path in paths if path.startswith(f"{prefix}/"))
        installed = sorted(path for path in inside if os.path.lexists(path) and not is_folder(path))
        # Even after a failure, so that installed files are removed.
        for path in installed:
            note_written(path)
    if source.is_relative_to(PACKAGE):
        # The relative path from an embedded package to the build folder varies.
        for listing in filter(lambda path: path.name == "SOURCES.txt", map(Path, installed)):
            replace_file(listing, read_file(listing).replace(os.fsencode(f"{egg_base}/"), b""))
    return tuple(map(Path, installed)), backend.output


def _setup_fault(code: int, outside: str, options: WheelInstall) -> HostError | WorkspaceError:
    if outside:
        message = f"the package would install files into '{outside}', which is outside its prefix"
        hint = "check data_files, and the options of setuptools' install command, in its setup"
        return WorkspaceError(Problem(message, Location(options.source), hint))
    if code == setup_install.COMPILED:
        return compiled_modules(options.source, options.target)
    if code == setup_install.UNAVAILABLE:
        return unavailable_backend("setuptools.build_meta", options.python)
    message = "the package's build backend 'setuptools.build_meta' failed; see its output above"
    return HostError(Problem(message))


def compiled_modules(source: Path, target: str) -> WorkspaceError:
    """Return the error for a package with compiled modules, which cannot be built for another platform."""
    message = f"compiled modules cannot be built for '{target}'"
    hint = "build them with CMake in a separate package, or build this package on the target"
    return WorkspaceError(Problem(message, Location(source), hint))


def full_disk(folder: Path) -> OSError:
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(folder))


def unavailable_backend(backend: str, python: str) -> HostError:
    hint = f"install it there: {install_command(Path(python), (backend.split('.', maxsplit=1)[0],))}"
    message = f"the build backend '{backend}' is not installed for the interpreter '{python}'"
    return HostError(Problem(message, hint=hint))


class Backend:
    """Runs the build backend of a package; `output` is its output so far."""

    def __init__(self, build: Path, python: str) -> None:
        """Remove files of an earlier build; its modules and list of sources would end up in the wheel."""
        self.folder = build / SCRATCH_DIR / "backend"
        names = (build / name for name in ("wheel", "build", INSTALL_LOG))
        for path in (self.folder, *names, *build.glob("*.egg-info")):
            if path.is_dir() and not path.is_symlink():
                delete_tree(path)
            else:
                path.unlink(missing_ok=True)
        self.folder.mkdir(parents=True)
        # The variable keeps scikit-build-core out of the sources.
        self.environment = {**os.environ, "SKBUILD_BUILD_DIR": str(build / "build/cmake")}
        self.output = ""
        self._python = python

    def lend_setuptools(self, *, wheels: bool) -> None:
        """Let the backend find forge's setuptools if the interpreter has none that builds wheels."""
        if lent := setuptools_path(self._python, self.folder / "lent", wheels=wheels):
            path = os.pathsep.join(filter(None, (str(lent), os.environ.get("PYTHONPATH"))))
            self.environment["PYTHONPATH"] = path

    def run(
        self, cmd: Sequence[str], cwd: str | None = None, extra_environ: Mapping[str, str] | None = None
    ) -> None:
        """Run the backend with its output on stdout, since backends also write to stderr on success.

        Raises CalledProcessError after printing the reason to stderr.
        """
        note_start(self.environment)
        done = subprocess.run(
            cmd,
            cwd=cwd,
            env={**self.environment, **(extra_environ or {})},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            check=False,
        )
        self.output += done.stdout
        progress, failure = done.stdout, ""
        if done.returncode:
            pitfalls, source = find_pitfalls(), Path(cwd or ".")
            progress, failure = (
                pitfalls.progress_and_failure(done.stdout, source) if pitfalls else ("", done.stdout)
            )
        print(progress, end="", flush=True)
        print(failure, end="", file=sys.stderr)
        done.check_returncode()


def build_system(source: Path) -> dict[str, Any]:
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
