"""What a target is, and whether results meet it; tests/bench/target_table.py has all of them."""

from __future__ import annotations

import operator
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from tests.bench.figures import Results
    from tests.bench.reading import Question

_SIGNS = {"<=": operator.le, ">=": operator.ge}


@dataclass(frozen=True, slots=True)
class ByHand:
    """What no run of the bench can measure: what was found, when and how."""

    found: str
    met: bool
    date: str
    how: str


@dataclass(frozen=True, slots=True)
class Target:
    """A limit that an issue names, and where its value comes from."""

    issue: int
    words: str
    sign: str
    limit: float
    unit: str
    value: Question | ByHand
    digits: int = 0
    """Behind the point; a value is compared as it is shown."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """A target beside its value; `met` is None where nothing was measured."""

    target: Target
    measured: str
    met: bool | None
    where: str


def verdicts(targets: Iterable[Target], results: Results) -> list[Verdict]:
    """Hold targets against results."""
    return [_verdict(target, results) for target in targets]


def _verdict(target: Target, results: Results) -> Verdict:
    if isinstance(target.value, ByHand):
        hand = target.value
        return Verdict(target, hand.found, hand.met, f"{hand.how}, {hand.date}")
    answer = target.value.ask(results)
    link = f"[{target.value.scenario}](#{target.value.scenario})"
    if answer is None:
        return Verdict(target, "not measured", None, link)
    value = round(answer.value, target.digits)
    shown = f"{value:,.{target.digits}f} {target.unit}".strip()
    detail = f" ({answer.detail})" if answer.detail else ""
    return Verdict(target, shown + detail, _SIGNS[target.sign](value, target.limit), link)
