"""Install a Python package into a prefix.

setuptools installs a package itself, with the commands that colcon runs. The plugin `pyproject` runs other
backends. Console scripts go to the folder in setup.cfg, commonly lib/<package>, where `ros2 run` finds them,
or to bin; modules go to the site-packages folder, data files to the paths in the package.
"""

from __future__ import annotations

import configparser
import contextlib
import errno
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from forge.base.errors import HostError, Location, Problem, WorkspaceError
from forge.base.extensions import BUILD_TYPES, OPTIONS, find, own_plugin
from forge.base.files import delete_tree, listed_paths, read_file, read_text, replace_file, text_if_exists
from forge.base.formats import read_toml
from forge.base.frozen import frozen
from forge.base.layout import PACKAGE, SCRATCH_DIR
from forge.base.options import flag, option
from forge.build.copies import discard, has_same_content, is_folder
from forge.build.inputs.fingerprints import source_files
from forge.build.observed_writes import note_start, note_written
from forge.build.wheels import setup_install
from forge.toolchain.python_modules import install_command, setuptools_path

MANIFEST = "install_manifest.txt"
_LONGEST_FIRST_LINE = 127
"""The kernel ignores everything beyond this length."""
_STARTED_BY_SHELL = b"""#!/bin/sh
'''exec' "%s" "$0" "$@"
' '''
%s"""
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


def install_wheel(options: WheelInstall) -> tuple[Problem, ...]:
    """Build and install a package; return warnings. Raises ForgeError."""
    if pitfalls := own_plugin(OPTIONS, "python-pitfalls"):
        pitfalls.refuse_what_no_backend_reads(options.source, Path(options.site_packages))
    if uses_setuptools(options.source):
        remove_links(options)
        installed, output = run_setup_install(options, _scripts_of_setup(options))
        _make_startable(installed, TARGET_PYTHON if options.target else options.python)
    else:
        backends = find(BUILD_TYPES, "python", "build type")
        installed, output = backends.install(options)
    if options.link:
        link_to_sources(options, output, installed)
    replace_file(options.build / MANIFEST, "".join(f"{path}\n" for path in sorted(installed)).encode())
    site = options.prefix / options.site_packages
    return tuple(pitfalls.wheel_warnings(options.source, site, installed)) if pitfalls else ()


def _make_startable(scripts: Sequence[Path], python: str) -> None:
    """Replace the first lines of scripts that the kernel cannot start: a path with blanks, or a long one."""
    usual = f"#!{python}".encode()
    if b" " not in usual and len(usual) < _LONGEST_FIRST_LINE:
        return
    for path in scripts:
        if os.access(path, os.X_OK) and not path.is_symlink():
            first, _, rest = read_file(path).partition(b"\n")
            if first in {usual, f'#!"{python}"'.encode(), f"#!{shlex.quote(python)}".encode()}:
                path.write_bytes(_STARTED_BY_SHELL % (python.encode(), rest))


def _scripts_of_setup(options: WheelInstall) -> str | None:
    """Return the script folder that colcon passes to setuptools, None for the default of setuptools.

    The default is `bin`, as for `ros2` itself, unless setup.py names another.
    """
    cfg = options.source / "setup.cfg"
    configured = setup_cfg_option(cfg, "develop", "script_dir") if options.link else ""
    configured = configured or setup_cfg_option(cfg, "install", "install_scripts")
    if configured or (options.source / "setup.py").is_file():
        return configured or None
    return f"$base/{options.scripts or f'lib/{options.package}'}"


def setup_cfg_option(path: Path, command: str, name: str) -> str:
    """Return an option of a setup.cfg, '' if it has none or is malformed."""
    parser = configparser.RawConfigParser()
    with contextlib.suppress(configparser.Error, OSError):
        parser.read_string(read_text(path))
    section = dict(parser[command]) if parser.has_section(command) else {}
    # After a parse error, values may still be lists of lines.
    return str(section.get(name) or section.get(name.replace("_", "-")) or "")


def remove_links(options: WheelInstall) -> None:
    """Remove the links of an earlier build, since writing through them would change the sources.

    The manifest of a copied build folder lists the files of the original workspace.
    """
    for path in map(Path, listed_paths(options.build / MANIFEST)):
        if path.is_relative_to(options.prefix) and path.is_symlink():
            path.unlink()


_COPYING = re.compile(r"^(?:hard linking|copying(?: and adjusting)?) (.+?) -> (.+)$", re.MULTILINE)
"""setuptools' messages about copies; the target is a folder, unless the file name changes."""
_MAX_COPY_CHAIN = 8
"""The maximum number of consecutive copies between a source and a file of the package."""


def link_to_sources(options: WheelInstall, output: str, installed: Iterable[Path]) -> None:
    """Replace each installed file by a symlink to the source file that it was copied from.

    If the backend does not report the source and several files match, the copy is kept.
    """
    sources: dict[str, list[Path]] = {}
    for path in map(Path, source_files(str(options.source))):
        sources.setdefault(path.name, []).append(path)
    origins: dict[str, str] = {}
    for source, target in _COPYING.findall(output):
        if " -> " not in target:
            origin = os.path.normpath(options.source / source)
            origins[os.path.normpath(options.source / target / os.path.basename(origin))] = origin  # noqa: PTH119
    start = f"{options.prefix}{os.sep}"
    copies = {Path(target): Path(_first(target, origins)) for target in origins if target.startswith(start)}
    for path in installed:
        if path.is_symlink():
            continue
        candidates = [
            source_file
            for source_file in sources.get(path.name, ())
            if source_file.is_file()
            # setuptools makes installed scripts executable even if their sources are not.
            and os.access(source_file, os.X_OK) >= os.access(path, os.X_OK)
            and has_same_content(source_file, path)
        ]
        original = _original(path, candidates, copies, options)
        if original is not None:
            path.unlink()
            path.symlink_to(original)


def _original(
    path: Path, candidates: list[Path], copies: Mapping[Path, Path], options: WheelInstall
) -> Path | None:
    """Return the source of a file among the `candidates` with the same name and content, or None."""
    if path in copies:
        return copies[path] if copies[path] in candidates else None
    site = options.prefix / options.site_packages
    if len(candidates) > 1 and path.is_relative_to(site):
        # A copy elsewhere, such as in build/lib, is a source as well.
        below = path.relative_to(site)
        usual = {options.source / below, options.source / "src" / below}
        candidates = [source_file for source_file in candidates if source_file in usual]
    is_metadata = path.parent.suffix in {".dist-info", ".egg-info"}
    return candidates[0] if len(candidates) == 1 and not is_metadata else None


def _first(path: str, made: Mapping[str, str]) -> str:
    for _ in range(_MAX_COPY_CHAIN):
        if path not in made:
            break
        path = made[path]
    return path


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
        if outside := text_if_exists(backend.folder / setup_install.OUTSIDE):
            message = f"the package would install files into '{outside}', which is outside its prefix"
            hint = "check data_files, and the options of setuptools' install command, in its setup"
            raise WorkspaceError(Problem(message, Location(source), hint)) from None
        if error.returncode == setup_install.COMPILED:
            raise compiled_modules(source, options.target) from None
        if error.returncode == setup_install.UNAVAILABLE:
            raise unavailable_backend("setuptools.build_meta", options.python) from None
        message = "the package's build backend 'setuptools.build_meta' failed; see its output above"
        raise HostError(Problem(message)) from None
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
            discard(path)
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
            progress, failure = "", done.stdout
            if pitfalls := own_plugin(OPTIONS, "python-pitfalls"):
                progress, failure = pitfalls.progress_and_failure(done.stdout, Path(cwd or "."))
        print(progress, end="", flush=True)
        print(failure, end="", file=sys.stderr)
        done.check_returncode()


def build_system(source: Path) -> dict[str, Any]:
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
