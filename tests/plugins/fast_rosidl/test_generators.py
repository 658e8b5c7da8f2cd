"""What generators share in the worker's process, and how one of them runs."""

import json
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from forge.plugins.fast_rosidl import generators
from forge.plugins.fast_rosidl.generators import Generators
from tests.rosidl import EMPY, MODULES, imported_anew

pytestmark = pytest.mark.needs(str(MODULES / "rosidl_parser"), str(EMPY["3"]))

PROBE = Path(generators.__file__).with_name("probes") / "Message.idl"
COUNT = """import sys
from rosidl_parser.definition import IdlLocator
from rosidl_parser.parser import parse_idl_file
first, second = (parse_idl_file(IdlLocator(sys.argv[3], "Message.idl")) for _ in range(2))
print(len(first.content.elements), first is second)
"""


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """Return an environment with Debian's EmPy and rosidl, but not its lark: this process has one."""
    folder = tmp_path / "modules"
    folder.mkdir()
    for name in ("em.py", "rosidl_parser", "rosidl_pycommon"):
        (folder / name).symlink_to(MODULES / name)
    return {"PYTHONPATH": str(folder)}


@pytest.fixture
def shared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Generators]:
    monkeypatch.setattr(sys, "argv", list(sys.argv))
    with imported_anew("em", "rosidl_parser", "rosidl_pycommon"):
        yield Generators(tmp_path / "cache")


def generator(folder: Path, text: str) -> list[str]:
    """Write a generator with its arguments; return its command line."""
    folder.mkdir(exist_ok=True)
    shutil.copy(PROBE, folder / "Message.idl")
    (folder / "arguments.json").write_text(json.dumps({"idl_tuples": [f"{folder}:Message.idl"]}))
    (folder / "generator.py").write_text(text)
    program = str(folder / "generator.py")
    return [
        sys.executable,
        program,
        "--generator-arguments-file",
        str(folder / "arguments.json"),
        str(folder),
    ]


def test_each_file_is_parsed_once(
    shared: Generators, environment: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    argv = generator(tmp_path / "a", COUNT.replace("argv[3]", "argv[-1]"))
    shared.prepare(argv, environment)
    assert [path.read_text() for path in (tmp_path / "cache").glob("*.parser")] == ["same"]
    shared.run(argv, environment)
    assert capsys.readouterr().out == "3 False\n"


def test_the_worker_switches_to_the_files_of_another_package(
    shared: Generators, environment: dict[str, str], tmp_path: Path
) -> None:
    for name in ("a", "b", "b"):
        shared.prepare(generator(tmp_path / name, ""), environment)
        assert {Path(path).parent.name for path in shared._contents} == {name}


def test_generators_that_cannot_be_prepared_run_as_commands(
    shared: Generators, environment: dict[str, str], tmp_path: Path
) -> None:
    argv = generator(tmp_path / "a", "")
    (tmp_path / "a/arguments.json").write_text("{")
    shared.prepare(argv, environment)
    shared.run(argv, environment)
