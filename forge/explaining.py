"""A plan in words: why each package is built or fresh, which commands run, how to repeat one by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.errors import Problem, SelectionError
from forge.steps import LAST_COMMAND, step_line

if TYPE_CHECKING:
    from collections.abc import Iterator

    from forge.layout import Layout
    from forge.model import BuildPlan


def explain(plan: BuildPlan) -> Iterator[str]:
    """Yield a line for each package of the plan: what happens to it and why."""
    for name in plan.fresh:
        yield f"{name}: fresh"
    for name, task in plan.tasks.items():
        yield f"{name}: {'maybe' if task.conditional else 'build'}, {task.reason}"


def commands(plan: BuildPlan) -> Iterator[str]:
    """Yield every command that the plan would run, in its order, each as a line for a shell."""
    for name, task in plan.tasks.items():
        yield f"# {name}"
        yield from (step_line(step) for step in task.steps)


def last_command(layout: Layout, package: str) -> str:
    """Return a line that repeats the last step of a package; raises SelectionError when there was none."""
    try:
        return (
            (layout.build_dir(package) / "handover" / LAST_COMMAND).read_text(encoding="utf-8").rstrip("\n")
        )
    except OSError:
        problem = Problem(
            f"no step of '{package}' has run in '{layout.build}'",
            hint=f"forge build --packages-up-to {package}",
        )
        raise SelectionError(problem) from None
