"""Single tests in the summary, and the commands that repeat them."""

import subprocess

import pytest

from tests.conftest import Forge, Tree
from tests.testable import CASES, failed_tests

pytestmark = pytest.mark.needs("cmake")


def test_a_failed_case_is_named_with_the_command_that_runs_it_alone(forge: Forge, built: Tree) -> None:
    root = built(CASES)
    ran = forge("test", cwd=root)
    names = ["p: Math.adds", "p: Other.fails", "p: plain"]
    names += ["u: tests.test_u.Values.test_bad", "y: tests.test_y.test_value[2]"]
    assert failed_tests(ran) == names
    command = next(line for line in ran.out.splitlines() if "Other.fails ctest" in line).partition(
        "repeat: "
    )[2]
    done = subprocess.run(["sh", "-c", command], cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode
    assert [line for line in done.stdout.splitlines() if "ran" in line] == ["1: ran Other.fails"]
