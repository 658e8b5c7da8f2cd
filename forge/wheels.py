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
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import installer
from installer.destinations import SchemeDictionaryDestination
from installer.exceptions import InstallerError
from installer.records import InvalidRecordEntry
from installer.sources import WheelFile

from forge.backends import build_wheel
from forge.errors import ForgeError, Place, Problem, WorkspaceError
from forge.files import listed_paths, read_text, replace_file
from forge.links import Wheel, link_to_sources
from forge.pitfalls import doubts, refuse_what_no_backend_reads

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import BinaryIO

    from installer.records import RecordEntry
    from installer.utils import Scheme

MANIFEST = "install_manifest.txt"


def main(argv: Sequence[str] | None = None) -> int:
    """Install one package; returns 0, or 2 after saying what the user must mend."""
    options = _parser().parse_args(argv)
    try:
        refuse_what_no_backend_reads(options.source)
        wheel, said = build_wheel(options.source, options.build, options.prefix, options.python)
        schemes = _schemes(options)
        installed = _unpack(wheel, options, schemes)
    except ForgeError as error:
        for problem in error.problems:
            print(problem.render(), file=sys.stderr)
        return 2
    if options.link:
        link_to_sources(Wheel(options.source, options.build, schemes, said), installed)
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
