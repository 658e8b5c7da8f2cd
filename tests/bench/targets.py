"""What a target is, and whether results meet it; tests/bench/target_table.py has all of them."""

import operator
from collections.abc import Iterable
from dataclasses import dataclass

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
    """A limit that an issue names, such as '<= 0.35 of its time', and where its value comes from."""

    issue: int
    words: str
    limit: str
    value: Question | ByHand

    @property
    def shown_limit(self) -> str:
        """Return the limit as the page shows it."""
        sign, number, unit = f"{self.limit} ".split(" ", 2)
        shown = f"{float(number):g}" if float(number) < 1000 else f"{float(number):,.0f}"
        return f"{'≤' if sign == '<=' else '≥'} {shown} {unit}".strip()


@dataclass(frozen=True, slots=True)
class Verdict:
    """A target beside its value; `met` is None where nothing was measured."""

    target: Target
    measured: str
    met: bool | None
    where: str


def verdicts(targets: Iterable[Target], results: Results) -> list[Verdict]:
    """Compare targets with results; a value is compared as it is shown, with the digits of its limit."""
    return [_verdict(target, results) for target in targets]


def _verdict(target: Target, results: Results) -> Verdict:
    if isinstance(target.value, ByHand):
        hand = target.value
        return Verdict(target, hand.found, hand.met, f"{hand.how}, {hand.date}")
    answer = target.value.ask(results)
    link = f"[{target.value.scenario}](#{target.value.scenario})"
    if answer is None:
        return Verdict(target, "not measured", None, link)
    sign, limit, unit = f"{target.limit} ".split(" ", 2)
    digits = len(limit.partition(".")[2])
    value = round(answer.value, digits)
    shown = f"{value:,.{digits}f} {unit}".strip()
    detail = f" ({answer.detail})" if answer.detail else ""
    return Verdict(target, shown + detail, _SIGNS[sign](value, float(limit)), link)
