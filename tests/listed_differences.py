"""The files that docs/reference/from-colcon.md lists as different from those of colcon."""

import re
from collections import Counter
from dataclasses import dataclass
from fnmatch import fnmatchcase

from tests.snippets import ROOT


@dataclass(frozen=True, slots=True)
class Row:
    """A line of the page: which files differ, and who has them; 'both' have them with other text."""

    pattern: str
    who: str


class ListedDifferences:
    """The lines of one section of the page, and how often each was needed."""

    def __init__(self, section: str) -> None:
        """Read a section."""
        text = (ROOT / "docs/reference/from-colcon.md").read_text(encoding="utf-8")
        part = text.partition(f"\n## {section}\n")[2].partition("\n## ")[0]
        rows = re.findall(r"^\| (`[^|]+) \| (\w+)[^|]* \|", part, re.MULTILINE)
        self.rows = tuple(
            Row(pattern, who) for cell, who in rows for pattern in re.findall("`([^`]+)`", cell)
        )
        self.used: Counter[str] = Counter()

    def explain(self, name: str, who: str) -> bool:
        """Tell if the page says that a file differs so."""
        row = next((row for row in self.rows if row.who == who and fnmatchcase(name, row.pattern)), None)
        if row:
            self.used[row.pattern] += 1
        return row is not None

    @property
    def unused(self) -> set[str]:
        """Return the patterns that no file needed."""
        return {row.pattern for row in self.rows} - set(self.used)
