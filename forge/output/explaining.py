"""Describes a plan: why packages are built or up to date, and their commands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from forge.base.errors import Problem, SelectionError
from forge.base.layout import LAST_COMMAND, SCRATCH_DIR, Layout
from forge.base.text import counted
from forge.build.tasks import BuildPlan, step_line
from forge.workspace.model import Package


def explain(
    plan: BuildPlan, packages: Mapping[str, Package], named: frozenset[str] = frozenset()
) -> Iterator[str]:
    """Yield a line with the reason for each package that is built, packages of the workspace first.

    Packages that are up to date are only counted, except those that the user `named`.
    """
    for name, task in sorted(plan.tasks.items(), key=lambda item: item[1].embedded):
        yield f"{name}: {'maybe build' if task.conditional else 'build'}, {task.reason}"
    yield from (f"{name}: up to date" for name in plan.fresh if name in named)
    for kind, embedded in (("", False), ("embedded ", True)):
        count = sum(packages[name].embedded is embedded and name not in named for name in plan.fresh)
        if count:
            yield f"{counted(count, f'{kind}package')}: up to date"


def commands(plan: BuildPlan) -> Iterator[str]:
    """Yield all commands of the plan in order, as shell command lines."""
    for name, task in plan.tasks.items():
        yield f"# {name}"
        yield from (step_line(step) for step in task.steps)


def last_command(layout: Layout, package: str) -> str:
    """Return a command line that repeats the last step of a package; raises SelectionError for none."""
    try:
        return (
            (layout.build_dir(package) / SCRATCH_DIR / LAST_COMMAND).read_text(encoding="utf-8").rstrip("\n")
        )
    except OSError:
        problem = Problem(
            f"no step of '{package}' has run in '{layout.build}'",
            hint=f"forge build --packages-up-to {package}",
        )
        raise SelectionError(problem) from None
