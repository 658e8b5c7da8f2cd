"""`python -m forge.wheels SOURCE ...`: build a Python package's wheel and unpack it into a prefix.

The package's own backend (PEP 517; setuptools for a setup.py) makes the wheel in the workspace's
interpreter, the `installer` library unpacks it: console scripts go where setup.cfg says, commonly to
lib/<package>, where `run` looks for them, or to bin, modules to the site-packages folder, data files to
where the package says.
What an earlier build installed and this one does not is removed.
"""

from __future__ import annotations

import argparse
import configparser
import contextlib
import csv
import os
import shutil
import subprocess
import sys
import warnings
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import installer
import pyproject_hooks
from installer.destinations import SchemeDictionaryDestination
from installer.exceptions import InstallerError
from installer.records import InvalidRecordEntry
from installer.sources import WheelFile

from forge.digests import source_files
from forge.errors import EnvironmentFault, ForgeError, Place, Problem, WorkspaceError, raise_if_any
from forge.files import listed_paths, read_file, read_text, replace_file
from forge.formats import read_toml
from forge.lending import lent_setuptools
from forge.links import Wheel, link_to_sources
from forge.pitfalls import doubts, refuse_what_no_backend_reads

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from typing import BinaryIO

    from installer.records import RecordEntry
    from installer.utils import Scheme

MANIFEST = "install_manifest.txt"
_SETUPTOOLS: dict[str, Any] = {"build-backend": "setuptools.build_meta:__legacy__", "requires": []}
_NOT_UTF8 = "surrogates not allowed"
"""What Python says of a name that is not UTF-8."""
_OURS = "setuptools.build_meta"


def main(argv: Sequence[str] | None = None) -> int:
    """Install one package; returns 0, or 2 after saying what the user must mend."""
    options = _parser().parse_args(argv)
    try:
        refuse_what_no_backend_reads(options.source)
        said: list[str] = []
        wheel = _build_wheel(options.source, options.build, options.python, said)
        schemes = _schemes(options)
        installed = _unpack(wheel, options, schemes)
    except ForgeError as error:
        for problem in error.problems:
            print(problem.render(), file=sys.stderr)
        return 2
    if options.link:
        link_to_sources(Wheel(options.source, options.build, schemes, "".join(said)), installed)
    _remove_stale(options.build / MANIFEST, installed, options.prefix)
    for problem in doubts(options.source, options.prefix / options.site_packages, installed):
        print(problem.render("warning"), file=sys.stderr)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m forge.wheels", description=__doc__)
    parser.add_argument("source", type=Path, metavar="SOURCE", help="the package's folder")
    parser.add_argument("--package", required=True, help="its name, for lib/<package>")
    parser.add_argument("--build", required=True, type=Path, metavar="DIR", help="where it is built")
    parser.add_argument("--prefix", required=True, type=Path, metavar="DIR", help="where it is installed")
    parser.add_argument(
        "--python", required=True, metavar="PATH", help="the interpreter to build with and for"
    )
    parser.add_argument("--site-packages", required=True, metavar="DIR", help="relative to the prefix")
    parser.add_argument(
        "--scripts",
        metavar="DIR",
        help="for a package without a setup.py, relative to the prefix (default: lib/PACKAGE)",
    )
    parser.add_argument("--link", action="store_true", help="link files to their sources instead of copying")
    return parser


def _build_wheel(source: Path, build: Path, python: str, said: list[str]) -> Path:
    """Return the wheel that the package's backend makes; nothing is written into the source folder.

    What the backend prints is added to `said`.
    """
    system = _build_system(source)
    backend, *_ = system["build-backend"].split(":")
    out = build / "wheel"
    for folder in (out, build / "build"):
        # A leftover module from an earlier build would end up in the wheel.
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
    settings = build / "distutils.cfg"
    settings.write_text(f"[egg_info]\negg_base = {build}\n[build]\nbuild_base = {build / 'build'}\n", "utf-8")
    os.environ["DIST_EXTRA_CONFIG"] = str(settings)
    caller = pyproject_hooks.BuildBackendHookCaller(
        str(source),
        system["build-backend"],
        backend_path=system.get("backend-path"),
        runner=partial(_run_backend, surroundings=_surroundings(system, python, build), said=said),
        python_executable=python,
    )
    try:
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            wheel = caller.build_wheel(str(out))
        for warning in warned:
            # pyproject_hooks repeats here what the backend was warned of.
            print(f"{warning.category.__name__}: {warning.message}")
        return out / wheel
    except pyproject_hooks.BackendUnavailable:
        hint = f"install it there: {python} -m pip install {backend.split('.')[0]}"
        raise EnvironmentFault(Problem(f"the interpreter '{python}' has no '{backend}'", hint=hint)) from None
    except subprocess.CalledProcessError:
        remedy = f"if it lacks 'bdist_wheel': {python} -m pip install -U setuptools"
        message = f"the package's build backend '{backend}' failed; its own message stands above"
        raise EnvironmentFault(Problem(message, hint=remedy if backend == _OURS else None)) from None


def _surroundings(system: Mapping[str, Any], python: str, build: Path) -> Mapping[str, str]:
    """Return the environment of the backend, with a setuptools where the interpreter lacks one."""
    if not (system["build-backend"].startswith("setuptools.") or "backend-path" in system):
        return os.environ
    lent = lent_setuptools(python, build / "lent")
    if lent is None:
        return os.environ
    path = os.pathsep.join(filter(None, (str(lent), os.environ.get("PYTHONPATH"))))
    return {**os.environ, "PYTHONPATH": path}


def _run_backend(
    cmd: Sequence[str],
    cwd: str | None = None,
    extra_environ: Mapping[str, str] | None = None,
    *,
    surroundings: Mapping[str, str],
    said: list[str],
) -> None:
    """Run the backend; what it says goes to stdout, since backends chatter on stderr when all is well.

    Raises CalledProcessError after its words went to stderr.
    """
    done = subprocess.run(
        cmd,
        cwd=cwd,
        env={**surroundings, **(extra_environ or {})},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        check=False,
    )
    said.append(done.stdout)
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


def _schemes(options: argparse.Namespace) -> dict[str, str]:
    """Return where the parts of a wheel go, by wheel's names for them."""
    site = str(options.prefix / options.site_packages)
    return {
        "purelib": site,
        "platlib": site,
        "scripts": str(options.prefix / _scripts_folder(options)),
        "data": str(options.prefix),
        "headers": str(options.prefix / "include" / options.package),
    }


def _unpack(wheel: Path, options: argparse.Namespace, schemes: dict[str, str]) -> tuple[Path, ...]:
    """Install the wheel's files into the prefix and return their paths."""
    site = options.prefix / options.site_packages
    with WheelFile.open(wheel) as source:
        _remove_links(options.build / MANIFEST)
        destination = _Prefix(
            schemes, interpreter=options.python, script_kind="posix", overwrite_existing=True
        )
        try:
            installer.install(source, destination, additional_metadata={"INSTALLER": b"forge\n"})
        except (InstallerError, InvalidRecordEntry) as error:
            message = f"the wheel that the package's build backend made is not valid: {error}"
            hint = "is there a sign in the name of a file that divides lines?"
            raise WorkspaceError(Problem(message, Place(options.source), hint)) from None
        record = site / source.dist_info_dir / "RECORD"
    # CSV (PEP 376): a name may have line breaks.
    with record.open(encoding="utf-8", newline="") as stream:
        return tuple(Path(os.path.normpath(site / line[0])) for line in csv.reader(stream) if line)


class _Prefix(SchemeDictionaryDestination):
    """Writes nothing outside of its folders, whatever paths and names of programs a wheel has."""

    def write_to_fs(self, scheme: Scheme, path: str, stream: BinaryIO, is_executable: bool) -> RecordEntry:  # noqa: FBT001  (installer's own signature)
        """Write a file of the wheel; raises WorkspaceError for one that would leave its folder."""
        if Path(path).is_absolute() or ".." in Path(path).parts:
            message = f"the package would install '{path}', which is outside of its prefix"
            raise WorkspaceError(Problem(message, hint="look at data_files and entry points in its setup"))
        return super().write_to_fs(scheme, path, stream, is_executable)


def _scripts_folder(options: argparse.Namespace) -> str:
    """Return where programs go, relative to the prefix; as setuptools has it where there is a setup.py.

    Its setup.cfg may name a folder, and `bin` is where the others go: `ros2` itself is such a program.
    """
    said = _install_scripts(options.source / "setup.cfg")
    if said:
        return said
    if (options.source / "setup.py").is_file():
        return "bin"
    return options.scripts or f"lib/{options.package}"


def _install_scripts(path: Path) -> str | None:
    """Return the folder below the prefix that a setup.cfg names for programs, if it names one."""
    parser = configparser.RawConfigParser()
    with contextlib.suppress(configparser.Error, OSError):
        parser.read_string(read_text(path))
    section = dict(parser["install"]) if parser.has_section("install") else {}
    # In a file with a mistake, values may be lists of lines still.
    said = str(section.get("install_scripts") or section.get("install-scripts") or "")
    base, _, folder = said.partition("/")
    if base not in {"$base", "$platbase"}:
        return None
    if ".." in Path(folder).parts or "\0" in folder:
        message = f"programs cannot go to '{folder}', which is outside of the prefix"
        raise WorkspaceError(Problem(message, Place(path), "name a folder below it, as '$base/lib/PACKAGE'"))
    return folder


def _remove_links(manifest: Path) -> None:
    """Remove the links of an earlier build: to write through them would change the sources."""
    for path in _recorded(manifest):
        if path.is_symlink():
            path.unlink()


def _remove_stale(manifest: Path, installed: Sequence[Path], prefix: Path) -> None:
    """Remove what the last build installed and this one did not, then remember this one's files."""
    for path in sorted(set(_recorded(manifest)) - set(installed), reverse=True):
        if path.is_relative_to(prefix):
            path.unlink(missing_ok=True)
            for folder in path.parents:
                if folder == prefix or not _remove_empty(folder):
                    break
    replace_file(manifest, "".join(f"{path}\n" for path in sorted(installed)).encode())


def _recorded(manifest: Path) -> tuple[Path, ...]:
    return tuple(map(Path, listed_paths(manifest)))


def _remove_empty(folder: Path) -> bool:
    try:
        folder.rmdir()
    except OSError:
        return False
    return True


if __name__ == "__main__":
    sys.exit(main())
