"""The result type of checks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.frozen import frozen

if TYPE_CHECKING:
    from forge.base.errors import Problem


@frozen
class CheckResult:
    """The result of the checks of one topic.

    `errors` prevent builds, `warnings` may cause trouble, `notes` are informational.
    """

    topic: str
    summary: str
    errors: tuple[Problem, ...] = ()
    warnings: tuple[Problem, ...] = ()
    notes: tuple[Problem, ...] = ()


def graded(topic: str, summary: str, problems: tuple[Problem, ...], *, serious: bool) -> CheckResult:
    """Return a result whose problems are errors if they are serious, else warnings."""
    return (
        CheckResult(topic, summary, errors=problems)
        if serious
        else CheckResult(topic, summary, warnings=problems)
    )
