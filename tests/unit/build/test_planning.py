"""Plans of packages: unsupported build types, generators and options."""

from dataclasses import replace
from pathlib import Path

import pytest

from forge.base.errors import WorkspaceError
from forge.base.layout import Layout
from forge.build.model import BuildInputs, Fingerprint, Snapshot
from forge.build.planning import make_plan
from forge.build.recipes.context import BuildContext
from forge.build.tasks import BuildPlan
from forge.workspace.model import Package
from forge.workspace.resolve import DependencyResolution
from tests.packages import package

LAYOUT = Layout(Path("/ws/build"), Path("/ws/install"), Path("/ws/log"))
LINKED, MOVED = replace(LAYOUT, symlink=True), replace(LAYOUT, build=Path("/b"))
CONTEXT = BuildContext(
    root=Path("/ws"),
    layout=LAYOUT,
    python=Path("/usr/bin/python3"),
    site_packages="lib/python3.11/site-packages",
    wheels=("/usr/bin/python3", "-m", "forge.cli.install_wheel"),
    generator=("/usr/bin/python3", "client.py"),
    cmake=Path("/usr/bin/cmake"),
    ninja=Path("/usr/bin/ninja"),
)
SOURCES = {name: Fingerprint("stamp", f"sources of {name}") for name in ("e", "a", "b", "p")}
COMPLETE = Snapshot(present=frozenset({"e", "a", "b"}), sources=SOURCES)
SHARED = BuildInputs(
    forge="forge 1",
    tools=(("c++", "12"), ("cmake", "3")),
    environment=(("CXX", "g++"), ("ROS_DISTRO", "jazzy")),
)


def resolution(*packages: Package) -> DependencyResolution:
    """Return the packages with the dependencies among them."""
    table = {p.name: p for p in packages}
    needs = {p.name: frozenset(d.name for d in p.manifest.dependencies if d.name in table) for p in packages}
    return DependencyResolution(table, needs)


RESOLUTION = resolution(
    replace(package("e"), embedded=True, path=Path("/forge/embedded/e")),
    package("a", "e"),
    package("b", "a", build_type="cmake"),
    package("p", "b", build_type="ament_python"),
)


def plan(
    *names: str,
    snapshot: Snapshot = COMPLETE,
    context: BuildContext = CONTEXT,
) -> BuildPlan:
    """Plan the names in the provision above."""
    return make_plan(names, RESOLUTION, snapshot, context, SHARED, {})[0]


def test_ros_1_packages_get_a_specific_error() -> None:
    """A package.xml without a build type means catkin (REP 149): often the wrong branch of a repository."""
    with pytest.raises(WorkspaceError) as raised:
        make_plan(("a",), resolution(package("a", build_type="catkin")), Snapshot(), CONTEXT, SHARED, {})
    assert str(raised.value).endswith(
        "error: unsupported build type 'catkin' of package 'a'\n"
        "hint: catkin, the build type of a package.xml that names none, is for ROS 1; "
        "check out a branch for ROS 2, add a build type, or pass --packages-skip a"
    )


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
    assert "Ninja" not in plan("a", context=context).tasks["a"].steps[0].argv


def test_the_load_limit_is_passed_to_build_tools() -> None:
    steps = plan("a", context=replace(CONTEXT, load_limit=2.5)).tasks["a"].steps
    assert steps[1].argv == ("/usr/bin/cmake", "--build", "/ws/build/a", "--", "-l2.5")
