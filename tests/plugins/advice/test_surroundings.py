"""Warnings about underlays and the interpreter."""

import os
from pathlib import Path

import pytest

from forge.environment.prefixes import Underlays
from forge.plugins.advice.surroundings import about_underlays, other_interpreter, overridden
from forge.toolchain.interpreter import Interpreter
from tests.installs import Made, make_install


def test_missing_prefixes_in_the_environment_are_reported(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    gone = [str(tmp_path / name) for name in ("a", "b", "c", "d", "e")]
    variables = {"AMENT_PREFIX_PATH": ":".join([str(tmp_path / "there"), "", *gone])}
    (problem,) = about_underlays(tmp_path, variables, Underlays(), "")
    listed = ", ".join(f"'{path}'" for path in gone[:3])
    assert problem.message == f"'AMENT_PREFIX_PATH' names {listed} and 2 more, which do not exist"
    root = tmp_path / "gone/install"  # an isolated underlay is reported once
    prefixes = os.pathsep.join(f"{root}/{name}" for name in "abc")
    variables = {"COLCON_PREFIX_PATH": f"{root}/", "AMENT_PREFIX_PATH": prefixes}
    (problem,) = about_underlays(tmp_path, variables, Underlays(), "")
    assert problem.message == f"'COLCON_PREFIX_PATH' names '{root}/', which does not exist"


@pytest.mark.parametrize("merged", [False, True])
def test_dependents_in_the_underlay_are_reported(merged: bool, tmp_path: Path) -> None:
    made = [Made("base"), *(Made(name, ("base",)) for name in "vwxyz"), Made("deep", ("v",)), Made("lonely")]
    root = make_install(tmp_path / "below", made, merged=merged).install
    own, variables = tmp_path / "install", {"COLCON_PREFIX_PATH": str(root)}
    (problem,) = overridden({"base", "lonely", "z"}, own, variables)
    assert problem.message == (
        f"'base' overrides the package in '{root}', on which 'v', 'w', 'x' and 1 more there depend"
    )
    (both,) = overridden({"base", "lonely", "v"}, own, variables)
    assert both.message == (
        f"'base', 'v' override the packages in '{root}', on which 'deep', 'w', 'x' and 2 more there depend"
    )
    assert list(overridden({"base", "deep", *"vwxyz"}, own, variables)) == []
    assert list(overridden({"mine"}, own, variables)) == []


def test_a_changed_interpreter_is_reported_with_the_option_that_restores_it() -> None:
    """Usually, the user forgot to activate an environment."""
    now = Interpreter(Path("/usr/bin/python3"), (3, 11), "'python3' on PATH")
    assert not [*other_interpreter(None, now), *other_interpreter("/usr/bin/python3", now)]
    (problem,) = other_interpreter("/a b/bin/python3", now)
    assert problem.render("warning") == (
        "warning: the interpreter is now '/usr/bin/python3' ('python3' on PATH) instead of "
        "'/a b/bin/python3'\n"
        "hint: packages that depend on it are rebuilt; to keep the old one, activate its environment or "
        "pass --python '/a b/bin/python3'"
    )
