"""Plans of packages: the generator and the limits of build tools."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from forge.base.layout import Layout
from forge.build.model import BuildInputs, Fingerprint, Snapshot
from forge.build.planning import make_plan
from forge.build.recipes.context import BuildContext
from forge.build.tasks import Step
from forge.workspace.resolve import DependencyResolution
from tests.packages import package

CONTEXT = BuildContext(
    root=Path("/ws"),
    layout=Layout(Path("/ws/build"), Path("/ws/install"), Path("/ws/log")),
    python=Path("/usr/bin/python3"),
    site_packages="lib/python3.11/site-packages",
    wheels=("/usr/bin/python3", "-m", "forge.cli.install_wheel"),
    generator=("/usr/bin/python3", "client.py"),
    cmake=Path("/usr/bin/cmake"),
    ninja=Path("/usr/bin/ninja"),
)


def steps(context: BuildContext) -> Sequence[Step]:
    """Return the steps that build the package 'a'."""
    resolution = DependencyResolution({"a": package("a")}, {"a": frozenset()})
    snapshot = Snapshot(sources={"a": Fingerprint("stamp", "sources of a")})
    return make_plan(("a",), resolution, snapshot, context, BuildInputs(), {})[0].tasks["a"].steps


@pytest.mark.parametrize(
    "context",
    [
        replace(CONTEXT, ninja=None),
        replace(CONTEXT, environment_generator="Unix Makefiles"),
        replace(CONTEXT, cmake_args=("-G", "Unix Makefiles")),
        replace(CONTEXT, cmake_args=("-GUnix Makefiles",)),
    ],
)
def test_the_generator_chosen_by_the_user_overrides_ninja(context: BuildContext) -> None:
    assert "Ninja" in steps(CONTEXT)[0].argv
    assert "Ninja" not in steps(context)[0].argv


def test_the_load_limit_is_passed_to_build_tools() -> None:
    build = steps(replace(CONTEXT, load_limit=2.5))[1]
    assert build.argv == ("/usr/bin/cmake", "--build", "/ws/build/a", "--", "-l2.5")
