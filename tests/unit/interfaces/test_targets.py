"""Interface targets of other distributions."""

import re
from pathlib import Path

import pytest

from forge.base.errors import ForgeError
from forge.interfaces.model import Catalog
from forge.interfaces.writing import TARGETS
from tests.conftest import Forge, Tree
from tests.generated import render

EMPTY = Catalog("demo", {}, {}, {})
METADATA = "Metadata-Version: 2.1\nName: third\nVersion: 1.0\n"


@pytest.fixture
def third_party(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Install a distribution with valid and invalid targets, one of them named like forge's own."""
    entries = {
        "names": "third_names",
        "broken": "third_broken",
        "missing": "third_missing",
        "empty": "third_empty",
        "python": "third_names",
    }
    lines = "".join(f"{name} = {value}\n" for name, value in entries.items())
    root = tree(
        {
            "third_names.py": "from forge.interfaces.model import File\n"
            "def files(catalog):\n"
            "    lines = [f'{name}\\n' for name in catalog.interfaces]\n"
            "    yield File(f'{catalog.package}.txt', ''.join(lines))\n",
            "third_broken.py": "1 / 0\n",
            "third_empty.py": "",
            "third-1.0.dist-info/METADATA": METADATA,
            "third-1.0.dist-info/entry_points.txt": f"[forge.interfaces.targets]\n{lines}",
        }
    )
    monkeypatch.syspath_prepend(str(root))
    return root


@pytest.mark.usefixtures("third_party")
def test_third_party_targets_are_found(forge: Forge, tree: Tree) -> None:
    root = tree({"src/msg/A.msg": "int8 a", "src/msg/B.msg": ""})
    ran = forge(
        "interface", "generate", "--package", "p", "--output", "out", "--lang", "names", "src", cwd=root
    )
    assert (ran.code, ran.err) == (0, "")
    assert (root / "out/names/p.txt").read_text() == "p/msg/A\np/msg/B\n"


@pytest.mark.usefixtures("third_party")
def test_built_in_targets_take_precedence() -> None:
    assert all(file.path != "python/demo.txt" for file in render(EMPTY, "python"))


@pytest.mark.usefixtures("third_party")
@pytest.mark.parametrize(
    ("name", "cause"),
    [
        ("broken", "ZeroDivisionError: division by zero"),
        ("missing", "ModuleNotFoundError: No module named 'third_missing'"),
        ("empty", "it has no function 'files'"),
    ],
)
def test_unusable_targets_are_reported_with_the_cause(name: str, cause: str) -> None:
    with pytest.raises(ForgeError) as caught:
        render(EMPTY, name)
    message = f"the target '{name}' cannot be loaded from 'third_{name}': {cause}"
    assert caught.value.problems[0].message == message


@pytest.mark.usefixtures("third_party")
def test_an_unknown_target_lists_the_available_ones() -> None:
    """The list includes those of other distributions, and the hint starts with the nearest."""
    with pytest.raises(ForgeError) as caught:
        render(EMPTY, "nams")
    (problem,) = caught.value.problems
    assert problem.message == "unknown target 'nams'"
    assert problem.hint is not None
    assert problem.hint.startswith("did you mean 'names'? available targets: ")
    assert {*TARGETS, "names"} <= set(re.findall(r"\w+", problem.hint))
