"""Formats check results as text and for JSON."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from forge.base.colours import Meaning, Palette
from forge.base.errors import Problem, Severity, joined
from forge.base.text import counted
from forge.plugins.doctor.model import CheckResult

_WIDTH = 12
_PLAIN = Palette()
_SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")


def lines(results: Sequence[CheckResult], *, everything: bool, palette: Palette = _PLAIN) -> Iterator[str]:
    """Yield a line for each topic, then the findings by decreasing severity, and a conclusion."""
    for result in results:
        word: Meaning = "error" if result.errors else "warning" if result.warnings else "success"
        shown_word = "ok" if word == "success" else word
        yield f"{palette.paint(word, f'{shown_word:8}')}{result.topic:{_WIDTH}} {result.summary}"
    for severity in _SEVERITIES if everything else _SEVERITIES[:2]:
        for problem in _of_severity(results, severity):
            yield ""
            yield problem.render(severity, palette)
    yield ""
    yield conclusion(results, everything=everything)


def plain(results: Sequence[CheckResult]) -> dict[str, object]:
    findings = [
        (severity, result.topic, problem)
        for severity in _SEVERITIES
        for result in results
        for problem in getattr(result, f"{severity}s")
    ]
    return {
        **{f"{word}s": sum(severity == word for severity, _, _ in findings) for word in _SEVERITIES},
        "checked": [{"topic": result.topic, "summary": result.summary} for result in results],
        "findings": [
            {
                "severity": severity,
                "topic": topic,
                "message": problem.message,
                "file": str(problem.location.path) if problem.location else None,
                "line": problem.location.line if problem.location else None,
                "hint": problem.hint,
            }
            for severity, topic, problem in findings
        ],
    }


def _of_severity(results: Sequence[CheckResult], severity: str) -> list[Problem]:
    """Return the findings of one severity; those of one kind are joined."""
    return [problem for result in results for problem in joined(getattr(result, f"{severity}s"))]


def conclusion(results: Sequence[CheckResult], *, everything: bool) -> str:
    """Return the last line: whether builds are possible, and whether there are more findings."""
    errors, warnings, notes = (len(_of_severity(results, word)) for word in _SEVERITIES)
    if errors:
        text = f"{counted(errors, 'error')} {'prevents' if errors == 1 else 'prevent'} builds"
        text += f"; {counted(warnings, 'warning')}" if warnings else ""
    elif warnings:
        text = f"no errors; {counted(warnings, 'warning')}"
    else:
        text = "no problems found"
    return text if everything or not notes else f"{text} ({counted(notes, 'more note')} with --all)"
