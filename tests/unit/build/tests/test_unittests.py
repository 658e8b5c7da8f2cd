"""The program that runs unittest and leaves a JUnit file."""

from __future__ import annotations

import pytest

from forge.build.tests.unittests import NONE_FOUND, main
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


def test_unittest_results_are_written_in_process(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the program does is plain Python: so its lines count as tested."""
    root = tree({"test_kinds_inside.py": TESTS})
    monkeypatch.chdir(root)
    monkeypatch.syspath_prepend(str(root))
    assert main([str(root / "out/result.xml"), "pkg"]) == 1
    assert str(collect(root / "out").outcomes[0].counts) == "8 tests, 3 errors, 2 failures, 1 skipped"
    assert main([str(root / "out/none.xml"), "pkg", "-k", "no_such_test"]) == NONE_FOUND
