"""Build a wheel with the backend of a package (PEP 517), and install it with the library `installer`."""

from __future__ import annotations

import csv
import os
import subprocess
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import installer
import pyproject_hooks
from installer.destinations import SchemeDictionaryDestination
from installer.exceptions import InstallerError
from installer.records import InvalidRecordEntry, RecordEntry
from installer.sources import WheelFile

from forge.base.errors import HostError, Location, Problem, WorkspaceError
from forge.base.files import delete_tree, naming
from forge.build.observed_writes import note_written
from forge.build.wheels.install_wheel import (
    DISK_FULL,
    TARGET_PYTHON,
    Backend,
    WheelInstall,
    build_system,
    compiled_modules,
    full_disk,
    remove_links,
    setup_cfg_option,
    unavailable_backend,
)
from forge.plugins.pyproject.pitfalls import ENTRY_POINTS, without_invalid_scripts

if TYPE_CHECKING:
    from installer.utils import Scheme

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


def install(options: WheelInstall) -> tuple[tuple[Path, ...], str]:
    """Build a wheel and unpack it; return the installed files and the backend's output."""
    wheel, output = _build_wheel(options.source, options.build, options.python)
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
        remove_links(options)
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


def _build_wheel(source: Path, build: Path, python: str) -> tuple[Path, str]:
    """Build the wheel without writing into the source folder; return its path and the backend's output."""
    system = build_system(source)
    backend, *_ = system["build-backend"].split(":")
    runner = Backend(build, python)
    if backend.startswith("setuptools.") or "backend-path" in system:
        runner.lend_setuptools(wheels=True)
    out = build / "wheel"
    out.mkdir()
    settings = build / "distutils.cfg"
    settings.write_text(_SETTINGS.format(build=build), "utf-8")
    os.environ["DIST_EXTRA_CONFIG"] = runner.environment["DIST_EXTRA_CONFIG"] = str(settings)
    caller = pyproject_hooks.BuildBackendHookCaller(
        str(source),
        system["build-backend"],
        backend_path=system.get("backend-path"),
        runner=runner.run,
        python_executable=python,
    )
    try:
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            wheel = caller.build_wheel(str(out))
    except pyproject_hooks.BackendUnavailable:
        raise unavailable_backend(backend, python) from None
    except subprocess.CalledProcessError:
        if DISK_FULL.search(runner.output):
            raise full_disk(build) from None
        message = f"the package's build backend '{backend}' failed; see its output above"
        raise HostError(Problem(message)) from None
    for warning in warned:
        # Warnings of pyproject_hooks about the backend.
        print(f"{warning.category.__name__}: {warning.message}")
    delete_tree(runner.folder)
    return out / wheel, runner.output


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


def _scripts_folder(options: WheelInstall) -> str:
    """Return the folder of the scripts of a wheel, relative to the prefix."""
    path = options.source / "setup.cfg"
    base, _, folder = setup_cfg_option(path, "install", "install_scripts").partition("/")
    if base not in {"$base", "$platbase"}:
        return options.scripts or f"lib/{options.package}"
    if ".." in Path(folder).parts or "\0" in folder:
        message = f"install_scripts is '{folder}', which is outside the prefix"
        raise WorkspaceError(Problem(message, Location(path), "use a folder such as '$base/lib/PACKAGE'"))
    return folder
