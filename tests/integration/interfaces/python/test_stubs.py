"""Type checkers accept and reject uses of generated Python by its stubs (PEP 561)."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import Tree
from tests.generated import RUNTIME, generate, probe_catalog

RIGHT = """
from array import array

import numpy as np
from numpy.typing import NDArray

from probe.action import Act
from probe.msg import Bound, Constants, Defaults, Fixed, Loose, Nested, Point, Property, Scalars, Words
from probe.srv import Point as Service


def everything() -> None:
    nested = Nested(point=Point(x=1.0))
    x: float = nested.point.x
    nested.header.stamp.sec = 5
    low: int = Constants.LOW
    raw: bytes = Constants().RAW
    some: array[int] = Defaults.SOME__DEFAULT
    loose = Loose(a_uint8=b"abc", points=[Point()])
    loose.a_float64 = [1.0, 2.0]
    loose.points.append(Point())
    numbers: array[float] = loose.a_float64
    fixed = Fixed()
    fixed.a_int16 = (1, 2, 3)
    fixed.a_float32 = np.zeros(3, np.float32)
    held: NDArray[np.float32] = fixed.a_float32
    Bound(texts={"a"}).texts.append("b")
    Scalars(octet=bytearray(b"x"), letter=1)
    words = Words(str="x", bytes=b"y")
    text: str = words.str
    named: str = Property(property="x").property
    request = Service.Request(a=Service.Request.LIMIT)
    goal: Act.Goal = Act.Impl.SendGoalService.Request().goal
    types: dict[str, str] = request.get_fields_and_field_types()
    print(x, low, raw, some, numbers, held, text, named, goal, types)
"""

WRONG = {
    "Point(x='a')": "arg-type",
    "Point(z=1.0)": "call-arg",
    "Point(1.0)": "call-arg",
    "Point().x = 'a'": "assignment",
    "Point().z = 1.0": "attr-defined",
    "Loose().texts = 5": "assignment",
    "Constants.LOW = 5": "misc",
}


@pytest.fixture(scope="module")
def stubs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Generate the package 'probe' with all it refers to."""
    folder = tmp_path_factory.mktemp("stubs")
    generate(folder, probe_catalog())
    return folder


def test_stubs_accept_valid_and_reject_invalid_uses(stubs: Path, tree: Tree) -> None:
    wrong = "".join(f"    {line}\n" for line in WRONG)
    root = tree({"right.py": RIGHT, "wrong.py": f"from probe.msg import *\n\ndef wrong() -> None:\n{wrong}"})
    variables = {"MYPYPATH": f"{stubs}:{RUNTIME}", "MYPY_CACHE_DIR": str(root / "cache")}
    argv = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", "right.py", "wrong.py"]
    ran = subprocess.run(argv, cwd=root, env=variables, check=False, capture_output=True, text=True)
    lines = ran.stdout.splitlines()
    found = [
        (line.split(":")[1], line.rpartition("[")[2].rstrip("]")) for line in lines if ": error: " in line
    ]
    assert found == [(str(number), code) for number, code in enumerate(WRONG.values(), start=4)], ran.stdout
    assert all(line.startswith("wrong.py") for line in lines)
