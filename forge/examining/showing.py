"""What was found, as lines for people and as plain values for programs; pure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.errors import Place

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from forge.errors import Problem
    from forge.examining.checkup import Checkup

_WIDTH = 12


def lines(checkups: Sequence[Checkup], *, everything: bool) -> Iterator[str]:
    """Yield a line for each topic, then what is to be done, the worst first, and last how it stands."""
    for checkup in checkups:
        yield f"{_word(checkup):8}{checkup.topic:{_WIDTH}} {checkup.said}"
    told = [pair for pair in graded(checkups) if everything or pair[0] != "note"]
    for severity, _, problem in told:
        yield ""
        yield problem.render(severity)
    yield ""
    yield conclusion(checkups, everything=everything)


def plain(checkups: Sequence[Checkup]) -> dict[str, object]:
    """Return the same for programs: what was looked at, every finding, and how many there are of each."""
    found = list(graded(checkups))
    return {
        **{
            f"{word}s": sum(severity == word for severity, _, _ in found)
            for word in ("error", "warning", "note")
        },
        "checked": [{"topic": checkup.topic, "said": checkup.said} for checkup in checkups],
        "findings": [_plain(severity, topic, problem) for severity, topic, problem in found],
    }


def graded(checkups: Sequence[Checkup]) -> Iterator[tuple[str, str, Problem]]:
    """Yield severity, topic and problem of all findings, the worst first."""
    for word in ("error", "warning", "note"):
        for checkup in checkups:
            for problem in getattr(checkup, f"{word}s"):
                yield word, checkup.topic, problem


def conclusion(checkups: Sequence[Checkup], *, everything: bool) -> str:
    """Return the last line, which says whether something stops a build and whether there is more to know."""
    errors, warnings, notes = (
        sum(len(getattr(checkup, word)) for checkup in checkups) for word in ("errors", "warnings", "notes")
    )
    if errors:
        verb = "stops" if errors == 1 else "stop"
        said = f"{_count(errors, 'error')} {verb} a build" + (
            f"; {_count(warnings, 'warning')}" if warnings else ""
        )
    elif warnings:
        said = f"nothing stops a build; {_count(warnings, 'warning')}"
    else:
        said = "all well: nothing stops a build"
    return said if everything or not notes else f"{said} ({_count(notes, 'note')} more with --all)"


def _word(checkup: Checkup) -> str:
    return "error" if checkup.errors else "warning" if checkup.warnings else "ok"


def _plain(severity: str, topic: str, problem: Problem) -> dict[str, object]:
    place = problem.place or Place("")
    return {
        "severity": severity,
        "topic": topic,
        "message": problem.message,
        "file": str(place.path) or None,
        "line": place.line,
        "hint": problem.hint,
    }


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"
