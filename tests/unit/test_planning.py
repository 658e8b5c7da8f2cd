"""From packages, selection and snapshot to a plan."""

from dataclasses import replace
from pathlib import Path

import pytest

from forge.errors import WorkspaceError
from forge.graph import ordered_names
from forge.layout import Layout
from forge.model import BuildPlan, Package, Selection, Snapshot
from forge.planning import make_plan, wanted_names
from forge.provision import Provision
from forge.recipes.cmake import jobs_given
from forge.recipes.kitchen import Kitchen
from tests.packages import package

LAYOUT = Layout(Path("/ws/build"), Path("/ws/install"), Path("/ws/log"))
KITCHEN = Kitchen(
    root=Path("/ws"),
    layout=LAYOUT,
    python=Path("/usr/bin/python3"),
    site_packages="lib/python3.11/site-packages",
    forge=("/usr/bin/python3", "-m", "forge"),
    jobs=4,
    cmake=Path("/usr/bin/cmake"),
    ninja=Path("/usr/bin/ninja"),
)
COMPLETE = Snapshot(installed=frozenset({"e", "a", "b"}))


def provision(*packages: Package) -> Provision:
    """Return the packages with the dependencies among them."""
    table = {p.name: p for p in packages}
    needs = {p.name: frozenset(d.name for d in p.manifest.dependencies if d.name in table) for p in packages}
    return Provision(table, needs)


PROVISION = provision(
    replace(package("e"), embedded=True, path=Path("/forge/embedded/e")),
    package("a", "e"),
    package("b", "a", build_type="cmake"),
    package("p", "b", build_type="ament_python"),
)


def plan(*names: str, snapshot: Snapshot = COMPLETE, kitchen: Kitchen = KITCHEN) -> BuildPlan:
    """Plan the names in the provision above."""
    return make_plan(names, PROVISION, snapshot, kitchen)


def test_a_cycle_is_named_by_its_shortest_way() -> None:
    needs = {"a": frozenset({"b"}), "b": frozenset({"c"}), "c": frozenset({"a", "b"}), "d": frozenset({"a"})}
    with pytest.raises(WorkspaceError) as error:
        ordered_names(needs)
    assert "in a circle: b -> c -> b" in error.value.problems[0].message


def test_embedded_packages_below_the_selected_are_built_whatever_is_selected() -> None:
    assert wanted_names(Selection(("b",)), PROVISION, PROVISION.needs) == ("e", "b")


def test_tasks_know_all_they_need_lowest_first() -> None:
    assert plan("e", "a", "b", "p").tasks["p"].needs == ("e", "a", "b")


def test_an_embedded_package_is_fresh_until_something_below_or_around_it_changes() -> None:
    first = plan("e", "a")
    records = {name: task.digest for name, task in first.tasks.items()}
    again = replace(COMPLETE, records=records)
    assert plan("e", "a", snapshot=again).fresh == ("e",)
    assert list(plan("e", "a", snapshot=again).tasks) == ["a"]
    assert not plan("e", snapshot=replace(again, sources={"e": "changed"})).fresh
    assert not plan("e", snapshot=replace(again, installed=frozenset())).fresh
    assert not plan("e", snapshot=again, kitchen=replace(KITCHEN, cmake_args=("-DX=1",))).fresh
    moved = replace(LAYOUT, merged=True)
    assert not plan("e", snapshot=again, kitchen=replace(KITCHEN, layout=moved)).fresh


def test_needs_that_are_not_installed_stop_the_build_before_it_starts() -> None:
    with pytest.raises(WorkspaceError) as error:
        plan("b", "p", snapshot=Snapshot())
    assert [problem.message for problem in error.value.problems] == [
        "'b' needs 'a', 'e', which are not built yet",
        "'p' needs 'a', 'e', which are not built yet",
    ]


def test_a_build_type_that_nobody_knows() -> None:
    with pytest.raises(WorkspaceError) as error:
        make_plan(("a",), provision(package("a", build_type="ament_cmak")), Snapshot(), KITCHEN)
    assert error.value.problems[0].hint == "did you mean 'ament_cmake'?"


def test_a_new_build_folder_is_configured_built_and_installed_with_ninja() -> None:
    steps = plan("a").tasks["a"].steps
    assert [step.label for step in steps] == ["cmake", "build", "install"]
    assert steps[0].argv == (
        "/usr/bin/cmake",
        "/ws/src/a",
        "-C",
        "/ws/build/a/handover/handover.cmake",
        "-G",
        "Ninja",
        "-DCMAKE_MAKE_PROGRAM=/usr/bin/ninja",
        "-DAMENT_CMAKE_SYMLINK_INSTALL=0",
        "-DCMAKE_INSTALL_PREFIX=/ws/install/a",
    )
    assert steps[1].argv == ("/usr/bin/cmake", "--build", "/ws/build/a", "--", "-j4", "-l4")


def labels(snapshot: Snapshot, kitchen: Kitchen = KITCHEN) -> list[str]:
    """Return the steps that package a takes."""
    return [step.label for step in plan("a", snapshot=snapshot, kitchen=kitchen).tasks["a"].steps]


def test_a_folder_is_configured_again_only_when_something_was_said_differently() -> None:
    record = plan("a").tasks["a"].steps[0].record
    assert record is not None
    configured = replace(COMPLETE, configured={"a": ("Ninja", record[1])})
    assert labels(configured) == ["build", "install"]
    for kitchen in (
        replace(KITCHEN, cmake_args=("-DX=1",)),
        replace(KITCHEN, layout=replace(LAYOUT, install=Path("/elsewhere"))),
        replace(KITCHEN, layout=replace(LAYOUT, symlink=True)),
        replace(KITCHEN, python=Path("/usr/bin/python3.12")),
        replace(KITCHEN, force_configure=True),
    ):
        assert labels(configured, kitchen) == ["cmake", "build", "install"]


@pytest.mark.parametrize(
    "kitchen",
    [
        replace(KITCHEN, ninja=None),
        replace(KITCHEN, environment_generator="Unix Makefiles"),
        replace(KITCHEN, cmake_args=("-G", "Unix Makefiles")),
        replace(KITCHEN, cmake_args=("-GUnix Makefiles",)),
    ],
)
def test_the_users_generator_wins_over_ninja(kitchen: Kitchen) -> None:
    assert "Ninja" not in plan("a", kitchen=kitchen).tasks["a"].steps[0].argv


def test_an_existing_folder_keeps_its_generator() -> None:
    snapshot = replace(COMPLETE, configured={"a": ("Unix Makefiles", "")})
    assert "-G" not in plan("a", snapshot=snapshot).tasks["a"].steps[0].argv


def test_links_are_for_the_workspaces_packages_only() -> None:
    linked = plan("e", "a", "p", kitchen=replace(KITCHEN, layout=replace(LAYOUT, symlink=True))).tasks
    assert linked["a"].steps[2].env == (("CMAKE_INSTALL_MODE", "ABS_SYMLINK_OR_COPY"),)
    assert "-DAMENT_CMAKE_SYMLINK_INSTALL=1" in linked["a"].steps[0].argv
    assert linked["e"].steps[2].env == ()
    assert "--link" in linked["p"].steps[0].argv


def test_the_python_step_repeats_by_hand() -> None:
    assert plan("p").tasks["p"].steps[0].argv[:6] == (
        "/usr/bin/python3",
        "-m",
        "forge.wheels",
        "/ws/src/p",
        "--package",
        "p",
    )


@pytest.mark.parametrize(
    "flags", ["-j4", "-j", "j4", "--jobs=3", "-l 2", "k -j8", "--load-average=2", " -j --x"]
)
def test_makeflags_may_limit_the_jobs(flags: str) -> None:
    assert jobs_given(flags)


@pytest.mark.parametrize("flags", ["", "-k", "--no-print-directory", "V=1", "-s", "k -- jobs=1"])
def test_makeflags_may_say_other_things(flags: str) -> None:
    assert not jobs_given(flags)
