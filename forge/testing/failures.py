"""Formats results and failures: colcon's lines, and a table of failed tests."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict

from forge.base.frozen import frozen
from forge.base.text import counted
from forge.testing.outcomes import Case, Outcome

_SHOWN_LINES = 6
_SHOWN_FAILURES = 50


@frozen
class Failure:
    """A failed test: its package, name, message, and a command that repeats it, whole and as displayed."""

    package: str
    test: str
    lines: tuple[str, ...]
    repeat: str
    displayed: str


def details(case: Case) -> list[str]:
    """Return colcon's lines for a case; the first one starts with a dash."""
    place = f"({case.file}{f':{case.line}' if case.line else ''})" if case.file else ""
    lines = [" ".join(filter(None, (case.suite, case.name, place)))]
    for label, texts in (
        ("error message", case.errors),
        ("failure message", case.failures),
        ("stdout output", case.stdout),
        ("stderr output", case.stderr),
    ):
        if texts:
            lines.append(f"<<< {label}")
            lines += [f"  {line}" for text in texts for line in text.strip("\r\n").splitlines()]
            lines.append(">>>")
    return [f"{'-' if number == 0 else ' '} {line}" for number, line in enumerate(lines)]


def skipped_line(test: Case) -> str:
    return f"- {' '.join(filter(None, (test.suite, test.name)))}: {test.text}"


def first_lines(cases: Sequence[Case]) -> tuple[str, ...]:
    """Return the first lines of the cases, labeled if there are several."""
    lines: list[str] = []
    for case in cases:
        # Those of the message, else of the complete text.
        texts = map(_filled_lines, (*case.errors, *case.failures, case.text))
        shown = next(filter(None, texts), [])[:_SHOWN_LINES]
        lines += [f"{case.name}:", *(f"  {line}" for line in shown)] if len(cases) > 1 else shown
    return tuple(lines[: 2 * _SHOWN_LINES])


def last_lines(text: str) -> tuple[str, ...]:
    return tuple(_filled_lines(text)[-_SHOWN_LINES:])


def table(failures: Sequence[Failure]) -> Iterator[str]:
    """Yield a description of each failure with a command to repeat it."""
    if not failures:
        return
    yield f"{counted(len(failures), 'failed test')}:"
    for failure in failures[:_SHOWN_FAILURES]:
        yield f"  {failure.package}: {failure.test}"
        yield from (f"      {line}" for line in failure.lines)
        yield f"    repeat: {failure.displayed}"
    left = len(failures) - _SHOWN_FAILURES
    if left > 0:
        yield f"  and {left} more: forge test-result --verbose"


def as_json(outcomes: Iterable[Outcome]) -> list[dict[str, object]]:
    return [
        {
            "path": outcome.path,
            **asdict(outcome.counts),
            "cases": [
                {
                    "suite": case.suite,
                    "name": case.name,
                    "file": case.file or None,
                    "line": int(case.line) if case.line.isdecimal() else None,
                    "errors": list(case.errors),
                    "failures": list(case.failures),
                }
                for case in outcome.cases
            ],
        }
        for outcome in outcomes
    ]


def _filled_lines(text: str) -> list[str]:
    return [line.rstrip() for line in text.splitlines() if line.strip()]
