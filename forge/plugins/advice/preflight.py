"""Checks before a build: lengths of variables, stale packages.

Linux limits each environment variable to 128 KiB. In the isolated layout, each package adds its prefix to
several variables, so large workspaces reach the limit; in the merged layout, all packages share one entry.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from forge.base.errors import Problem
from forge.base.layout import Layout
from forge.base.text import listed
from forge.build.folder_marks import is_removed_package
from forge.build.model import BuildRecord
from forge.build.tasks import BuildPlan
from forge.workspace.model import Package

LIMIT = 32 * 4096
"""The maximum size of one variable including name, '=' and the terminating NUL (MAX_ARG_STRLEN): 32 pages."""

_REMEDY = "build with '--merge-install' into a new install folder, where all packages share one entry"


def variable_length_problems(
    plan: BuildPlan,
    packages: Mapping[str, Package],
    layout: Layout,
    site_packages: str,
    variables: Mapping[str, str],
) -> tuple[tuple[Problem, ...], tuple[Problem, ...]]:
    """Return problems that make the build fail, and problems that only affect sourcing the workspace.

    Only entries that every package of a build type adds are counted; installed files may add more.
    """
    if layout.merged or not plan.tasks:
        return (), ()
    total = _too_long((*plan.tasks, *plan.fresh), packages, layout, site_packages, variables)
    if not total:
        return (), ()
    for name, task in plan.tasks.items():
        for variable, size in _too_long(task.needs, packages, layout, site_packages, variables):
            message = f"'{name}' cannot be built: '{variable}' would have {_size_text(size)}"
            return (Problem(message, hint=_REMEDY),), ()
    variable, size = max(total, key=lambda pair: pair[1])
    message = (
        f"no program could start after sourcing this workspace: '{variable}' would have {_size_text(size)}"
    )
    return (), (Problem(message, hint=_REMEDY),)


def _too_long(
    names: Iterable[str],
    packages: Mapping[str, Package],
    layout: Layout,
    site_packages: str,
    variables: Mapping[str, str],
) -> list[tuple[str, int]]:
    """Return the variables that exceed the limit with these packages, and their sizes."""
    sizes: dict[str, int] = {}
    for name in names:
        prefix = _size(str(layout.prefix(name))) + 1
        for variable, below in _certain_entries(packages[name], site_packages):
            sizes[variable] = sizes.get(variable, 0) + prefix + _size(below)
    # Entries are separated by ':'; the last one is followed by NUL or the present value of the variable.
    total = {
        name: size + _size(f"{name}=") + (_size(variables[name]) + 1 if variables.get(name) else 0)
        for name, size in sorted(sizes.items())
    }
    return [(name, size) for name, size in total.items() if size > LIMIT]


def _certain_entries(package: Package, site_packages: str) -> Iterator[tuple[str, str]]:
    """Yield the variables to which a package always adds an entry, and its path below the prefix."""
    if package.build_type.startswith("ament_"):
        yield "AMENT_PREFIX_PATH", ""
    if package.build_type == "ament_cmake":
        yield "CMAKE_PREFIX_PATH", ""
    if package.build_type == "ament_python":
        yield "PYTHONPATH", f"/{site_packages}"


def _size(text: str) -> int:
    return len(text.encode(errors="surrogateescape"))


def _size_text(size: int) -> str:
    return f"{size / 1024:.0f} KiB, more than the limit of Linux, {LIMIT // 1024} KiB"


def stale_package_warnings(
    records: Mapping[str, BuildRecord], packages: Mapping[str, Package], layout: Layout, root: Path
) -> Iterator[Problem]:
    """Yield a problem for packages removed from the workspace whose installed files may still be found.

    `packages` are the discovered ones. A package that was merely not discovered, for example because of
    '--base-paths', is not removed: its folder exists, is not ignored, and contains no other package.
    """
    missing = {
        name: record
        for name, record in records.items()
        if name not in packages and record.complete and record.source
    }
    taken = {str(root / package.path) for package in packages.values()} if missing else set()
    gone = sorted(
        name
        for name, record in missing.items()
        if record.source in taken or is_removed_package(Path(record.source))
    )
    if gone:
        verb, possessive = ("is", "its") if len(gone) == 1 else ("are", "their")
        message = f"{listed(gone)} {verb} no longer in the workspace, but {possessive} files are still in"
        hint = f"remove them: {layout.command('clean stale')}"
        yield Problem(f"{message} '{layout.install}', where other packages may find them", hint=hint)
