"""`forge build --audit` with options of other plugins."""

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text


@pytest.mark.parametrize(
    "options",
    [
        ["--watch"],
        ["--executor", "dask", "--scheduler", "tcp://127.0.0.1:1"],
        ["--compiler-launcher", "ccache"],
        ["--target", "aarch64-linux-gnu"],
    ],
)
def test_options_that_prevent_observation_are_rejected(forge: Forge, tree: Tree, options: list[str]) -> None:
    root = tree({"src/a/package.xml": manifest_text("a")})
    ran = forge("build", "--audit", *options, cwd=root)
    assert ran.code == 2
    assert "--audit cannot be combined with" in ran.err
    assert not (root / "install").exists()
