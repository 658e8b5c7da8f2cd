"""Where Python finds a module, as an input of a build."""

from pathlib import Path

from forge.engine.world import MODULES, World
from tests.packages import write_files

FILES = {"venv/lark/__init__.py": "", "venv/lark/tools/__init__.py": "", "system/yaml.py": ""}


def answer(root: Path, *names: str) -> str:
    folders = f"{root}/install:{root}/venv:{root}/system"
    return World({}).answer(f"{MODULES}{folders} {','.join(names)}")


def test_module_locations_are_relative_to_the_search_path(tmp_path: Path) -> None:
    here, there = write_files(tmp_path / "here", FILES), write_files(tmp_path / "else/where", FILES)
    names = ("lark", "lark.tools", "yaml", "missing")
    assert answer(here, *names) == answer(there, *names)


def test_a_module_in_an_earlier_folder_changes_the_answer(tmp_path: Path) -> None:
    before = answer(write_files(tmp_path, FILES), "lark", "yaml")
    write_files(tmp_path, {"install/yaml.py": ""})
    assert answer(tmp_path, "lark", "yaml") != before
