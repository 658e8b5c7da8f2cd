"""What docs/compatibility.json holds: a row for each suite and repository, a count for each distribution."""

import json
from argparse import ArgumentTypeError
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

DISTRIBUTIONS = ("humble", "jazzy", "kilted", "rolling")

Count = tuple[int, int]
"""What passed, and of how many."""


@dataclass(frozen=True, slots=True)
class Suite:
    """A test suite of upstream: passed and all tests by distribution."""

    name: str
    counts: Mapping[str, Count]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Repository:
    """A public repository: packages that build and all packages by distribution."""

    name: str
    commit: str
    """The commit or branch that was built."""
    counts: Mapping[str, Count]
    types: int | None = None
    """How many messages, services and actions it defines."""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Compatibility:
    """All that the page shows."""

    commit: str = ""
    """The commit of forge that was tested."""
    sources: Mapping[str, str] = field(default_factory=dict)
    """Versions of the suites by distribution."""
    suites: tuple[Suite, ...] = ()
    repositories: tuple[Repository, ...] = ()


def read(path: Path) -> Compatibility:
    """Return the contents of a file; of a missing one, nothing."""
    if not path.is_file():
        return Compatibility()
    document = json.loads(path.read_text(encoding="utf-8"))
    return Compatibility(
        document["commit"],
        document.get("sources", {}),
        tuple(Suite(**_frozen(entry)) for entry in document["suites"]),
        tuple(Repository(**_frozen(entry)) for entry in document["repositories"]),
    )


def as_text(found: Compatibility) -> str:
    """Return the text of the file that `read` reads."""
    return json.dumps(asdict(found), indent=1, ensure_ascii=False) + "\n"


def with_counts(found: Compatibility, distribution: str, counts: Mapping[str, Count]) -> Compatibility:
    """Return it with the counts of suites in one distribution; other distributions and notes stay."""
    rows = {suite.name: suite for suite in found.suites}
    for name, count in counts.items():
        suite = rows.get(name, Suite(name, {}))
        rows[name] = replace(suite, counts=_ordered({**suite.counts, distribution: count}))
    return replace(found, suites=tuple(rows[name] for name in sorted(rows)))


def with_repository(found: Compatibility, row: Repository) -> Compatibility:
    """Return it with the counts of a row; those of other distributions and notes stay."""
    rows = {each.name: each for each in found.repositories}
    if row.name in rows:
        before = rows[row.name]
        types = max(before.types or 0, row.types or 0)
        row = replace(row, counts=_ordered({**before.counts, **row.counts}), types=types, notes=before.notes)
    rows[row.name] = row
    return replace(found, repositories=tuple(rows[name] for name in sorted(rows, key=str.lower)))


def by_distribution(text: str) -> tuple[str, str]:
    """Return distribution and value of an argument DISTRO=VALUE; raises ArgumentTypeError for another one."""
    distribution, _, value = text.partition("=")
    if distribution not in DISTRIBUTIONS or not value:
        message = f"'{text}' is not DISTRO=VALUE with one of {', '.join(DISTRIBUTIONS)}"
        raise ArgumentTypeError(message)
    return distribution, value


def _ordered(counts: Mapping[str, Count]) -> dict[str, Count]:
    return {name: counts[name] for name in DISTRIBUTIONS if name in counts}


def _frozen(entry: Mapping[str, Any]) -> dict[str, Any]:
    counts = {name: (passed, total) for name, (passed, total) in entry["counts"].items()}
    return {**entry, "counts": counts, "notes": tuple(entry.get("notes", ()))}
