"""Variables that would become too long are reported before the build."""

import subprocess
from pathlib import Path

import pytest

from forge.base.layout import Layout
from forge.build.tasks import BuildPlan, Task
from forge.plugins.advice.preflight import LIMIT, variable_length_problems
from tests.conftest import Forge, Tree
from tests.packages import manifest_text, package

SIZE = "'AMENT_PREFIX_PATH' would have 128 KiB, more than the limit of Linux, 128 KiB"
SITE = "lib/python3.11/site-packages"


def plan(packages: int, folder: str, *, chained: bool) -> tuple[BuildPlan, Layout]:
    """Return a plan for packages that need nothing, or all before them."""
    layout = Layout(Path("/build"), Path(folder), None)
    names = [f"p{number:04}" for number in range(packages)]
    tasks = {
        name: Task(
            name,
            package(name),
            layout.prefix(name),
            layout.build_dir(name),
            tuple(names[:number]) if chained else (),
            (),
            "",
        )
        for number, name in enumerate(names)
    }
    return BuildPlan(tasks), layout


def told(
    packages: int, folder: str, *, chained: bool = False, **variables: str
) -> tuple[list[str], list[str]]:
    """Return the messages of errors and of warnings."""
    made, layout = plan(packages, folder, chained=chained)
    table = {name: task.package for name, task in made.tasks.items()}
    errors, warnings = variable_length_problems(made, table, layout, SITE, variables)
    return [problem.message for problem in errors], [problem.message for problem in warnings]


def test_the_limit_matches_the_kernel() -> None:
    """One byte more, and nothing starts."""
    value = "x" * (LIMIT - len("A=") - 1)
    subprocess.run(["/bin/true"], env={"A": value}, check=True)
    with pytest.raises(OSError, match="too long"):
        subprocess.run(["/bin/true"], env={"A": value + "x"}, check=True)


def test_the_limit_is_exact_to_the_byte() -> None:
    """Each entry has its ':' or, the last one, the NUL."""
    folder = "/i" * 100
    entry = len(f"{folder}/p0000:")
    fits, rest = divmod(LIMIT - len("AMENT_PREFIX_PATH="), entry)
    assert told(fits, folder) == ([], [])
    assert told(fits + 1, folder)[1] == [f"no program could start after sourcing this workspace: {SIZE}"]
    before = "/" + "o" * (rest - 2)
    assert told(fits, folder, AMENT_PREFIX_PATH=before) == ([], [])
    assert told(fits, folder, AMENT_PREFIX_PATH=before + "o")[1] != []


def test_variables_too_long_for_the_build_are_an_error() -> None:
    """Once, with the first package that sees too much; then the warning says nothing new."""
    errors, warnings = told(140, "/a/" + "long/" * 200, chained=True)
    assert warnings == []
    assert errors == [
        f"'p0130' cannot be built: {SIZE}",
    ]


def test_merged_installs_have_one_path_entry() -> None:
    """However many packages there are."""
    made, layout = plan(140, "/a/" + "long/" * 200, chained=True)
    merged = Layout(layout.build, layout.install, None, merged=True)
    assert variable_length_problems(
        made, {n: t.package for n, t in made.tasks.items()}, merged, SITE, {}
    ) == ((), ())


def test_the_length_is_checked_before_the_build(forge: Forge, tree: Tree) -> None:
    """With the remedy, and nothing is run."""
    root = tree({"src/p/package.xml": manifest_text("p", build_type="ament_python"), "src/p/setup.py": ""})
    ran = forge("build", "--dry-run", cwd=root, env={"AMENT_PREFIX_PATH": "/" + "x" * (LIMIT - 30)})
    assert ran.code == 0
    assert f"no program could start after sourcing this workspace: {SIZE}\n" in ran.err
    assert "hint: build with '--merge-install' into a new install folder" in ran.err
