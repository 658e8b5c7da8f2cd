"""Install a Python package into a prefix.

setuptools installs a package itself, with the commands that colcon runs. Another backend (PEP 517) builds a
wheel in the workspace's interpreter, which the `installer` library unpacks. Console scripts go to the folder
in setup.cfg, commonly lib/<package>, where `ros2 run` finds them, or to bin; modules go to the site-packages
folder, data files to the paths in the package.
"""

from __future__ import annotations

import configparser
import contextlib
import csv
import os
import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import installer
from installer.destinations import SchemeDictionaryDestination
from installer.exceptions import InstallerError
from installer.records import InvalidRecordEntry, RecordEntry
from installer.sources import WheelFile

from forge.base.errors import Location, Problem, WorkspaceError
from forge.base.files import listed_paths, naming, read_file, read_text, replace_file
from forge.build.copies import has_same_content
from forge.build.inputs.fingerprints import source_files
from forge.build.observed_writes import note_written
from forge.build.wheels.backends import (
    TARGET_PYTHON,
    WheelInstall,
    build_wheel,
    compiled_modules,
    run_setup_install,
    uses_setuptools,
)
from forge.build.wheels.pitfalls import (
    ENTRY_POINTS,
    refuse_what_no_backend_reads,
    wheel_warnings,
    without_invalid_scripts,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from installer.utils import Scheme

MANIFEST = "install_manifest.txt"
_LONGEST_FIRST_LINE = 127
"""The kernel ignores everything beyond this length."""
_STARTED_BY_SHELL = b"""#!/bin/sh
'''exec' "%s" "$0" "$@"
' '''
%s"""


def install_wheel(options: WheelInstall) -> tuple[Problem, ...]:
    """Build and install a package; return warnings. Raises ForgeError."""
    refuse_what_no_backend_reads(options.source, Path(options.site_packages))
    if uses_setuptools(options.source):
        _remove_links(options.build / MANIFEST, options.prefix)
        installed, output = run_setup_install(options, _scripts_of_setup(options))
        _make_startable(installed, TARGET_PYTHON if options.target else options.python)
    else:
        installed, output = _install_wheel(options)
    if options.link:
        link_to_sources(options, output, installed)
    replace_file(options.build / MANIFEST, "".join(f"{path}\n" for path in sorted(installed)).encode())
    return tuple(wheel_warnings(options.source, options.prefix / options.site_packages, installed))


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
    site = options.prefix / options.site_packages
    schemes = {
        "purelib": str(site),
        "platlib": str(site),
        "scripts": str(options.prefix / _scripts_folder(options)),
        "data": str(options.prefix),
        "headers": str(options.prefix / "include" / options.package),
    }
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
        names = [line[0] for line in csv.reader(stream) if line]
    return tuple(Path(os.path.normpath(site / name)) for name in names), output


class _Wheel(WheelFile):
    """A wheel without entry points that programs cannot start; the library only has an assertion for them."""

    def read_dist_info(self, filename: str) -> str:
        text = super().read_dist_info(filename)
        return without_invalid_scripts(text) if filename == ENTRY_POINTS else text


class _Prefix(SchemeDictionaryDestination):
    """A destination that rejects paths outside its folders."""

    def write_to_fs(self, scheme: Scheme, path: str, stream: BinaryIO, is_executable: bool) -> RecordEntry:
        """Write a file of the wheel; raises WorkspaceError if it would leave its folder."""
        if Path(path).is_absolute() or ".." in Path(path).parts:
            message = f"the package would install '{path}', which is outside its prefix"
            raise WorkspaceError(Problem(message, hint="check data_files and entry points in its setup"))
        target = Path(self.scheme_dict[scheme]) / path
        note_written(str(target))
        with naming(target):
            return super().write_to_fs(scheme, path, stream, is_executable)


def _scripts_of_setup(options: WheelInstall) -> str | None:
    """Return the script folder that colcon passes to setuptools, None for the default of setuptools.

    The default is `bin`, as for `ros2` itself, unless setup.py names another.
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
    for path in map(Path, listed_paths(manifest)):
        if path.is_relative_to(prefix) and path.is_symlink():
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
