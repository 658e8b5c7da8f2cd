"""Packages are selected by earlier results."""

from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.selection import CHAIN, names


@pytest.fixture
def root(tree: Tree) -> Path:
    return tree(CHAIN)


@pytest.mark.parametrize(
    ("kind", "words"),
    [("build", ("build-failed", "build-finished")), ("test", ("test-failures", "test-passed"))],
)
def test_packages_can_be_selected_by_earlier_results(
    forge: Forge, root: Path, kind: str, words: tuple[str, str]
) -> None:
    failed, well = words
    for name, said in {"a": "0", "b": "1", "c": "SIGINT"}.items():
        (root / "out" / name).mkdir(parents=True)
        (root / "out" / name / f"colcon_{kind}.rc").write_text(f"{said}\n")
    assert names(forge, root, "--build-base", "out", f"--packages-select-{failed}") == "b"
    assert names(forge, root, "--build-base", "out", f"--packages-skip-{well}") == "b c d"
    assert names(forge, root, f"--packages-skip-{well}") == "a b c d"


def test_options_for_different_earlier_results_cannot_be_combined(forge: Forge, root: Path) -> None:
    ran = forge("list", "--packages-select-build-failed", "--packages-skip-test-passed", cwd=root)
    assert ran.code == 2
