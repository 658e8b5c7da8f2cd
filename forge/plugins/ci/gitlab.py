"""Collapsible sections of GitLab's job log, and its code quality report of errors and warnings."""

from __future__ import annotations

import hashlib
import json
import re
import time
from collections import Counter
from collections.abc import Iterable, Iterator

from forge.base.files import replace_file
from forge.base.layout import CODE_QUALITY_FILE
from forge.output.reporters import Run
from forge.plugins.ci.findings import CiReporter, Finding

_CLEAR = "\x1b[0K"
_SEVERITIES = {"error": "critical", "warning": "minor"}
_MOST = 5000
"""The maximum number of entries of a report, about 1.5 MB; GitLab compares two reports for each page."""


class GitLab(CiReporter):
    checkout = "CI_PROJECT_DIR"

    def __init__(self, run: Run) -> None:
        super().__init__(run)
        self._sections = 0

    def log(self, title: str, lines: Iterable[str]) -> Iterator[str]:
        """Yield a collapsed section; its name must be unique in a job."""
        self._sections += 1
        now = int(time.time())
        words = re.sub(r"[^\w.-]+", "_", title, flags=re.ASCII)
        name = f"forge_{self.run.command}_{now}_{self._sections}_{words}"
        yield f"{_CLEAR}section_start:{now}:{name}[collapsed=true]\r{_CLEAR}{title}"
        yield from lines
        yield f"{_CLEAR}section_end:{int(time.time())}:{name}\r{_CLEAR}"

    def write(self) -> Iterator[str]:
        """Write the report of a build beside the logs of all runs, where its path is always the same."""
        if self.run.command == "build" and self.run.log_folder is not None:
            path = self.run.log_folder.parent / CODE_QUALITY_FILE
            # Errors come first, so that only warnings are omitted.
            findings = sorted(
                (each for each in self.findings if each.file), key=lambda each: each.severity != "error"
            )
            replace_file(path, (json.dumps(_report(findings[:_MOST]), indent=1) + "\n").encode())
            more = f" (the first {_MOST} of {len(findings)} entries)" if len(findings) > _MOST else ""
            yield f"code quality report: {self.run.displayed(path)}{more}"


def _report(findings: Iterable[Finding]) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    seen = Counter[str]()
    for finding in findings:
        # Omit the line number, so that a moved finding does not count as a new one.
        description = finding.message.partition("\n")[0]
        what = f"{finding.severity}\n{finding.file}\n{description}"
        seen[what] += 1
        row: dict[str, object] = {
            "description": description,
            "check_name": f"forge {finding.severity}",
            "fingerprint": hashlib.sha256(f"{what}\n{seen[what]}".encode()).hexdigest(),
            "severity": _SEVERITIES[finding.severity],
            "location": {"path": finding.file, "lines": {"begin": finding.line}},
        }
        rows.append(row)
    return rows


start = GitLab
