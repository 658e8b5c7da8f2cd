"""The program that runs unittest and writes a JUnit file."""

import subprocess
import sys
from pathlib import Path

import pytest

from forge.build.tests.recipes import UNITTESTS
from forge.testing.collecting import collect
from tests.conftest import Tree

TESTS = """import unittest

class Kinds(unittest.TestCase):
    def test_good(self): pass
    def test_bad(self): self.assertEqual(1, 2, "one <is> \\x01 two")
    def test_worse(self): raise ValueError("boom")
    @unittest.skip("not today")
    def test_later(self): pass
    @unittest.expectedFailure
    def test_known(self): self.fail()
    @unittest.expectedFailure
    def test_surprise(self): pass
    def test_parts(self):
        for part in range(3):
            with self.subTest(part=part):
                if part == 2: raise KeyError(part)
                self.assertEqual(part, 0)

class Broken(unittest.TestCase):
    @classmethod
    def setUpClass(cls): raise OSError("no set-up")
    def test_never(self): pass
"""


def run(root: Path, *arguments: str) -> tuple[int, str, Path]:
    """Run the program; return its exit code, its stderr, and the file."""
    junit = root / "out/result.xml"
    done = subprocess.run(
        [sys.executable, str(UNITTESTS), str(junit), "pkg", *arguments],
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stderr, junit


def test_every_kind_of_result_is_reported(tree: Tree) -> None:
    root = tree({"test_kinds.py": TESTS})
    code, said, junit = run(root)
    assert code == 1
    assert "Ran 7 tests" in said
    (outcome,) = collect(junit.parent).outcomes
    assert str(outcome.counts) == "8 tests, 3 errors, 2 failures, 1 skipped"
    told = {case.name: (case.errors, case.failures) for case in outcome.cases}
    assert told["test_bad"] == ((), ("AssertionError: 1 != 2 : one <is>  two",))
    assert told["test_worse"] == (("ValueError: boom",), ())
    assert told["test_surprise"][1] == ("unexpected success of a test marked as expected failure",)
    assert told["test_parts"] == (("(part=2) KeyError: 2",), ("(part=1) AssertionError: 1 != 0",))
    assert told["setUpClass (test_kinds.Broken)"] == (("OSError: no set-up",), ())


@pytest.mark.parametrize(
    ("files", "arguments", "code"),
    [
        ({"test_a.py": "import unittest\nclass A(unittest.TestCase):\n    def test(self): pass\n"}, (), 0),
        ({"test_a.py": "import nowhere_to_be_found\n"}, (), 1),
        ({"test_a.py": ""}, (), 5),
        ({"a.py": ""}, (), 5),
        (
            {"names.py": "import unittest\nclass A(unittest.TestCase):\n    def test(self): pass\n"},
            ("names",),
            0,
        ),
    ],
)
def test_the_exit_code_distinguishes_failures_from_no_tests(
    tree: Tree, files: dict[str, str], arguments: tuple[str, ...], code: int
) -> None:
    """Modules of the package precede those beside the program, which also has one called 'names'."""
    assert run(tree(files), *arguments)[0] == code
