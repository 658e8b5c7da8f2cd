"""Checks the machine: disk space, file system features, clock, limits and memory."""

from __future__ import annotations

import os
import resource
import shlex
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from forge.base.errors import Location, Problem
from forge.base.text import counted, listed
from forge.plugins.doctor.model import CheckContext, CheckResult
from forge.toolchain.resources import memory, processors

_GIB = 1 << 30
_LITTLE, _TOO_LITTLE = _GIB, 50 << 20
_FEW_FILES = 10_000
_PER_JOB = _GIB
_OPEN_FILES = 1024
_SKEW_SECONDS = 5.0


def disk(subject: CheckContext) -> CheckResult:
    """Check the file systems of the build and install folders; creates a temporary folder in each."""
    errors: list[Problem] = []
    warnings: list[Problem] = []
    summary = []
    seen: dict[int, None] = {}
    for wanted in (subject.layout.build, subject.layout.install):
        folder = _existing(wanted)
        device = folder.stat().st_dev
        if not os.access(folder, os.W_OK | os.X_OK):
            hint = "change its owner, or choose another folder with '--build-base' and '--install-base'"
            errors.append(Problem(f"cannot write to '{folder}' to create '{wanted.name}'", hint=hint))
        if device in seen:
            continue
        seen[device] = None
        free = shutil.disk_usage(folder).free
        summary.append(f"{free / _GIB:.0f} GiB free" if free >= 10 * _GIB else f"{free / _GIB:.1f} GiB free")
        command = subject.layout.command("clean stale")
        hint = f"free some space: '{command}' removes results of packages no longer in the workspace"
        left = f"{free >> 20} MiB are left"
        if free < _TOO_LITTLE:
            errors.append(Problem(f"the disk is full: {left}", Location(folder), hint))
        elif free < _LITTLE:
            warnings.append(Problem(f"the disk is almost full: {left}", Location(folder), hint))
        status = os.statvfs(folder)
        # Some file systems allocate inodes dynamically and report none.
        if status.f_files and status.f_favail < _FEW_FILES:
            hint = "remove folders with many small files; 'df -i' shows the number of free inodes"
            message = f"the file system has only {status.f_favail} free inodes"
            warnings.append(Problem(message, Location(folder), hint))
        warnings += _lacking_features(folder) if os.access(folder, os.W_OK) else ()
    return CheckResult("disk", ", ".join(summary), tuple(errors), tuple(warnings))


def owners(subject: CheckContext) -> CheckResult:
    """Find results of other users, for example from sudo, that cannot be overwritten."""
    foreign: list[str] = []
    bases = set()
    for base in filter(None, (subject.layout.build, subject.layout.install, subject.layout.logs)):
        paths = []
        with suppress(OSError):
            paths = [str(path) for path in (base, *sorted(base.iterdir())) if _is_foreign(path)]
        if paths:
            foreign += paths
            bases.add(str(base.relative_to(subject.root) if base.is_relative_to(subject.root) else base))
    if not foreign:
        return CheckResult("owner", "results are writable")
    problem = Problem(
        f"another user owns {listed(foreign)}",
        hint=f"run 'sudo chown -R $(id -un): {shlex.join(sorted(bases))}', and build without sudo",
    )
    return CheckResult("owner", "results of another user", errors=(problem,))


def clock(subject: CheckContext) -> CheckResult:
    """Compare the clock with that of the file system and with the times of sources."""
    now = time.time()
    warnings = []
    folder, skew = _existing(subject.layout.build), 0.0
    with suppress(OSError), tempfile.NamedTemporaryFile(prefix=".forge_doctor_", dir=folder) as file:
        skew = os.fstat(file.fileno()).st_mtime - time.time()
    if abs(skew) > _SKEW_SECONDS:
        hint = "synchronize both clocks (timedatectl), otherwise builds miss changes"
        message = f"the file system is {abs(skew):.0f} s {'ahead of' if skew > 0 else 'behind'} the clock"
        warnings.append(Problem(message, Location(folder), hint))
    future = [
        str(package.path / name)
        for package in subject.packages.values()
        for name, status in subject.files.get(package.name, ())
        if status.st_mtime > now + max(skew, 0) + _SKEW_SECONDS
    ]
    if future:
        count = f"{len(future)} files are" if len(future) > 1 else "a file is"
        hint = f"if the clock is correct: touch {future[0]}" + (" and the others" if len(future) > 1 else "")
        message = f"{count} modified in the future: tools may rebuild it every time"
        warnings.append(Problem(message, Location(future[0]), hint))
    summary = f"{len(future) or 'no'} files with modification times in the future"
    return CheckResult("clock", summary, warnings=tuple(warnings))


def limits(subject: CheckContext) -> CheckResult:
    """Check the limits for open files and for the size of arguments."""
    warnings = []
    files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if files != resource.RLIM_INFINITY and files < _OPEN_FILES:
        hint = f"ulimit -n {_OPEN_FILES * 4}"
        warnings.append(Problem(f"the limit for open files is {files} per process", hint=hint))
    limit = os.sysconf("SC_ARG_MAX")
    size = sum(len(os.fsencode(f"{name}={value}")) + 1 for name, value in subject.variables.items())
    if 0 < limit < 2 * size:
        hint = "open a new terminal and source fewer workspaces"
        message = f"the environment takes {size >> 10} KiB of the {limit >> 10} KiB limit for new processes"
        warnings.append(Problem(message, hint=hint))
    shown = "any number of" if files == resource.RLIM_INFINITY else files
    summary = f"{shown} open files, {limit >> 10} KiB of arguments"
    return CheckResult("limits", summary, warnings=tuple(warnings))


def capacity(_subject: CheckContext) -> CheckResult:
    """Compare the available memory with the default number of jobs."""
    jobs, machine_memory = processors(), memory()
    if machine_memory is None:
        return CheckResult("memory", f"{jobs} jobs")
    left, total = machine_memory.available / _GIB, machine_memory.total / _GIB
    summary = f"{left:.1f} of {total:.1f} GiB for {counted(jobs, 'job')}"
    if machine_memory.available >= jobs * _PER_JOB:
        return CheckResult("memory", summary)
    fewer = max(1, int(machine_memory.available // _PER_JOB))
    hint = f"use --jobs {fewer}; forge also delays new jobs when memory is short"
    message = f"{left:.1f} GiB of memory are available for {jobs} jobs, which need about 1 GiB each"
    return CheckResult("memory", summary, warnings=(Problem(message, hint=hint),) if fewer < jobs else ())


def _existing(path: Path) -> Path:
    """Return the folder, or its nearest existing parent."""
    return next(folder for folder in (path, *path.parents) if folder.is_dir())


def _lacking_features(folder: Path) -> Iterator[Problem]:
    """Yield missing features of a file system, tested in a temporary folder."""
    try:
        with tempfile.TemporaryDirectory(prefix=".forge_doctor_", dir=folder) as temporary:
            lower = Path(temporary, "name")
            lower.touch()
            if Path(temporary, "NAME").exists():
                hint = "build elsewhere: '--build-base' and '--install-base' on another file system"
                message = "the file system ignores case; names of packages may clash"
                yield Problem(message, Location(folder), hint)
            try:
                Path(temporary, "link").symlink_to("name")
            except OSError:
                hint = "do not use '--symlink-install', or install on another file system"
                message = "the file system has no symbolic links: versioned libraries cannot be installed"
                yield Problem(message, Location(folder), hint)
    except OSError:
        return


def _is_foreign(path: Path) -> bool:
    """Return whether a file of another user is not writable."""
    try:
        return path.lstat().st_uid != os.geteuid() and not os.access(path, os.W_OK)
    except OSError:
        return False
