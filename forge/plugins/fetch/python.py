"""The Python modules that locked packages and the workspace's own packages need, pinned by the lock.

There are two environments, since the underlay outlives every workspace: programs of ROS name the interpreter
that they start with, which must not be that of a workspace, because workspaces are removed. `UNDERLAY/venv`
has the modules with which ROS is built and runs; `.venv` in the workspace has those and the modules that its
own packages need. Slow modules are imported inside functions, since each build of a workspace with a lock
imports this module.
"""

from __future__ import annotations

import configparser
import csv
import errno
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from forge.base.errors import HostError, Location, Problem, WorkspaceError, print_warnings
from forge.base.files import DRAFT, delete_tree, remove_tree, replace_file, text_or_nothing
from forge.base.formats import read_toml
from forge.base.text import counted, listed
from forge.plugins.fetch.lock import Lock, Module
from forge.plugins.fetch.sources import only_download
from forge.toolchain.interpreter import ENVIRONMENT_FOLDER, Interpreter, ask_python
from forge.workspace.model import Package
from forge.workspace.python_metadata import read_pyproject, read_setup_cfg, read_setup_py

REQUIREMENTS = {
    "python3-argcomplete": "argcomplete",
    "python3-catkin-pkg": "catkin-pkg",
    "python3-catkin-pkg-modules": "catkin-pkg",
    "python3-empy": "empy==3.3.4",  # the generators of Humble and Jazzy do not support empy 4
    "python3-importlib-metadata": "importlib-metadata",
    "python3-importlib-resources": "importlib-resources",
    "python3-lark-parser": "lark",
    "python3-lxml": "lxml",
    "python3-netifaces": "netifaces",
    "python3-numpy": "numpy",
    "python3-packaging": "packaging",
    "python3-pkg-resources": "setuptools<80",
    "python3-psutil": "psutil",
    "python3-pytest": "pytest<9",  # launch_testing of Humble to Kilted does not support pytest 9
    "python3-pydot": "pydot",
    "python3-rosdistro-modules": "rosdistro",
    "python3-setuptools": "setuptools<80",  # Humble's packages do not support setuptools 80
    "python3-typeguard": "typeguard",
    "python3-vcstool": "vcs2l",  # the maintained fork
    "python3-yaml": "PyYAML",
}
"""The distributions on PyPI for rosdep's keys."""

_PROGRAMS = {"python3-pydot": ("dot", "graphviz")}
"""Programs that modules from PyPI start, and the system packages that contain them."""

_HEADERS = frozenset({"python-dev", "python3-dev"})
"""Keys of rosdep that name no modules, although they look like it."""

_STAMP = "forge-modules.txt"
"""The file in an environment that records the installed modules, or the current operation."""
_CREATING = "# forge makes this environment\n"
_MADE = "# forge made this environment\n"
_INSTALLING = "# forge installs modules\n"
_Versions = dict[str, tuple[str, tuple[str, ...]]]
"""Version and hashes by name."""
_NETWORK_HINT = "check the network, and the settings of pip or uv"
_DRAWN = " \u00d7│╰├─▶"
_PINNED = re.compile(r"^([A-Za-z0-9._-]+)==(\S+)")
_HASH = re.compile(r"--hash=(sha256:[0-9a-f]{64})")
_LISTED_FILE = re.compile(r'href="[^"]*?([^"/#]+)#(sha256)=([0-9a-f]{64})')
_INDEX_SETTING = re.compile(r"^(?:global|install|download|:env:)\.(index-url|no-index)='(.*)'$", re.MULTILINE)
_ENSURE_PIP = """\
import sys
from importlib.util import find_spec
if sys.prefix != sys.base_prefix and not find_spec("pip"):
    from subprocess import DEVNULL, call
    call([sys.executable, "-m", "ensurepip", "--default-pip"], stdout=DEVNULL, stderr=DEVNULL)
"""
_VERSIONS = """\
import sys
from importlib.metadata import PackageNotFoundError, version
for name in sys.argv[1:]:
    try: print(name, version(name))
    except PackageNotFoundError: pass
"""


def missing_programs(keys: Mapping[str, Sequence[str]], variables: Mapping[str, str]) -> Iterator[Problem]:
    """Yield the programs missing for modules; `keys` maps rosdep keys to the packages that need them."""
    for key in sorted(keys.keys() & _PROGRAMS.keys()):
        program, package = _PROGRAMS[key]
        if not shutil.which(program, path=variables.get("PATH")):
            hint = f"install it, for example with `apt install {package}`"
            yield Problem(f"{listed(keys[key])} needs the program '{program}' to run", hint=hint)


def is_system_module(key: str) -> bool:
    """Return whether a key of rosdep names Python modules that only the system's package manager provides."""
    return key.startswith(("python3-", "python-")) and key not in REQUIREMENTS.keys() | _HEADERS


def declared_requirements(packages: Iterable[Package], provided: Collection[str]) -> tuple[str, ...]:
    """Return the PyPI requirements of Python projects, except for names that are `provided`.

    setup.py is not run: only literals count. 'setuptools' alone, which every template names, is needed only
    for builds, where forge provides it.
    """
    from packaging.requirements import Requirement
    from packaging.utils import canonicalize_name

    others = {canonicalize_name(name) for name in provided}
    requirements = set()
    for package, text in ((each, text) for each in packages for text in _texts(each.path)):
        if not is_requirement(text):
            continue  # the build reports it
        requirement = Requirement(text)
        if requirement.url:
            message = f"'{package.name}' requires '{text}': forge cannot pin URLs"
            hint = f"install it in '{ENVIRONMENT_FOLDER}'"
            print_warnings([Problem(message, Location(package.path), hint)])
        elif canonicalize_name(requirement.name) not in others and str(requirement) != "setuptools":
            requirements.add(str(requirement))
    return tuple(sorted(requirements))


def is_requirement(text: str) -> bool:
    """Return whether a text is a requirement of a Python project (PEP 508)."""
    from packaging.requirements import InvalidRequirement, Requirement

    try:
        Requirement(text)
    except InvalidRequirement:
        return False
    return True


def _texts(folder: Path) -> Iterator[str]:
    for name in ("pyproject.toml", "setup.cfg", "setup.py"):
        if text := text_or_nothing(folder / name):
            with suppress(SyntaxError, configparser.Error):
                if name == "pyproject.toml":
                    metadata = read_pyproject(read_toml(text.encode(), folder / name))
                else:
                    metadata = (read_setup_cfg if name == "setup.cfg" else read_setup_py)(text)
                yield from metadata.requirements if metadata else ()


def lock_modules(
    ros: Collection[str],
    wanted: Collection[str],
    pinned: Sequence[Module],
    python: Path,
    cache: Path,
    *,
    offline: bool,
) -> tuple[Module, ...]:
    """Return versions that fulfil the requirements of ROS and all others, if possible those of `pinned`.

    Raises HostError if there are none, or the index cannot be reached.
    """
    if not wanted:
        return ()
    installer = _Installer(python, cache, offline=offline)
    of_ros = installer.resolve(ros, pinned)
    modules = of_ros if set(wanted) == set(ros) else installer.resolve(wanted, pinned)
    return tuple(
        Module(name, version, hashes, name in of_ros) for name, (version, hashes) in sorted(modules.items())
    )


def sees_system(lock: Lock, underlays: Sequence[Path]) -> bool:
    """Return whether modules of the system must be visible.

    Those of an installed ROS distribution, or of keys without a PyPI distribution.
    """
    served = dict(lock.pip)
    return bool(underlays) or any(is_system_module(key) and key not in served for key in lock.keys)


def compiled_against(lock: Lock) -> tuple[str, ...]:
    """Return the modules whose headers ROS is compiled with, and the relevant parts of their versions."""
    return tuple(
        f"{each.name} {each.version.partition('.')[0]}" for each in lock.modules if each.name == "numpy"
    )


def prepare_workspace(
    root: Path, lock: Lock, interpreter: Interpreter, cache: Path, underlays: Sequence[Path]
) -> None:
    """Create the environment of the workspace and install the lock's modules, unless this was done before."""
    environment = workspace_environment(root, interpreter) if lock.modules else None
    if environment and not _has_modules(environment, lock.modules):
        with only_download(cache):
            make_environment(environment, interpreter.path, system=sees_system(lock, underlays))
            install_modules(environment, lock.modules, cache)


def prepare_interpreter(underlay: Path, lock: Lock, python: Path, cache: Path) -> str:
    """Return an interpreter with the modules that the locked packages need, in the underlay.

    Other workspaces may have locked other versions: the last built workspace determines them.
    """
    modules = [each for each in lock.modules if each.ros]
    if not modules:
        return str(python)
    environment = underlay / "venv"
    # Always with the modules of the system: to add them for a later lock would build all packages again.
    make_environment(environment, python.resolve(), system=True)
    install_modules(environment, modules, cache)
    return str(environment / "bin/python3")


def workspace_environment(root: Path, interpreter: Interpreter) -> Path | None:
    """Return the folder of the workspace's environment, None if the user has chosen another interpreter."""
    folder = root / ENVIRONMENT_FOLDER
    is_other = interpreter.chosen and interpreter.path.parent != folder / "bin"
    return None if is_other else folder


def make_environment(folder: Path, python: Path, *, system: bool) -> None:
    """Create a virtual environment unless it exists and works; `system` makes system modules visible in it.

    An existing environment keeps its interpreter and its modules, and one that forge did not make also its
    settings. Raises HostError if the latter does not work.
    """
    own, stamp = folder / "bin/python3", folder / _STAMP
    if own.exists() and text_or_nothing(stamp) != _CREATING:
        settings = text_or_nothing(folder / "pyvenv.cfg")
        visible = settings.replace("system-site-packages = false", "system-site-packages = true")
        if system and visible != settings and stamp.exists():
            replace_file(folder / "pyvenv.cfg", visible.encode())
        return
    python = python.resolve() if python.is_relative_to(folder) else python
    if os.path.lexists(folder) and not stamp.exists() and (folder.is_file() or any(folder.iterdir())):
        message = f"'{folder}' is not a working Python environment, and was not created by forge"
        raise HostError(Problem(message, hint="move it away, or activate another environment"))
    if folder.exists():
        delete_tree(folder)  # the interpreter was removed, or forge was killed in between
    folder.mkdir(parents=True, exist_ok=True)
    replace_file(stamp, _CREATING.encode())
    if uv := shutil.which("uv"):
        command = [uv, "venv", "--quiet", "--allow-existing", "--python", str(python)]
    else:
        command = [str(python), "-m", "venv"]
    hint = "install uv, or the module venv of Python, for example with `apt install python3-venv`"
    _run([*command, *(["--system-site-packages"] if system else []), str(folder)], "make", folder, hint)
    # Omit the command that created the environment: it differs for each workspace and would prevent cache
    # hits.
    lines = text_or_nothing(folder / "pyvenv.cfg").splitlines(keepends=True)
    config = "".join(line for line in lines if not line.startswith("command ="))
    replace_file(folder / "pyvenv.cfg", config.encode())
    replace_file(folder / ".gitignore", b"*\n")
    replace_file(stamp, _MADE.encode())


def install_modules(folder: Path, modules: Sequence[Module], cache: Path, *, offline: bool = False) -> None:
    """Install exactly these versions in an environment, unless already installed; raises HostError."""
    if _has_modules(folder, modules):
        return
    python, text = folder / "bin/python3", requirements_text(modules)
    print(f"installing {counted(len(modules), 'Python module')} in '{folder}'", file=sys.stderr, flush=True)
    if text_or_nothing(folder / _STAMP) == _INSTALLING:
        _remove_remains(folder, {each.name for each in modules})
    names = {each.name for each in modules}
    others = [line for line in _installed(folder) if line.partition("==")[0] not in names]
    replace_file(folder / _STAMP, _INSTALLING.encode())
    _Installer(python, cache, offline=offline).install(text)
    lines = sorted([*others, *text.splitlines()])
    replace_file(folder / _STAMP, "\n".join((_origin(folder), *lines, "")).encode())


def _remove_remains(folder: Path, names: Collection[str]) -> None:
    """Remove all versions of these modules from an environment in which an installer was killed.

    An installer itself only replaces versions that were installed completely, and else leaves two of them.
    """
    from packaging.utils import canonicalize_name

    for place in folder.glob("lib/python*/site-packages"):
        for path in place.glob("~*"):  # pip moves what it replaces there: all but the first letters stay
            name_tail = canonicalize_name(path.name.lstrip("~").partition("-")[0])
            if any(name.endswith(name_tail) for name in names):
                remove_tree(str(path))
        for path in place.glob("*.dist-info"):
            if canonicalize_name(path.name.partition("-")[0]) in names:
                for row in filter(None, csv.reader(text_or_nothing(path / "RECORD").splitlines())):
                    file = Path(os.path.normpath(place / row[0]))
                    if file.is_relative_to(folder):
                        with suppress(OSError):
                            file.unlink()
                remove_tree(str(path))


def _has_modules(folder: Path, modules: Sequence[Module]) -> bool:
    """Return whether an environment has these modules, perhaps among those that other workspaces need."""
    return bool(modules) and {*requirements_text(modules).splitlines()} <= {*_installed(folder)}


def _installed(folder: Path) -> tuple[str, ...]:
    """Return the lines of a requirements.txt of all modules that forge installed, none after a kill."""
    origin, *lines = text_or_nothing(folder / _STAMP).splitlines() or [""]
    return tuple(lines) if origin == _origin(folder) else ()


def _origin(folder: Path) -> str:
    """Return a line that changes when an environment gets another interpreter, or is moved."""
    return f"# {(folder / 'bin/python3').resolve()} in {folder.absolute()}"


def add_modules(
    interpreter: Interpreter, modules: Sequence[Module], cache: Path, *, offline: bool
) -> Iterator[Problem]:
    """Install the modules missing from an environment of the user; yield mismatches with the lock.

    Existing modules keep their versions; nothing is installed for an interpreter outside of an environment.
    """
    names = [each.name for each in modules]
    lines = ask_python(interpreter.path, _VERSIONS, *names).splitlines()
    installed = dict(line.split(" ", 1) for line in lines)
    missing = [each for each in modules if each.name not in installed]
    folder = interpreter.path.parent.parent
    if missing and (folder / "pyvenv.cfg").is_file():
        print(f"installing {counted(len(missing), 'Python module')} in '{folder}'", file=sys.stderr)
        _Installer(interpreter.path, cache, offline=offline).install(requirements_text(missing))
        missing = []
    if missing:
        hint = "install them, or use a virtual environment, where 'forge fetch' installs them"
        words = " ".join(f"{each.name}=={each.version}" for each in missing)
        yield Problem(f"'{interpreter.path}' lacks {words}", hint=hint)
    for each in modules:
        if (version := installed.get(each.name, each.version)) != each.version:
            yield Problem(f"'{interpreter.path}' has {each.name} {version}, not {each.version} of the lock")


def requirements_text(modules: Iterable[Module]) -> str:
    """Return a requirements.txt with versions and hashes."""
    return "".join(
        " ".join((f"{each.name}=={each.version}", *(f"--hash={value}" for value in each.hashes))) + "\n"
        for each in modules
    )


class _Installer:
    """uv if it is installed, else the pip of the environment."""

    def __init__(self, python: Path, cache: Path, *, offline: bool) -> None:
        self._python, self._files, self._offline = str(python), cache / "modules", offline
        self._uv = shutil.which("uv")
        if not self._uv:
            # uv creates environments without pip.
            ask_python(python, _ENSURE_PIP)

    def resolve(self, requirements: Collection[str], pinned: Sequence[Module]) -> _Versions:
        """Return the versions of the requirements and their dependencies."""
        if not requirements:
            return {}
        with tempfile.TemporaryDirectory() as folder:
            wanted, constraints = Path(folder, "requirements.txt"), Path(folder, "constraints.txt")
            wanted.write_text("".join(f"{each}\n" for each in sorted(requirements)))
            constraints.write_text("".join(f"{each.name}=={each.version}\n" for each in pinned))
            resolve = self._resolve_by_uv if self._uv else self._resolve_by_pip
            if pinned:
                with suppress(HostError):  # the requirements have changed
                    return resolve(wanted, constraints, pinned)
            constraints.write_text("")
            return resolve(wanted, constraints, ())

    def install(self, text: str) -> None:
        """Install a requirements.txt, for `forge build` without network if possible."""
        with tempfile.NamedTemporaryFile("w", suffix=".txt") as file:
            file.write(text)
            file.flush()
            words = ["install", "--quiet", "--no-deps", "--require-hashes", "--requirement", file.name]
            if self._uv:
                command, offline = [self._uv, "pip", *words, "--python", self._python], "--offline"
            else:
                self._files.mkdir(parents=True, exist_ok=True)
                command = [self._python, "-m", "pip", "--no-input", *words, "--no-compile"]
                offline = "--no-index"
                command += ["--find-links", str(self._files)]
            try:
                self._run([*command, offline], "install")
            except HostError:
                if self._offline:
                    raise
                self._run(command, "install")

    def _run(self, command: Sequence[str], verb: str) -> str:
        hint = "run 'forge fetch' with network access" if self._offline else _NETWORK_HINT
        return _run(command, f"{verb} Python modules for", self._python, hint)

    def _resolve_by_uv(self, wanted: Path, constraints: Path, _pinned: Sequence[Module]) -> _Versions:
        from packaging.utils import canonicalize_name

        words = [str(self._uv), "pip", "compile", str(wanted), "--constraint", str(constraints)]
        words += ["--python", self._python, "--generate-hashes", "--no-header", "--no-annotate", "--quiet"]
        words += ["--offline"] if self._offline else []
        output = self._run(words, "find")
        modules: _Versions = {}
        for entry in output.replace("\\\n", " ").splitlines():
            if match := _PINNED.match(entry):
                modules[canonicalize_name(match[1])] = match[2], tuple(sorted(set(_HASH.findall(entry))))
        return modules

    def _resolve_by_pip(self, wanted: Path, constraints: Path, pinned: Sequence[Module]) -> _Versions:
        """Download the files for this machine, and get the hashes of other files from the index."""
        self._files.mkdir(parents=True, exist_ok=True)
        pinned_hashes = {(each.name, each.version): each.hashes for each in pinned}
        modules = {}
        with tempfile.TemporaryDirectory(DRAFT, ".", self._files) as draft:
            words = [self._python, "-m", "pip", "--no-input", "download", "--quiet", "--dest", draft]
            words += ["--requirement", str(wanted), "--constraint", str(constraints)]
            words += ["--find-links", str(self._files), *(["--no-index"] if self._offline else [])]
            self._run(words, "find")
            index = "" if self._offline else self._index()
            for path in sorted(Path(draft).iterdir()):
                name, version = _name_and_version(path.name)
                own = f"sha256:{hashlib.sha256(path.read_bytes()).hexdigest()}"
                hashes = set(pinned_hashes.get((name, version), ()))
                if hashes and own not in hashes:
                    hint = f"if this is expected: forge fetch --update {name}"
                    raise WorkspaceError(Problem(f"'{path.name}' does not match the lock", hint=hint))
                modules[name] = version, tuple(sorted(hashes or {own, *_published(index, name, version)}))
                path.replace(self._files / path.name)
        return modules

    def _index(self) -> str:
        """Return the URL of the index that pip uses, '' if there is none."""
        output = _run([self._python, "-m", "pip", "config", "list"], "ask", self._python, None)
        settings = dict(_INDEX_SETTING.findall(output))
        if settings.get("no-index", "").lower() in {"1", "true", "yes", "on"}:
            return ""
        return str(settings.get("index-url", "https://pypi.org/simple"))


def _published(index: str, name: str, version: str) -> set[str]:
    """Return the hashes of all files of a version in an index (PEP 503); empty if it is unavailable."""
    import urllib.parse
    import urllib.request

    hashes: set[str] = set()
    if index:
        with suppress(OSError, ValueError):
            with urllib.request.urlopen(f"{index.rstrip('/')}/{name}/", timeout=30) as answer:  # noqa: S310
                text = answer.read().decode("utf-8", "replace")
            for file, algorithm, value in _LISTED_FILE.findall(text):
                with suppress(ValueError):
                    if _name_and_version(urllib.parse.unquote(file)) == (name, version):
                        hashes.add(f"{algorithm}:{value}")
    return hashes


def _name_and_version(file: str) -> tuple[str, str]:
    """Return name and version in the name of a wheel or source archive; raises ValueError."""
    from packaging.utils import parse_sdist_filename, parse_wheel_filename

    parsed = parse_wheel_filename(file)[:2] if file.endswith(".whl") else parse_sdist_filename(file)
    return str(parsed[0]), str(parsed[1])


def _run(command: Sequence[str], purpose: str, place: str | Path, hint: str | None) -> str:
    """Run an installer without the modules of ROS; return its output, and raise HostError if it fails."""
    variables = {
        name: value for name, value in os.environ.items() if name not in {"PYTHONPATH", "PYTHONHOME"}
    }
    result = subprocess.run(
        command, env=variables, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )
    if result.returncode:
        lines = [line for line in (result.stderr or result.stdout).splitlines() if line.strip()]
        errors = [line for line in lines if line.startswith("ERROR: ")]  # pip reports the reason at the end
        reason = errors[-1] if errors else " ".join(line.strip(_DRAWN) for line in lines)
        if "No module named pip" in reason:
            hint = "install uv, or pip for this interpreter"
        if os.strerror(errno.ENOSPC) in result.stderr:
            reason, hint = os.strerror(errno.ENOSPC), "free some space, and run 'forge fetch' again"
        reason = re.sub("^error: ", "", reason, flags=re.IGNORECASE) or f"exit code {result.returncode}"
        raise HostError(Problem(f"cannot {purpose} '{place}': {reason}", hint=hint))
    return result.stdout
