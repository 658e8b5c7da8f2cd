"""Install a Python package into a prefix.

setuptools installs a package itself, by the commands that colcon runs. Another backend (PEP 517) builds a
wheel in the workspace's interpreter, which the `installer` library unpacks. Console scripts go to the folder
in setup.cfg, commonly lib/<package>, where `ros2 run` finds them, or to bin; modules go to the site-packages
folder, data files to the paths in the package. Files of an earlier build that are no longer installed are
removed.
"""

from __future__ import annotations

import configparser
import contextlib
import csv
import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import installer
from installer.destinations import SchemeDictionaryDestination
from installer.exceptions import InstallerError
from installer.records import InvalidRecordEntry
from installer.sources import WheelFile

from forge.base.errors import Location, Problem, WorkspaceError
from forge.base.files import listed_paths, naming, read_file, read_text, replace_file
from forge.base.frozen import frozen
from forge.base.options import flag, option
from forge.build.observed_writes import note_written
from forge.build.wheels.backends import (
    SetupInstall,
    build_wheel,
    compiled_modules,
    run_setup_install,
    uses_setuptools,
)
from forge.build.wheels.links import Installed, link_to_sources
from forge.build.wheels.pitfalls import (
    ENTRY_POINTS,
    refuse_what_no_backend_reads,
    wheel_warnings,
    without_invalid_scripts,
)

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import BinaryIO

    from installer.records import RecordEntry
    from installer.utils import Scheme

MANIFEST = "install_manifest.txt"
TARGET_PYTHON = "/usr/bin/python3"
"""The interpreter in the first line of scripts for another platform."""
_LONGEST_FIRST_LINE = 127
"""The kernel ignores what is behind it."""
_STARTED_BY_SHELL = b"""#!/bin/sh
'''exec' "%s" "$0" "$@"
' '''
%s"""


@frozen
class WheelInstall:
    """The parameters of an installation."""

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
    refuse_what_no_backend_reads(options.source, Path(options.site_packages))
    if uses_setuptools(options.source):
        installed, output = _run_setup(options)
    else:
        installed, output = _install_wheel(options)
    if options.link:
        site = options.prefix / options.site_packages
        link_to_sources(Installed(options.source, options.prefix, site, output), installed)
    manifest = options.build / MANIFEST
    for path in sorted(set(_recorded(manifest)) - set(installed), reverse=True):
        if path.is_relative_to(options.prefix):
            path.unlink(missing_ok=True)
            for folder in path.parents:
                if folder == options.prefix or not _remove_empty(folder):
                    break
    replace_file(manifest, "".join(f"{path}\n" for path in sorted(installed)).encode())
    return tuple(wheel_warnings(options.source, options.prefix / options.site_packages, installed))


def _run_setup(options: WheelInstall) -> tuple[tuple[Path, ...], str]:
    """Let setuptools install the package; return the installed files and the output."""
    _remove_links(options.build / MANIFEST, options.prefix)
    executable = TARGET_PYTHON if options.target else ""
    setup = SetupInstall(
        options.source,
        options.build,
        options.prefix,
        options.python,
        options.site_packages,
        _scripts_of_setup(options),
        executable,
        options.target,
    )
    installed, output = run_setup_install(setup)
    _make_startable(installed, executable or options.python)
    return installed, output


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


def _install_wheel(options: WheelInstall) -> tuple[tuple[Path, ...], str]:
    """Build a wheel and unpack it; return the installed files and the backend's output."""
    wheel, output = build_wheel(options.source, options.build, options.prefix, options.python)
    if options.target and not wheel.stem.endswith("-none-any"):
        raise compiled_modules(options.source, options.target)
    site = str(options.prefix / options.site_packages)
    schemes = {
        "purelib": site,
        "platlib": site,
        "scripts": str(options.prefix / _scripts_folder(options)),
        "data": str(options.prefix),
        "headers": str(options.prefix / "include" / options.package),
    }
    return _unpack(wheel, options, schemes), output


def _unpack(wheel: Path, options: WheelInstall, schemes: dict[str, str]) -> tuple[Path, ...]:
    """Install the wheel's files into the prefix and return their paths."""
    site = options.prefix / options.site_packages
    with _Wheel.open(wheel) as source:
        _remove_links(options.build / MANIFEST, options.prefix)
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

    def write_to_fs(self, scheme: Scheme, path: str, stream: BinaryIO, is_executable: bool) -> RecordEntry:
        """Write a file of the wheel; raises WorkspaceError for one that would leave its folder."""
        if Path(path).is_absolute() or ".." in Path(path).parts:
            message = f"the package would install '{path}', which is outside its prefix"
            raise WorkspaceError(Problem(message, hint="check data_files and entry points in its setup"))
        target = Path(self.scheme_dict[scheme]) / path
        note_written(str(target))
        with naming(target):
            return super().write_to_fs(scheme, path, stream, is_executable)


def _scripts_of_setup(options: WheelInstall) -> str | None:
    """Return the script folder for setuptools as colcon passes it, None for that of setuptools.

    This is `bin`, as for `ros2` itself, unless setup.py contains another.
    """
    cfg = options.source / "setup.cfg"
    configured = _option(cfg, "develop", "script_dir") if options.link else ""
    configured = configured or _option(cfg, "install", "install_scripts")
    if configured or (options.source / "setup.py").is_file():
        return configured or None
    return f"$base/{options.scripts or f'lib/{options.package}'}"


def _scripts_folder(options: WheelInstall) -> str:
    """Return the folder of the scripts of a wheel, relative to the prefix."""
    path = options.source / "setup.cfg"
    base, _, folder = _option(path, "install", "install_scripts").partition("/")
    if base not in {"$base", "$platbase"}:
        return options.scripts or f"lib/{options.package}"
    if ".." in Path(folder).parts or "\0" in folder:
        message = f"install_scripts is '{folder}', which is outside the prefix"
        raise WorkspaceError(Problem(message, Location(path), "use a folder such as '$base/lib/PACKAGE'"))
    return folder


def _option(path: Path, command: str, name: str) -> str:
    """Return an option of a command in a setup.cfg, or ''."""
    parser = configparser.RawConfigParser()
    with contextlib.suppress(configparser.Error, OSError):
        parser.read_string(read_text(path))
    section = dict(parser[command]) if parser.has_section(command) else {}
    # After a parse error, values may still be lists of lines.
    return str(section.get(name) or section.get(name.replace("_", "-")) or "")


def _remove_links(manifest: Path, prefix: Path) -> None:
    """Remove the links of an earlier build, since writing through them would change the sources.

    The manifest of a copied build folder lists the files of the original workspace.
    """
    for path in _recorded(manifest):
        if path.is_relative_to(prefix) and path.is_symlink():
            path.unlink()


def _recorded(manifest: Path) -> tuple[Path, ...]:
    return tuple(map(Path, listed_paths(manifest)))


def _remove_empty(folder: Path) -> bool:
    try:
        folder.rmdir()
    except OSError:
        return False
    return True
