"""Run unittest and write a JUnit file: `python unittests.py JUNIT_FILE PACKAGE [ARGUMENT ...]`.

The arguments are those of `python -m unittest`; without names it discovers tests in the working directory.
Exits with 0, with 1 if a test failed, or with 5 if there was no test. The workspace's interpreter runs it by
path, so it uses only the standard library.
"""

from __future__ import annotations

import os
import sys

if __name__ == "__main__":
    # Like `python -m`, import modules from the working directory instead of this folder.
    _HERE = os.path.dirname(os.path.abspath(__file__))  # noqa: PTH100, PTH120  (pathlib comes below)
    sys.path[:] = [os.getcwd(), *(path for path in sys.path if path != _HERE)]  # noqa: PTH109

import re
import time
import unittest
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import TracebackType

    Fault = tuple[type[BaseException], BaseException, TracebackType] | tuple[None, None, None]

FAILED, NONE_FOUND = 1, 5
# Characters that XML 1.0 does not allow.
_UNPRINTABLE = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


class Result(unittest.TextTestResult):
    records: list[CaseRecord]

    def startTestRun(self) -> None:
        super().startTestRun()
        self.records = []

    def startTest(self, test: unittest.TestCase) -> None:
        super().startTest(test)
        self.records.append(CaseRecord(test.id()))

    def stopTest(self, test: unittest.TestCase) -> None:
        super().stopTest(test)
        self.records[-1].seconds = time.monotonic() - self.records[-1].began

    def addError(self, test: unittest.TestCase, err: Fault) -> None:
        super().addError(test, err)
        self._note(test, "error", _message(err), self.errors[-1][1])

    def addFailure(self, test: unittest.TestCase, err: Fault) -> None:
        super().addFailure(test, err)
        self._note(test, "failure", _message(err), self.failures[-1][1])

    def addSkip(self, test: unittest.TestCase, reason: str) -> None:
        super().addSkip(test, reason)
        self._note(test, "skipped", reason)

    def addSubTest(self, test: unittest.TestCase, subtest: unittest.TestCase, err: Fault | None) -> None:
        super().addSubTest(test, subtest, err)
        if err is not None:
            failed = err[0] is not None and issubclass(err[0], test.failureException)
            text = (self.failures if failed else self.errors)[-1][1]
            # The description of the subtest identifies it.
            part = str(subtest).removeprefix(str(test)).strip()
            self._note(test, "failure" if failed else "error", f"{part} {_message(err)}", text)

    def addUnexpectedSuccess(self, test: unittest.TestCase) -> None:
        super().addUnexpectedSuccess(test)
        self._note(test, "failure", "unexpected success of a test marked as expected failure")

    def _note(self, test: unittest.TestCase, kind: str, message: str, text: str = "") -> None:
        # The test may be the setup of a class or module, which was not started.
        if not self.records or self.records[-1].name != test.id():
            self.records.append(CaseRecord(test.id()))
        self.records[-1].events.append((kind, message, text))


def _message(err: Fault) -> str:
    kind, value, _ = err
    return f"{kind.__name__}: {value}" if kind is not None else ""


class Runner(unittest.TextTestRunner):
    resultclass = Result  # type: ignore[assignment]  # (typeshed expects a factory function)


class CaseRecord:
    def __init__(self, name: str) -> None:
        self.name = name
        self.events: list[tuple[str, str, str]] = []
        self.seconds = 0.0
        self.began = time.monotonic()


def main(words: Sequence[str]) -> int:
    junit, package, *arguments = words
    program = unittest.TestProgram(
        module=None, argv=["python -m unittest", *arguments], testRunner=Runner, exit=False
    )
    result = program.result
    assert isinstance(result, Result)
    path = Path(junit)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(_junit(package, result.records))
    except OSError as error:
        sys.exit(f"error: cannot write '{path}': {error.strerror}")
    if not result.wasSuccessful():
        return FAILED
    return 0 if result.records else NONE_FOUND


_WORST_FIRST = ("error", "failure", "skipped")
"""Of several events in a test, the worst one is its result."""


def _junit(package: str, records: Sequence[CaseRecord]) -> bytes:
    kinds = []
    for record in records:
        noted = {kind for kind, _, _ in record.events}
        kinds.append(next((kind for kind in _WORST_FIRST if kind in noted), ""))
    seconds = sum(record.seconds for record in records)
    root = ET.Element("testsuite", name=_printable(package), time=f"{seconds:.3f}", tests=str(len(records)))
    for name, kind in (("errors", "error"), ("failures", "failure"), ("skipped", "skipped")):
        root.set(name, str(kinds.count(kind)))
    for record in records:
        # 'setUpClass (module.Class)' is not a test name.
        suite, _, name = (package, "", record.name) if " " in record.name else record.name.rpartition(".")
        names = {"classname": _printable(suite), "name": _printable(name)}
        case = ET.SubElement(root, "testcase", names, time=f"{record.seconds:.3f}")
        for kind, message, text in record.events:
            ET.SubElement(case, kind, message=_printable(message)).text = _printable(text)
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True))


def _printable(text: str) -> str:
    return _UNPRINTABLE.sub("", text)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
