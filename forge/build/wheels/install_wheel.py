"""Build the wheel of a Python package and install it into a prefix.

The package's backend (PEP 517; setuptools for a setup.py) builds the wheel in the workspace's interpreter;
the `installer` library unpacks it. Console scripts go to the folder in setup.cfg, commonly lib/<package>,
where `ros2 run` finds them, or to bin; modules go to the site-packages folder, data files to the paths in the
package. Files of an earlier build that are no longer installed are removed.
"""

from __future__ import annotations

import configparser
import contextlib
import csv
import os
from pathlib import Path
from typing import TYPE_CHECKING

import installer
from installer.destinations import SchemeDictionaryDestination
from installer.exceptions import InstallerError
from installer.records import InvalidRecordEntry
from installer.sources import WheelFile

from forge.base.errors import Location, Problem, WorkspaceError
from forge.base.files import listed_paths, naming, read_text, replace_file
from forge.base.frozen import frozen
from forge.build.observed_writes import note_written
from forge.build.wheels.backends import build_wheel
from forge.build.wheels.entry_points import ENTRY_POINTS, without_invalid_scripts
from forge.build.wheels.links import Wheel, link_to_sources
from forge.build.wheels.pitfalls import refuse_what_no_backend_reads, wheel_warnings

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import BinaryIO

    from installer.records import RecordEntry
    from installer.utils import Scheme

MANIFEST = "install_manifest.txt"
TARGET_PYTHON = "/usr/bin/python3"
"""The interpreter in the first line of scripts for another platform."""


@frozen
class WheelInstall:
    """The parameters of an installation."""

    source: Path
    package: str
    build: Path
    prefix: Path
    python: str
    """The interpreter to build with and for."""
    site_packages: str
    """Relative to the prefix."""
    scripts: str | None = None
    """The script folder of a package without a setup.py, relative to the prefix; None for lib/PACKAGE."""
    link: bool = False
    """Symlink files to their sources instead of copying."""
    target: str = ""
    """The platform, '' for this machine."""


def install_wheel(options: WheelInstall) -> tuple[Problem, ...]:
    """Build and install a package; return warnings. Raises ForgeError."""
    refuse_what_no_backend_reads(options.source, Path(options.site_packages))
    wheel, output = build_wheel(options.source, options.build, options.prefix, options.python)
    schemes = _schemes(options)
    if options.target:
        _refuse_compiled(wheel, options)
    installed = _unpack(wheel, options, schemes)
    if options.link:
        link_to_sources(Wheel(options.source, options.build, schemes, output), installed)
    _remove_stale(options.build / MANIFEST, installed, options.prefix)
    return tuple(wheel_warnings(options.source, options.prefix / options.site_packages, installed))


def _refuse_compiled(wheel: Path, options: WheelInstall) -> None:
    """Raise WorkspaceError for a wheel with compiled modules, which are for this machine."""
    if not wheel.stem.endswith("-none-any"):
        message = f"compiled modules of '{options.package}' cannot be built for '{options.target}'"
        hint = "build them with CMake in a package of their own, or build this package on the target"
        raise WorkspaceError(Problem(message, Location(options.source), hint))


def _schemes(options: WheelInstall) -> dict[str, str]:
    """Return the target folders of a wheel's schemes."""
    site = str(options.prefix / options.site_packages)
    return {
        "purelib": site,
        "platlib": site,
        "scripts": str(options.prefix / _scripts_folder(options)),
        "data": str(options.prefix),
        "headers": str(options.prefix / "include" / options.package),
    }


def _unpack(wheel: Path, options: WheelInstall, schemes: dict[str, str]) -> tuple[Path, ...]:
    """Install the wheel's files into the prefix and return their paths."""
    site = options.prefix / options.site_packages
    with _Wheel.open(wheel) as source:
        _remove_links(options.build / MANIFEST)
        destination = _Prefix(
            schemes,
            interpreter=TARGET_PYTHON if options.target else options.python,
            script_kind="posix",
            overwrite_existing=True,
        )
        try:
            installer.install(source, destination, additional_metadata={"INSTALLER": b"forge\n"})
        except (InstallerError, InvalidRecordEntry) as error:
            message = f"the package's build backend produced an invalid wheel: {error}"
            hint = "check whether a file name contains a line break"
            raise WorkspaceError(Problem(message, Location(options.source), hint)) from None
        record = site / source.dist_info_dir / "RECORD"
    # CSV (PEP 376): a name may have line breaks.
    with record.open(encoding="utf-8", newline="") as stream:
        return tuple(Path(os.path.normpath(site / line[0])) for line in csv.reader(stream) if line)


class _Wheel(WheelFile):
    """A wheel without entry points that no program can start; the library has an assertion for them."""

    def read_dist_info(self, filename: str) -> str:
        """Return the text of a file of the metadata."""
        text = super().read_dist_info(filename)
        return without_invalid_scripts(text) if filename == ENTRY_POINTS else text


class _Prefix(SchemeDictionaryDestination):
    """A destination that rejects paths outside its folders."""

    def write_to_fs(self, scheme: Scheme, path: str, stream: BinaryIO, is_executable: bool) -> RecordEntry:  # noqa: FBT001  (installer's own signature)
        """Write a file of the wheel; raises WorkspaceError for one that would leave its folder."""
        if Path(path).is_absolute() or ".." in Path(path).parts:
            message = f"the package would install '{path}', which is outside its prefix"
            raise WorkspaceError(Problem(message, hint="check data_files and entry points in its setup"))
        target = Path(self.scheme_dict[scheme]) / path
        note_written(str(target))
        with naming(target):
            return super().write_to_fs(scheme, path, stream, is_executable)


def _scripts_folder(options: WheelInstall) -> str:
    """Return the script folder relative to the prefix; with a setup.py, it is that of setuptools.

    This is the folder in setup.cfg, or `bin` by default, as for `ros2` itself.
    """
    configured = _install_scripts(options.source / "setup.cfg")
    if configured:
        return configured
    if (options.source / "setup.py").is_file():
        return "bin"
    return options.scripts or f"lib/{options.package}"


def _install_scripts(path: Path) -> str | None:
    """Return install_scripts of a setup.cfg relative to the prefix, or None."""
    parser = configparser.RawConfigParser()
    with contextlib.suppress(configparser.Error, OSError):
        parser.read_string(read_text(path))
    section = dict(parser["install"]) if parser.has_section("install") else {}
    # After a parse error, values may still be lists of lines.
    value = str(section.get("install_scripts") or section.get("install-scripts") or "")
    base, _, folder = value.partition("/")
    if base not in {"$base", "$platbase"}:
        return None
    if ".." in Path(folder).parts or "\0" in folder:
        message = f"install_scripts is '{folder}', which is outside the prefix"
        raise WorkspaceError(Problem(message, Location(path), "use a folder such as '$base/lib/PACKAGE'"))
    return folder


def _remove_links(manifest: Path) -> None:
    """Remove the links of an earlier build, since writing through them would change the sources."""
    for path in _recorded(manifest):
        if path.is_symlink():
            path.unlink()


def _remove_stale(manifest: Path, installed: Sequence[Path], prefix: Path) -> None:
    """Remove files that are no longer installed, then record the installed files."""
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
