"""Versions that packages ask of each other: what the workspace has is another one; pure."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.errors import Place, Problem
from forge.model import BUILD_KINDS, RUN_KINDS, TEST_KINDS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from forge.model import Package

_WORDS = {
    "lt": "before {}",
    "lte": "{} or before",
    "eq": "{}",
    "neq": "other than {}",
    "gte": "{} or later",
    "gt": "later than {}",
}
_KINDS = BUILD_KINDS | RUN_KINDS | TEST_KINDS
_PLAIN = re.compile(r"\d{1,18}(\.\d{1,18})*", re.ASCII)


def unmet_versions(packages: Mapping[str, Package]) -> Iterator[Problem]:
    """Yield a problem for each need of a version that the package of that name in the workspace is not.

    Only plain numbers are compared: of '1.0rc1' and the like nobody says anything.
    """
    for package in packages.values():
        for need in package.manifest.dependencies:
            if need.versions and need.kinds & _KINDS and need.name in packages:
                there = packages[need.name].manifest.version
                wanted = [f for f in need.versions if _fits(there, *f) is False]
                if wanted:
                    words = " and ".join(_WORDS[word].format(version) for word, version in wanted)
                    yield Problem(
                        f"'{package.name}' wants '{need.name}' in version {words}; the workspace has {there}",
                        Place(package.manifest.path),
                    )


def _fits(there: str, word: str, wanted: str) -> bool | None:
    """Tell if a version is as wanted; None where that cannot be said."""
    if not (_PLAIN.fullmatch(there) and _PLAIN.fullmatch(wanted)):
        return None
    left, right = _numbers(there), _numbers(wanted)
    return {
        "lt": left < right,
        "lte": left <= right,
        "eq": left == right,
        "neq": left != right,
        "gte": left >= right,
        "gt": left > right,
    }[word]


def _numbers(version: str) -> tuple[int, ...]:
    """Return the numbers of a version, without zeros at the end: 1.0 is 1."""
    numbers = [int(part) for part in version.split(".")]
    while numbers and not numbers[-1]:
        numbers.pop()
    return tuple(numbers)
