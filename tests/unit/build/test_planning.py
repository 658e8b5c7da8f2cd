"""From packages, selection and snapshot to a plan."""

from dataclasses import replace
from pathlib import Path

import pytest

from forge.base.errors import WorkspaceError
from forge.base.layout import Layout
from forge.build.model import BuildInputs, BuildRecord, Fingerprint, Snapshot
from forge.build.planning import GlobalInputs, make_plan
from forge.build.recipes.context import BuildContext
from forge.build.tasks import BuildPlan
from forge.build.up_to_date import DependencyHashes, InputChange, InputKind, changed_input
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
INSTALLED = {name: Fingerprint("stamp", f"files of {name}") for name in ("e", "a", "b", "p")}
COMPLETE = Snapshot(present=frozenset({"e", "a", "b"}), sources=SOURCES)
GLOBAL = GlobalInputs("forge 1", (("c++", "12"), ("cmake", "3")), (("CXX", "g++"), ("ROS_DISTRO", "jazzy")))


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
    global_inputs: GlobalInputs = GLOBAL,
) -> BuildPlan:
    """Plan the names in the provision above."""
    return make_plan(names, RESOLUTION, snapshot, context, global_inputs)[0]


def built(*names: str) -> Snapshot:
    """Return the snapshot after a complete build of the names."""
    records: dict[str, BuildRecord] = {}
    hashes = DependencyHashes(RESOLUTION.needs, {n: INSTALLED[n].digest for n in names})
    for name, task in plan(*names).tasks.items():
        parts = replace(task.inputs, needs=hashes.needs_of(name, task.needs) or ())
        records[name] = BuildRecord(parts, complete=True, sources=SOURCES[name], installed=INSTALLED[name])
    return replace(
        COMPLETE,
        records=records,
        installed={n: INSTALLED[n] for n in names},
        present=frozenset(names),
    )


def reasons(
    snapshot: Snapshot, context: BuildContext = CONTEXT, global_inputs: GlobalInputs = GLOBAL
) -> dict[str, str]:
    """Return why each of e and a is not fresh."""
    found = plan("e", "a", snapshot=snapshot, context=context, global_inputs=global_inputs).tasks
    return {name: ("maybe " if task.conditional else "") + task.reason for name, task in found.items()}


AFTER = built("e", "a")
MAYBE = "maybe one of its dependencies is being rebuilt and may change"


@pytest.mark.parametrize(
    ("snapshot", "reason"),
    [
        (replace(AFTER, records={"a": AFTER.records["a"]}), "not built yet"),
        (
            replace(AFTER, records={**AFTER.records, "e": replace(AFTER.records["e"], complete=False)}),
            "the last build did not finish successfully",
        ),
        (
            replace(AFTER, installed={**INSTALLED, "e": Fingerprint("", "other")}),
            "an installed file was changed or removed",
        ),
        (replace(AFTER, present=frozenset({"a"})), "an installed file was changed or removed"),
        (
            replace(
                AFTER,
                changed_externals={"e": InputChange(InputKind.OUTSIDE, "the external input '/x.h' changed")},
            ),
            "the external input '/x.h' changed",
        ),
        (
            replace(AFTER, records={**AFTER.records, "e": replace(AFTER.records["e"], saved=("x.cpp",))}),
            "'x.cpp' was modified during the last build",
        ),
        (
            replace(
                AFTER,
                sources={**SOURCES, "e": Fingerprint("", "other")},
                source_changes={"e": "'x.cpp' and 1 more changed"},
            ),
            "'x.cpp' and 1 more changed",
        ),
        (
            replace(AFTER, sources={**SOURCES, "e": Fingerprint("", "other")}),
            "its sources changed",
        ),
    ],
)
def test_whatever_changed_is_the_reason_and_what_is_above_may_follow(snapshot: Snapshot, reason: str) -> None:
    assert reasons(snapshot) == {"e": reason, "a": MAYBE}


@pytest.mark.parametrize(
    ("context", "global_inputs", "reason"),
    [
        (replace(CONTEXT, cmake_args=("-DX=1",)), GLOBAL, "the option '-DX=1' was added"),
        (
            replace(CONTEXT, layout=replace(LAYOUT, merged=True)),
            GLOBAL,
            "the install layout changed from 'isolated' to 'merged'",
        ),
        (
            replace(CONTEXT, python=Path("/venv/bin/python3")),
            GLOBAL,
            "the Python interpreter changed from '/usr/bin/python3' to '/venv/bin/python3'",
        ),
        (CONTEXT, replace(GLOBAL, forge="forge 2"), "forge itself changed"),
        (CONTEXT, replace(GLOBAL, tools=(("c++", "12"), ("cmake", "4"))), "the tool 'cmake' changed"),
        (
            CONTEXT,
            replace(GLOBAL, environment=(("CXX", "g++"),)),
            "the environment variable 'ROS_DISTRO' changed",
        ),
        (CONTEXT, replace(GLOBAL, underlays="b"), "packages were added to or removed from an underlay"),
        (CONTEXT, replace(GLOBAL, force="--force", selected=frozenset({"e", "a"})), "requested by --force"),
    ],
)
def test_what_holds_for_all_is_a_reason_for_all(
    context: BuildContext, global_inputs: GlobalInputs, reason: str
) -> None:
    assert reasons(AFTER, context, global_inputs) == {"e": reason, "a": reason}


@pytest.mark.parametrize(
    ("context", "global_inputs", "reason"),
    [
        (
            replace(CONTEXT, cmake_args=("-DCMAKE_BUILD_TYPE=Debug",)),
            GLOBAL,
            "'-DCMAKE_BUILD_TYPE=Debug' was added",
        ),
        (
            replace(CONTEXT, cmake_args=("-D", "CMAKE_CXX_FLAGS:STRING=-g")),
            GLOBAL,
            "'-D CMAKE_CXX_FLAGS:STRING=-g' was added",
        ),
        (replace(CONTEXT, ament_cmake_args=("-DX=1",)), GLOBAL, "'-DX=1' was added"),
        (replace(CONTEXT, test_results=Path("/results")), GLOBAL, "'--test-result-base=/results' was added"),
        (
            replace(CONTEXT, path_maps=(("C", "-ffile-prefix-map=a=b"),)),
            GLOBAL,
            "a package cache is now used",
        ),
        (replace(CONTEXT, layout=replace(LAYOUT, symlink=True)), GLOBAL, "'--symlink-install' was added"),
        (CONTEXT, replace(GLOBAL, tools=(("c++", "13"), ("cmake", "3"))), "the tool 'c++' changed"),
        (
            CONTEXT,
            replace(GLOBAL, environment=(("CXX", "clang++"), ("ROS_DISTRO", "jazzy"))),
            "'CXX' changed",
        ),
    ],
)
def test_what_only_concerns_compiling_and_users_leaves_embedded_packages_alone(
    context: BuildContext, global_inputs: GlobalInputs, reason: str
) -> None:
    found = reasons(AFTER, context, global_inputs)
    assert found.keys() == {"a"}
    assert found["a"].endswith(reason)


def inputs(*cmake_args: str, context: BuildContext = CONTEXT) -> BuildInputs:
    """Return the inputs of a package with these arguments."""
    context = replace(context, cmake_args=cmake_args)
    return plan("e", "a", context=context).tasks["a"].inputs


def test_options_in_another_order() -> None:
    change = changed_input(inputs("-DX=1", "-DY=1"), inputs("-DY=1", "-DX=1"))
    assert change == InputChange(InputKind.OPTION, "the order of its options changed")


def test_a_package_of_ros_1_is_named_as_such() -> None:
    """A package.xml without a build type means catkin (REP 149): often the wrong branch of a repository."""
    with pytest.raises(WorkspaceError) as raised:
        make_plan(("a",), resolution(package("a", build_type="catkin")), Snapshot(), CONTEXT, GLOBAL)
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
def test_the_users_generator_wins_over_ninja(context: BuildContext) -> None:
    assert "Ninja" not in plan("a", context=context).tasks["a"].steps[0].argv


def test_a_load_limit_is_the_build_tools_to_keep_too() -> None:
    steps = plan("a", context=replace(CONTEXT, load_limit=2.5)).tasks["a"].steps
    assert steps[1].argv == ("/usr/bin/cmake", "--build", "/ws/build/a", "--", "-l2.5")
