"""`python -m tests.upstream.page`: make docs/reference/compatibility.md of docs/compatibility.json."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import jinja2

from forge.base.files import write_if_changed
from tests.upstream.figures import DISTRIBUTIONS, Compatibility, Count, read
from tests.upstream.suites import SUITES

DOCS = Path(__file__).parents[2] / "docs"
PAGE, FIGURES = "reference/compatibility.md", "compatibility.json"
_TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True, slots=True)
class Row:
    """A row of a table, with the numbers of its notes."""

    name: str
    words: str
    cells: tuple[str, ...]
    marks: str


def page(found: Compatibility) -> str:
    """Return the text of the page."""
    notes: list[str] = []
    names = {
        "distributions": [(name, name.capitalize()) for name in DISTRIBUTIONS],
        "commit": found.commit,
        "sources": found.sources,
        "suites": [
            _row(suite.name, SUITES.get(suite.name, ""), suite.counts, suite.notes, notes)
            for suite in found.suites
        ],
        "repositories": [
            _row(each.name, _built(each.commit, each.types), each.counts, each.notes, notes)
            for each in found.repositories
        ],
        "notes": notes,
    }
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        undefined=jinja2.StrictUndefined,
        autoescape=False,
        keep_trailing_newline=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("compatibility.md.j2").render(names)


def _row(name: str, words: str, counts: Mapping[str, Count], own: Sequence[str], notes: list[str]) -> Row:
    """Return a row; its notes join those of the page, where equal ones are one."""
    notes += [note for note in own if note not in notes]
    marks = ", ".join(
        f"[{number}](#note-{number})" for number in sorted(notes.index(note) + 1 for note in own)
    )
    return Row(name, words, tuple(_cell(counts.get(each)) for each in DISTRIBUTIONS), marks)


def _cell(count: Count | None) -> str:
    if count is None:
        return "-"
    passed, total = count
    return f"{passed:,} of {total:,}"


def _built(commit: str, types: int | None) -> str:
    return f"`{commit}`" if types is None else f"`{commit}`, {types:,} {'type' if types == 1 else 'types'}"


def main(docs: Path = DOCS) -> int:
    """Write the page."""
    write_if_changed(docs / PAGE, page(read(docs / FIGURES)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
