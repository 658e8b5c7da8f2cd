"""From packages, selection and snapshot to a plan."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

import forge
from forge.base.errors import WorkspaceError
from forge.base.graph import ordered_names
from forge.base.layout import Layout
from forge.build.model import BuildInputs, BuildRecord, Fingerprint, Snapshot
from forge.build.planning import GlobalInputs, finalize_task, make_plan, names_to_build
from forge.build.recipes.context import COMPILING, BuildContext
from forge.build.tasks import BuildPlan
from forge.build.up_to_date import DependencyHashes, ExtraInputs, InputChange, InputKind, changed_input
from forge.workspace.model import Package, Selection
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


def test_a_cycle_is_named_by_its_shortest_way() -> None:
    needs = {"a": frozenset({"b"}), "b": frozenset({"c"}), "c": frozenset({"a", "b"}), "d": frozenset({"a"})}
    with pytest.raises(WorkspaceError) as error:
        ordered_names(needs)
    assert "dependency cycle: b -> c -> b" in error.value.problems[0].message


def test_embedded_packages_below_the_selected_are_built_whatever_is_selected() -> None:
    assert names_to_build(Selection(("b",)), RESOLUTION) == ("e", "b")


def test_tasks_know_all_they_need_lowest_first() -> None:
    needs = plan("e", "a", "b", "p").tasks["p"].needs
    assert tuple(needs) == ("e", "a", "b")
    assert len(needs) == 3
    assert "b" in needs
    assert "p" not in needs


def test_after_a_complete_build_everything_is_fresh() -> None:
    after = built("e", "a", "b", "p")
    assert plan("e", "a", "b", "p", snapshot=after) == BuildPlan({}, ("e", "a", "b", "p"))


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


def test_an_embedded_package_names_no_variable_of_those_that_it_is_not_told() -> None:
    folder = Path(forge.__file__).parent / "embedded"
    texts = [p.read_text() for p in folder.rglob("*") if p.suffix in {".cmake", ".in", ".txt"}]
    named = {name for text in texts for name in re.findall(r"\b(?:CMAKE)_\w+", text)}
    passed_on = {
        "CMAKE_BUILD_TYPE",
        "CMAKE_C_FLAGS",
        "CMAKE_CXX_FLAGS",
    }  # to Google Test, for tests of others
    assert {name for name in named if re.fullmatch(COMPILING, name)} <= passed_on


def test_what_conditions_make_of_a_manifest_is_an_option() -> None:
    more = replace(RESOLUTION.packages["a"].manifest, group_dependencies=("group",))
    packages = {**RESOLUTION.packages, "a": replace(RESOLUTION.packages["a"], manifest=more)}
    made, _ = make_plan(("e", "a"), replace(RESOLUTION, packages=packages), AFTER, CONTEXT, GLOBAL)
    assert {n: t.reason for n, t in made.tasks.items()} == {"a": "the evaluated package.xml changed"}


def test_what_a_package_names_counts_for_it_alone() -> None:
    def named(package: Package, _: Snapshot) -> ExtraInputs:
        return ExtraInputs(tools=(("protoc", "2"),)) if package.name == "a" else ExtraInputs()

    assert reasons(AFTER, CONTEXT, replace(GLOBAL, named=named)) == {"a": "the tool 'protoc' changed"}


def inputs(*cmake_args: str, context: BuildContext = CONTEXT) -> BuildInputs:
    """Return the inputs of a package with these arguments."""
    context = replace(context, cmake_args=cmake_args)
    return plan("e", "a", context=context).tasks["a"].inputs


@pytest.mark.parametrize(
    ("before", "reason"),
    [
        (inputs("-DX=1"), "the option '-DX=1' was removed"),
        (inputs(context=replace(CONTEXT, layout=LINKED)), "the option '--symlink-install' was removed"),
        (inputs(context=replace(CONTEXT, path_maps=(("C", "a=b"),))), "the package cache is no longer used"),
        (inputs(context=replace(CONTEXT, layout=MOVED)), "the build folder changed from '/b/a' to"),
    ],
)
def test_an_option_less(before: BuildInputs, reason: str) -> None:
    change = changed_input(inputs(), before)
    assert change is not None
    assert change.text.startswith(reason)


def test_an_option_with_another_value() -> None:
    change = changed_input(inputs("-DX=2"), inputs("-DX=1"))
    text = "the option '-DX=1' changed to '-DX=2'"
    assert change == InputChange(InputKind.OPTION, text, ("-DX=2",))


def test_interfaces_are_generated_in_another_way() -> None:
    fast = replace(inputs(), options=(*inputs().options, "fast rosidl"))
    kind, word = InputKind.OPTION, "--no-fast-rosidl"
    assert changed_input(inputs(), fast) == InputChange(kind, f"the option '{word}' was added", (word,))
    assert changed_input(fast, inputs()) == InputChange(
        kind, f"the option '{word}' was removed", (f"{word} (removed)",)
    )


def test_options_in_another_order() -> None:
    change = changed_input(inputs("-DX=1", "-DY=1"), inputs("-DY=1", "-DX=1"))
    assert change == InputChange(InputKind.OPTION, "the order of its options changed")


def test_a_conditional_task_is_decided_by_the_results_of_its_dependencies() -> None:
    changed = replace(AFTER, sources={**SOURCES, "e": Fingerprint("", "other")})
    made, hashes = make_plan(("e", "a"), RESOLUTION, changed, CONTEXT, GLOBAL)
    hashes.finish("e", INSTALLED["e"].digest)
    assert finalize_task(made.tasks["a"], hashes, AFTER.records["a"]) is None
    hashes = make_plan(("e", "a"), RESOLUTION, changed, CONTEXT, GLOBAL)[1]
    hashes.finish("e", "other files")
    task = finalize_task(made.tasks["a"], hashes, AFTER.records["a"])
    assert task is not None
    assert task.inputs.needs != AFTER.records["a"].inputs.needs


def test_the_installing_step_knows_what_is_installed() -> None:
    record = replace(AFTER.records["a"], files=("/ws/install/a/x",), complete=False)
    snapshot = replace(AFTER, records={"a": record}, listed={"a": ("/ws/install/a/killed",)})
    task = plan("a", snapshot=snapshot).tasks["a"]
    assert task.earlier == ("/ws/install/a/killed", "/ws/install/a/x")
    assert [step.replaces for step in task.steps] == [*[()] * (len(task.steps) - 1), task.earlier]


def test_needs_that_are_not_installed_stop_the_build_before_it_starts() -> None:
    with pytest.raises(WorkspaceError) as error:
        plan("b", "p", snapshot=Snapshot(sources=SOURCES))
    assert [problem.message for problem in error.value.problems] == [
        "'b' needs 'a', 'e', which are not built yet",
        "'p' needs 'a', 'e', which are not built yet",
    ]


def test_an_unknown_build_type_is_an_error() -> None:
    with pytest.raises(WorkspaceError) as error:
        make_plan(("a",), resolution(package("a", build_type="ament_cmak")), Snapshot(), CONTEXT, GLOBAL)
    hint = "did you mean 'ament_cmake'? Others need a plugin, see `forge extensions`"
    assert error.value.problems[0].hint == hint


def test_a_package_of_ros_1_is_named_as_such() -> None:
    """A package.xml without a build type means catkin (REP 149): often the wrong branch of a repository."""
    with pytest.raises(WorkspaceError) as raised:
        make_plan(("a",), resolution(package("a", build_type="catkin")), Snapshot(), CONTEXT, GLOBAL)
    assert str(raised.value).endswith(
        "error: unsupported build type 'catkin' of package 'a'\n"
        "hint: catkin, the build type of a package.xml that names none, is for ROS 1; "
        "check out a branch for ROS 2, add a build type, or pass --packages-skip a"
    )


def test_a_new_build_folder_is_configured_built_and_installed_with_ninja() -> None:
    steps = plan("a").tasks["a"].steps
    assert [step.label for step in steps] == ["cmake", "build", "install"]
    assert steps[0].argv == (
        "/usr/bin/cmake",
        *("-S", "/ws/src/a", "-B", "/ws/build/a"),
        "-C",
        "/ws/build/a/.forge/initial_cache.cmake",
        "-G",
        "Ninja",
        "-DCMAKE_MAKE_PROGRAM=/usr/bin/ninja",
        "-DCMAKE_INSTALL_PREFIX=/ws/install/a",
    )
    assert steps[1].argv == ("/usr/bin/cmake", "--build", "/ws/build/a")


def test_a_folder_is_configured_again_when_something_is_said_differently() -> None:
    """The words that the configure step leaves behind tell one configuration from another."""

    def said(context: BuildContext) -> str:
        record = plan("a", context=context).tasks["a"].steps[0].record
        assert record is not None
        return record[1]

    words = [
        said(context)
        for context in (
            CONTEXT,
            replace(CONTEXT, cmake_args=("-DX=1",)),
            replace(CONTEXT, layout=replace(LAYOUT, install=Path("/elsewhere"))),
            replace(CONTEXT, layout=replace(LAYOUT, symlink=True)),
            replace(CONTEXT, python=Path("/usr/bin/python3.12")),
        )
    ]
    assert len(set(words)) == len(words)
    assert said(CONTEXT) == words[0]


def test_cmake_can_be_asked_to_run_in_any_case() -> None:
    for context in (replace(CONTEXT, force_configure=True), replace(CONTEXT, clean_cache=True)):
        assert plan("a", context=context).tasks["a"].reconfigure
    assert not plan("a").tasks["a"].reconfigure


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


def test_a_package_that_calls_make_is_built_by_it_where_there_is_one() -> None:
    context = replace(CONTEXT, only_make=frozenset({"a"}), make=Path("/usr/bin/make"))
    assert plan("a", context=context).tasks["a"].steps[0].argv[7:9] == ("-G", "Unix Makefiles")
    assert "Ninja" in plan("a", context=replace(context, make=None)).tasks["a"].steps[0].argv
    assert "Ninja" in plan("b", context=context).tasks["b"].steps[0].argv


def test_links_are_for_the_workspaces_packages_only() -> None:
    linked = plan("e", "a", "p", context=replace(CONTEXT, layout=replace(LAYOUT, symlink=True))).tasks
    assert ("CMAKE_INSTALL_MODE", "ABS_SYMLINK_OR_COPY") in linked["a"].steps[2].env
    handed_over = dict(linked["a"].files)[Path("/ws/build/a/.forge/initial_cache.cmake")]
    assert 'set(AMENT_CMAKE_SYMLINK_INSTALL "1" CACHE' in handed_over
    assert linked["e"].steps[2].env == (("CMAKE_INSTALL_ALWAYS", "1"),)
    assert "--link" in linked["p"].steps[0].argv


def test_the_python_step_repeats_by_hand() -> None:
    assert plan("p").tasks["p"].steps[0].argv[:6] == (
        "/usr/bin/python3",
        "-m",
        "forge.cli.install_wheel",
        "/ws/src/p",
        "--package",
        "p",
    )


def test_a_load_limit_is_the_build_tools_to_keep_too() -> None:
    steps = plan("a", context=replace(CONTEXT, load_limit=2.5)).tasks["a"].steps
    assert steps[1].argv == ("/usr/bin/cmake", "--build", "/ws/build/a", "--", "-l2.5")
