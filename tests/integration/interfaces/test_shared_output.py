"""Several packages share an output folder."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conftest import Forge, Ran, Tree
from tests.generated import run_python

Generate = Callable[..., Ran]

DEFINITIONS = {
    "a/msg/A.msg": "std_msgs/Header header\nshapes/Square square",
    "b/msg/B.msg": "std_msgs/String text",
    "c/msg/C.msg": "shapes/Circle circle",
    "shapes/msg/Square.msg": "float64 side",
    "shapes/msg/Circle.msg": "float64 radius",
    "shapes/msg/Unused.msg": "int8 unused",
}
SHAPES = ("--include", "shapes=shapes")


@pytest.fixture
def root(tree: Tree) -> Path:
    """Write the definitions of four packages."""
    return tree(DEFINITIONS)


@pytest.fixture
def generate(forge: Forge, root: Path) -> Generate:
    """Generate the Python of one package into the shared folder."""

    def run(package: str, *arguments: str) -> Ran:
        words = ("--package", package, "--output", "out", "--lang", "python", *arguments, package)
        return forge("interface", "generate", *words, cwd=root)

    return run


def _names(root: Path, namespace: str) -> str:
    return run_python(
        root / "out/python", f"import {namespace} as n; from {namespace} import *; print(*n.__all__)"
    )


def test_partial_runs_accumulate(generate: Generate, root: Path) -> None:
    """The second run does not pass the folder that only the first one needs."""
    assert generate("a", *SHAPES).code == 0
    assert generate("b").code == 0
    assert _names(root, "std_msgs.msg") == "Header String"
    assert generate("c", *SHAPES).code == 0
    assert _names(root, "shapes.msg") == "Circle Square"
    assert generate("b").out.startswith("0 of ")


def test_dependents_do_not_remove_files_of_a_generated_package(generate: Generate, root: Path) -> None:
    for package in ("a", "shapes", "a", "c"):
        assert generate(package, *SHAPES).code == 0
    assert _names(root, "shapes.msg") == "Circle Square Unused"


def test_files_that_no_package_needs_are_removed(generate: Generate, root: Path) -> None:
    generate("a", *SHAPES)
    generate("c", *SHAPES)
    (root / "c/msg/C.msg").write_text("int8 c")
    generate("c")
    generate("a", *SHAPES)
    assert _names(root, "shapes.msg") == "Square"
    assert not (root / "out/python/shapes/msg/_circle.py").exists()


def test_missing_definitions_are_reported_with_the_package_that_needs_them(
    generate: Generate, root: Path
) -> None:
    generate("a", *SHAPES)
    shutil.rmtree(root / "shapes")
    ran = generate("b")
    assert (ran.code, ran.err.splitlines()) == (
        2,
        [
            "error: cannot find 'shapes/msg/Square', which 'a' needs",
            "hint: generate 'a' again, or remove 'out'",
        ],
    )
