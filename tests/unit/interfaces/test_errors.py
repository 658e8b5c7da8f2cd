"""Error messages of invalid definitions: tests/golden/interfaces/errors, a package per case."""

from pathlib import Path

import pytest

from tests.conftest import GOLDEN, Forge, Golden

CASES = sorted(path.name for path in (GOLDEN / "interfaces/errors").iterdir())


@pytest.mark.parametrize("case", CASES)
def test_all_problems_of_a_package_are_shown_in_one_run(
    case: str, forge: Forge, golden: Golden, tmp_path: Path
) -> None:
    folder = GOLDEN / "interfaces/errors" / case
    ran = forge("interface", "generate", "--package", "tour", "--output", str(tmp_path), "src", cwd=folder)
    assert (ran.code, ran.out) == (2, "")
    golden(f"interfaces/errors/{case}", {"stderr.txt": ran.err})
    assert list(tmp_path.iterdir()) == []
