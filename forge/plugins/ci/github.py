"""Workflow commands and the job summary of GitHub Actions.

See 'workflow commands' and 'environment files' in its documentation.
"""

from __future__ import annotations

import re
import secrets
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from forge.base.errors import Problem, reason_of
from forge.base.templating import render
from forge.base.text import counted, duration
from forge.output.reporters import Run
from forge.plugins.ci.findings import CiReporter, Finding

_DATA = (("%", "%25"), ("\r", "%0D"), ("\n", "%0A"))
_PROPERTY = (*_DATA, (":", "%3A"), (",", "%2C"))
_MARKUP = re.compile(r"[^\w\s.,:;/()+='-]|_")
_COMMAND = re.compile(r"(?:\A|[\r\n])\s*::|##\[")
"""What GitHub takes for a command, with both of its syntaxes; spaces before one do not matter."""
_MOST = 10
"""The maximum number of annotations of each kind that GitHub shows for a step."""
_LISTED = 20
"""The maximum number of failures in the summary, whose size is limited."""
_SLOWEST = 5


class GitHub(CiReporter):
    checkout = "GITHUB_WORKSPACE"

    def __init__(self, run: Run) -> None:
        super().__init__(run)
        self._announced = Counter[str]()

    def announce(self, finding: Finding) -> Iterator[str]:
        self._announced[finding.severity] += 1
        if self._announced[finding.severity] <= _MOST:
            place = {"file": finding.file, "line": finding.line, "col": finding.column}
            properties = {"title": finding.title, **{name: value for name, value in place.items() if value}}
            yield command(finding.severity, finding.message, **properties)

    def guard(self, text: str) -> str:
        if not _COMMAND.search(text):
            return text
        return "".join(f"{line}\n" for line in _inert(text.removesuffix("\n").split("\n")))

    def log(self, title: str, lines: Iterable[str]) -> Iterator[str]:
        """Yield a folded group in which output of packages is not interpreted as commands."""
        yield command("group", title)
        yield from _inert(lines)
        yield command("endgroup")

    def write(self) -> Iterator[str]:
        """Append the report to the file with the summary of the job, if there is one."""
        if path := self.run.variables.get("GITHUB_STEP_SUMMARY"):
            try:
                with Path(path).open("a", encoding="utf-8", errors="replace") as stream:
                    stream.write(self._summary())
            except OSError as error:
                message = f"cannot write the job summary '{path}': {reason_of(error)}"
                self.run.warn([Problem(message)])
        yield from ()

    def _summary(self) -> str:
        finished = [event for event in self.events if event["event"] == "Finished" and not event["embedded"]]
        restored = set(self.summary["restored"])
        built = [event for event in finished if event["package"] not in restored and not event["code"]]
        slowest = sorted(built, key=lambda event: -event["seconds"])[:_SLOWEST]
        failed = [event for event in finished if event["code"]]
        tests = [event for event in self.events if event["event"] == "TestFailure"]
        return render(
            "ci/templates/summary.md.j2",
            command=self.run.command,
            summary=self.summary,
            counts=self.summary.get("tests"),
            took=duration(self.summary["seconds"]),
            failed=failed[:_LISTED],
            tests=tests[:_LISTED],
            more=max(len(failed) - _LISTED, 0) + max(len(tests) - _LISTED, 0),
            warnings=sum(finding.severity == "warning" for finding in self.findings),
            slowest=[(event["package"], duration(event["seconds"])) for event in slowest],
            cached=any("cache" in event for event in finished),
            compiled=len([event for event in built if event["package"] in self.summary["finished"]]),
            launchers=[event for event in self.events if event["event"] == "Launcher"],
            cell=cell,
            counted=counted,
            fence=fence,
        )


start = GitHub


def _inert(lines: Iterable[str]) -> Iterator[str]:
    """Yield lines, framed by the commands that stop and resume the interpretation of commands."""
    token = secrets.token_hex(16)
    yield command("stop-commands", token)
    yield from lines
    yield f"::{token}::"


def command(name: str, message: str = "", **properties: object) -> str:
    """Return a workflow command, escaped as the service's own toolkit does."""
    words = ",".join(f"{key}={_escaped(str(value), _PROPERTY)}" for key, value in properties.items())
    return f"::{name}{f' {words}' if words else ''}::{_escaped(message, _DATA)}"


def _escaped(text: str, table: Iterable[tuple[str, str]]) -> str:
    for character, code in table:
        text = text.replace(character, code)
    return text


def cell(text: str) -> str:
    """Return any text as code in a cell of a Markdown table."""
    # Markdown is valid within tags, but character references are never markup.
    plain = _MARKUP.sub(lambda match: f"&#{ord(match[0])};", " ".join(text.split()))
    return f"<code>{plain}</code>"


def fence(text: str) -> str:
    """Return a fence of a Markdown block that does not occur in its text."""
    return "`" * max(3, 1 + max(map(len, re.findall("`+", text)), default=0))
