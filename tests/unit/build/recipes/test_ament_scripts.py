"""When the scripts of a distribution's ament run in a warm process."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from forge.build.build_types import OWN
from forge.build.recipes.ament_scripts import are_worth_a_worker
from tests.packages import build_context, package

CONTEXT = replace(build_context(Path("/w s")), script_launcher=("/my python", "client.py", "--generator"))
PLAIN = replace(CONTEXT, script_launcher=())


def test_cmake_gets_a_file_and_the_result_is_the_same() -> None:
    ament = OWN["ament_cmake"]
    files = {path.name: text for path, text in ament.recipe(package("p"), CONTEXT).files}
    assert 'include("${CMAKE_CURRENT_LIST_DIR}/ament_scripts.cmake")' in files["project.cmake"]
    assert (
        'list(INSERT _forge_command 0 "/my python" "client.py" "--generator")' in files["ament_scripts.cmake"]
    )
    assert "ament_scripts.cmake" not in {path.name for path, _ in ament.recipe(package("p"), PLAIN).files}
    assert ament.options(package("p"), CONTEXT) == ament.options(package("p"), PLAIN)


def test_one_package_is_not_worth_a_worker(tmp_path: Path) -> None:
    context = replace(build_context(tmp_path), script_launcher=CONTEXT.script_launcher)
    packages = [package("a"), package("b"), package("c")]
    assert are_worth_a_worker(packages, context)
    assert not are_worth_a_worker(packages, replace(context, script_launcher=()))
    assert not are_worth_a_worker(packages[:1], context)
    for name in ("a", "b"):
        (tmp_path / "build" / name).mkdir(parents=True)
        (tmp_path / "build" / name / "CMakeCache.txt").touch()
    assert not are_worth_a_worker(packages, context)
