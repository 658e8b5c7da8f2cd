"""A workspace for tests that select packages, and the names of those that are selected."""

from pathlib import Path

from tests.conftest import Forge
from tests.packages import manifest_text

CHAIN = {
    "src/a/package.xml": manifest_text("a"),
    "src/b/package.xml": manifest_text("b", "<depend>a</depend>"),
    "src/c/package.xml": manifest_text("c", "<depend>b</depend>"),
    "src/d/package.xml": manifest_text("d"),
}
"""Here c needs b needs a, and d stands alone."""


def names(forge: Forge, root: Path, *argv: str) -> str:
    ran = forge("list", "-n", *argv, cwd=root)
    assert ran.code == 0, ran.err
    return " ".join(ran.out.split())
