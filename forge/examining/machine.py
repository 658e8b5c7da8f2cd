"""What the machine gives: room on the disk, a file system that can do what installs take, time, memory."""

from __future__ import annotations

import os
import resource
import shutil
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from forge.capacity import memory, processors
from forge.errors import Place, Problem
from forge.examining.checkup import Checkup

if TYPE_CHECKING:
    from collections.abc import Iterator

    from forge.examining.subject import Subject

_GIB = 1 << 30
_LITTLE, _TOO_LITTLE = _GIB, 50 << 20
_FEW_FILES = 10_000
_PER_JOB = _GIB
_OPEN_FILES = 1024
_SKEW_SECONDS = 5.0
_NAMED = 3


def disk(subject: Subject) -> Checkup:
    """Look at the file systems of the build and install folders; makes and removes a folder in each."""
    errors: list[Problem] = []
    warnings: list[Problem] = []
    said = []
    seen: dict[int, None] = {}
    for wanted in (subject.layout.build, subject.layout.install):
        folder = _existing(wanted)
        device = folder.stat().st_dev
        errors += _refusals(wanted, folder)
        if device in seen:
            continue
        seen[device] = None
        free = shutil.disk_usage(folder).free
        said.append(f"{free / _GIB:.0f} GiB free" if free >= 10 * _GIB else f"{free / _GIB:.1f} GiB free")
        errors += _full(folder, free)
        warnings += _scarce(folder, free)
        warnings += _lacking_features(folder) if os.access(folder, os.W_OK) else ()
    return Checkup("disk", ", ".join(said), tuple(errors), tuple(warnings))


def owners(subject: Subject) -> Checkup:
    """Look for results that another user made, as with sudo: they cannot be written again."""
    foreign = []
    for base in filter(None, (subject.layout.build, subject.layout.install, subject.layout.logs)):
        foreign += [path for path in (base, *_children(base)) if _is_foreign(path)]
    if not foreign:
        return Checkup("owner", "results are yours to write")
    shown = ", ".join(f"'{path}'" for path in foreign[:_NAMED])
    more = f" and {len(foreign) - _NAMED} more" if len(foreign) > _NAMED else ""
    bases = " ".join(sorted({str(_base(path, subject)) for path in foreign}))
    problem = Problem(
        f"another user made {shown}{more}",
        hint=f"build without sudo, after 'sudo chown -R $(id -un): {bases}'",
    )
    return Checkup("owner", "another user's results", errors=(problem,))


def clock(subject: Subject) -> Checkup:
    """Compare the clock with that of the file system and with the times of the sources."""
    now = time.time()
    warnings = []
    skew = _skew(_existing(subject.layout.build))
    if abs(skew) > _SKEW_SECONDS:
        hint = "set both clocks (timedatectl), or builds will miss changes"
        message = f"the file system is {abs(skew):.0f} s {'ahead of' if skew > 0 else 'behind'} the clock"
        warnings.append(Problem(message, Place(_existing(subject.layout.build)), hint))
    future = [
        str(package.path / name)
        for package in subject.packages.values()
        for name, status in subject.files.get(package.name, ())
        if status.st_mtime > now + max(skew, 0) + _SKEW_SECONDS
    ]
    if future:
        count = f"{len(future)} files are" if len(future) > 1 else "a file is"
        hint = f"if your clock is right: touch {future[0]}" + (" and the others" if len(future) > 1 else "")
        warnings.append(
            Problem(f"{count} from the future: tools may build it again and again", Place(future[0]), hint)
        )
    return Checkup(
        "clock",
        "no file is newer than now" if not future else f"{len(future)} newer than now",
        warnings=tuple(warnings),
    )


def limits(subject: Subject) -> Checkup:
    """Look at what the system lets a program have: open files, and words for a program that it starts."""
    warnings = []
    files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if files != resource.RLIM_INFINITY and files < _OPEN_FILES:
        hint = f"ulimit -n {_OPEN_FILES * 4}"
        warnings.append(Problem(f"no program may open more than {files} files", hint=hint))
    words = os.sysconf("SC_ARG_MAX")
    taken = sum(
        len(os.fsencode(name)) + len(os.fsencode(value)) + 2 for name, value in subject.variables.items()
    )
    if 0 < words < 2 * taken:
        hint = "open a new terminal, and source less there"
        message = (
            f"the environment has {taken >> 10} KiB of the {words >> 10} that programs can be started with"
        )
        warnings.append(Problem(message, hint=hint))
    shown = "any number of" if files == resource.RLIM_INFINITY else files
    return Checkup("limits", f"{shown} open files, {words >> 10} KiB of arguments", warnings=tuple(warnings))


def capacity(_subject: Subject) -> Checkup:
    """Compare the memory with the number of jobs that a build would run."""
    jobs, found = processors(), memory()
    if found is None:
        return Checkup("memory", f"{jobs} jobs")
    left, whole = found.available / _GIB, found.total / _GIB
    said = f"{left:.1f} of {whole:.1f} GiB for {jobs} job{'s' if jobs > 1 else ''}"
    if found.available >= jobs * _PER_JOB:
        return Checkup("memory", said)
    fewer = max(1, int(found.available // _PER_JOB))
    hint = f"--jobs {fewer} is safe; forge itself waits with new jobs when memory becomes short"
    message = f"{left:.1f} GiB of memory are left for {jobs} jobs, which like 1 GiB each"
    return Checkup("memory", said, warnings=(Problem(message, hint=hint),) if fewer < jobs else ())


def _existing(path: Path) -> Path:
    """Return the folder, or the nearest one above that is there."""
    return next(folder for folder in (path, *path.parents) if folder.is_dir())


def _refusals(wanted: Path, folder: Path) -> Iterator[Problem]:
    if not os.access(folder, os.W_OK | os.X_OK):
        hint = "make it yours, or choose another with '--build-base' and '--install-base'"
        yield Problem(f"'{folder}' cannot be written to, where '{wanted.name}' belongs", hint=hint)


def _full(folder: Path, free: int) -> Iterator[Problem]:
    if free < _TOO_LITTLE:
        hint = "make room: 'forge clean stale' removes what no package of the workspace needs"
        yield Problem(f"the disk is full: {free >> 20} MiB are left", Place(folder), hint)


def _scarce(folder: Path, free: int) -> Iterator[Problem]:
    if _TOO_LITTLE <= free < _LITTLE:
        hint = "make room: 'forge clean stale' removes what no package of the workspace needs"
        yield Problem(f"the disk has {free >> 20} MiB left", Place(folder), hint)
    status = os.statvfs(folder)
    # Some file systems make such entries as they are needed, and say that there are none.
    if status.f_files and status.f_favail < _FEW_FILES:
        hint = "remove folders with many small files; 'df -i' tells how many there may be"
        yield Problem(f"the disk takes only {status.f_favail} more files", Place(folder), hint)


def _lacking_features(folder: Path) -> Iterator[Problem]:
    """Yield what a file system cannot do, tried in a folder of its own."""
    try:
        with tempfile.TemporaryDirectory(prefix=".forge_doctor_", dir=folder) as made:
            lower = Path(made, "name")
            lower.touch()
            if Path(made, "NAME").exists():
                hint = "build elsewhere: '--build-base' and '--install-base' on another file system"
                yield Problem(
                    "upper and lower case are the same there; names of packages may clash",
                    Place(folder),
                    hint,
                )
            try:
                Path(made, "link").symlink_to("name")
            except OSError:
                hint = "do without '--symlink-install', or install on another file system"
                yield Problem(
                    "there can be no links: libraries with versions will not install", Place(folder), hint
                )
    except OSError:
        return


def _skew(folder: Path) -> float:
    """Return by how many seconds the file system is ahead of the clock; 0 where nobody may try."""
    try:
        with tempfile.NamedTemporaryFile(prefix=".forge_doctor_", dir=folder) as made:
            return os.fstat(made.fileno()).st_mtime - time.time()
    except OSError:
        return 0.0


def _children(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError:
        return []


def _is_foreign(path: Path) -> bool:
    """Tell if somebody else made a file, and does not let us write to it."""
    try:
        return path.lstat().st_uid != os.geteuid() and not os.access(path, os.W_OK)
    except OSError:
        return False


def _base(path: Path, subject: Subject) -> Path:
    """Return the folder for results that a path is in, as short as it can be typed."""
    bases = (subject.layout.build, subject.layout.install, subject.layout.logs)
    base = next(base for base in bases if base and path.is_relative_to(base))
    return base.relative_to(subject.root) if base.is_relative_to(subject.root) else base
