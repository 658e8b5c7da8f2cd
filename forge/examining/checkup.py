"""The noun of examining: one topic, what was seen of it and what is to be done about it; pure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.frozen import frozen

if TYPE_CHECKING:
    from forge.errors import Problem


@frozen
class Checkup:
    """A topic after it was looked at.

    `errors` stop a build, `warnings` may become trouble, `notes` are for who wants to know all.
    """

    topic: str
    said: str
    errors: tuple[Problem, ...] = ()
    warnings: tuple[Problem, ...] = ()
    notes: tuple[Problem, ...] = ()


def graded(topic: str, said: str, problems: tuple[Problem, ...], *, serious: bool) -> Checkup:
    """Return a topic with problems that are errors where they are serious, else warnings."""
    return Checkup(topic, said, errors=problems) if serious else Checkup(topic, said, warnings=problems)
