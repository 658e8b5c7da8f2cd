"""Checks version requirements among packages of the workspace."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.base.errors import Location, Problem
from forge.workspace.model import BUILD_KINDS, RUN_KINDS, TEST_KINDS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from forge.workspace.model import Package

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
    """Yield a problem for each version requirement that a package of the workspace does not meet.

    Only numeric versions are compared; others, such as '1.0rc1', are ignored.
    """
    for package in packages.values():
        for need in package.manifest.dependencies:
            if need.versions and need.kinds & _KINDS and need.name in packages:
                present = packages[need.name].manifest.version
                wanted = [f for f in need.versions if _fits(present, *f) is False]
                if wanted:
                    words = " and ".join(_WORDS[word].format(version) for word, version in wanted)
                    yield Problem(
                        f"'{package.name}' requires version {words} of '{need.name}', but it is {present}",
                        Location(package.manifest.path),
                    )


def _fits(present: str, word: str, wanted: str) -> bool | None:
    """Tell whether a version meets a requirement; None if they cannot be compared."""
    if not (_PLAIN.fullmatch(present) and _PLAIN.fullmatch(wanted)):
        return None
    left, right = _numbers(present), _numbers(wanted)
    return {
        "lt": left < right,
        "lte": left <= right,
        "eq": left == right,
        "neq": left != right,
        "gte": left >= right,
        "gt": left > right,
    }[word]


def _numbers(version: str) -> tuple[int, ...]:
    """Return the numbers of a version without trailing zeros: 1.0 equals 1."""
    numbers = [int(part) for part in version.split(".")]
    while numbers and not numbers[-1]:
        numbers.pop()
    return tuple(numbers)
