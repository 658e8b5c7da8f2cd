"""How long the variables of a workspace become, before anything is built; pure.

Linux hands no program a variable above 128 KiB. In the isolated layout each package adds its prefix to
several, so large workspaces get there; in the merged one all share an entry.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.errors import Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from forge.layout import Layout
    from forge.model import BuildPlan, Package

LIMIT = 32 * 4096
"""What one string may have, its name, '=' and the NUL at its end included: 32 pages."""

_REMEDY = "build with '--merge-install' into a new install folder: there all packages share one entry"


def too_long(
    plan: BuildPlan,
    packages: Mapping[str, Package],
    layout: Layout,
    site_packages: str,
    variables: Mapping[str, str],
) -> tuple[tuple[Problem, ...], tuple[Problem, ...]]:
    """Return what makes the build fail, and what only makes the workspace useless once it is sourced.

    Only entries that are certain count: files that packages may install besides add to these.
    """
    if layout.merged or not plan.tasks:
        return (), ()
    whole = _over((*plan.tasks, *plan.fresh), packages, layout, site_packages, variables)
    if not whole:
        return (), ()
    for name, task in plan.tasks.items():
        for variable, size in _over(task.needs, packages, layout, site_packages, variables):
            message = f"'{name}' cannot be built, for it would get a '{variable}' of {_shown(size)}"
            return (Problem(message, hint=_REMEDY),), ()
    variable, size = max(whole, key=lambda pair: pair[1])
    message = f"who sources this workspace can start no program, for '{variable}' has {_shown(size)}"
    return (), (Problem(message, hint=_REMEDY),)


def _over(
    names: Iterable[str],
    packages: Mapping[str, Package],
    layout: Layout,
    site_packages: str,
    variables: Mapping[str, str],
) -> list[tuple[str, int]]:
    """Return the variables that these packages make longer than the limit, with their sizes."""
    sizes: dict[str, int] = {}
    for name in names:
        prefix = _size(str(layout.prefix(name))) + 1
        for variable, below in _certain(packages[name], site_packages):
            sizes[variable] = sizes.get(variable, 0) + prefix + _size(below)
    # Between two entries is a ':', after the last one the NUL, or what the variable holds already.
    whole = {
        name: size + _size(f"{name}=") + (_size(variables[name]) + 1 if variables.get(name) else 0)
        for name, size in sorted(sizes.items())
    }
    return [(name, size) for name, size in whole.items() if size > LIMIT]


def _certain(package: Package, site_packages: str) -> Iterator[tuple[str, str]]:
    """Yield the variables that get an entry whatever a package installs, and its path below the prefix."""
    if package.build_type.startswith("ament_"):
        yield "AMENT_PREFIX_PATH", ""
    if package.build_type == "ament_cmake":
        yield "CMAKE_PREFIX_PATH", ""
    if package.build_type == "ament_python":
        yield "PYTHONPATH", f"/{site_packages}"


def _size(text: str) -> int:
    return len(text.encode(errors="surrogateescape"))


def _shown(size: int) -> str:
    return f"{size / 1024:.0f} KiB, more than the {LIMIT // 1024} KiB that Linux takes"
