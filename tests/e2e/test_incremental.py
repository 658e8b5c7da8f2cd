"""After any sequence of edits, what an incremental build leaves is what a clean one makes."""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.evolving import EDITS, MESSAGES, PLAIN, PYTHON, Entry, Evolving, differences, look
from tests.packages import manifest_text
from tests.snippets import shell

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from tests.conftest import Forge, Ran

pytestmark = pytest.mark.needs("cmake", "g++")

EXAMPLES = int(os.environ.get("FORGE_TEST_EXAMPLES", "5"))
"""How many sequences each test tries; `make soak` asks for many."""

STEPS = st.lists(
    st.lists(st.tuples(st.sampled_from(sorted(EDITS)), st.integers(0, 99)), min_size=1, max_size=3),
    min_size=1,
    max_size=6,
)
SETTINGS = settings(
    max_examples=EXAMPLES,
    deadline=None,
    database=None,
    print_blob=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
UNDERLAY = manifest_text(
    "all_of_it",
    *(f"<depend>{name}</depend>" for name in ("ament_cmake", "rosidl_default_generators", "std_msgs")),
    build_type="cmake",
)


class Clean:
    """Builds from nothing, in the folder of the workspace itself; equal ones are made once.

    With `cached` they are told of a cache, an empty one, since that changes what compilers are told.
    """

    def __init__(self, *, cached: bool = False) -> None:
        """Begin with none."""
        self._cached = cached
        self._trees: dict[str, Mapping[str, Entry]] = {}

    def tree(self, workspace: Evolving, build: Callable[..., Ran]) -> Mapping[str, Entry]:
        """Return the install tree of a clean build."""
        key = workspace.key()
        if key not in self._trees:
            parked = workspace.root / "parked"
            workspace.home.rename(parked)
            shutil.copytree(parked / "src", workspace.home / "src", symlinks=True)
            empty = workspace.root / "empty"
            ran = build(workspace, *(("--cache", str(empty)) if self._cached else ()))
            shutil.rmtree(empty, ignore_errors=True)
            assert ran.code == 0, f"a clean build fails: {ran.err}"
            assert "came from the cache" not in ran.out
            self._trees[key] = look(workspace.home / "install")
            shutil.rmtree(workspace.home)
            parked.rename(workspace.home)
        return self._trees[key]


def underlay(root: Path) -> dict[str, str]:
    """Build everything that interface packages need; return the environment that has it."""
    (root / "src").mkdir(parents=True)
    (root / "src" / "package.xml").write_text(UNDERLAY, encoding="utf-8")
    (root / "src" / "CMakeLists.txt").write_text("project(all_of_it NONE)\n", encoding="utf-8")
    shell("forge build --merge-install", root)
    printed = shell(". install/setup.sh && env -0", root)
    variables = dict(entry.split("=", 1) for entry in printed.split("\0") if "=" in entry)
    return {n: v for n, v in variables.items() if n == "PYTHONPATH" or n.endswith("PREFIX_PATH")}


def play(
    forge: Forge,
    clean: Clean,
    workspace: Evolving,
    steps: Sequence[Sequence[tuple[str, int]]],
    *cache: str,
) -> None:
    """Build after each step and hold what is installed against a clean build."""

    def build(workspace: Evolving, *cache: str) -> Ran:
        return forge(
            "--log-base",
            "/dev/null",
            "build",
            *workspace.options(),
            *cache,
            cwd=workspace.home,
            env=workspace.variables,
        )

    ran = build(workspace, *cache)
    assert ran.code == 0, ran.err
    may: set[str] = set()
    for step in steps:
        for name, number in step:
            may |= EDITS[name](workspace, number)
        ran = build(workspace, *cache)
        started = {line.split()[2] for line in ran.out.splitlines() if line.startswith("Starting >>>")}
        if workspace.broken:
            assert ran.code in {1, 2}, ran.out  # 2 where a damaged hook of ours stays, too
            continue
        assert ran.code == 0, ran.err
        expected = clean.tree(workspace, build)
        wrong = differences(look(workspace.home / "install"), expected)
        assert not wrong, "; ".join(wrong)
        assert started <= may, f"ran for nothing: {sorted(started - may)}"
        may = set()


@dataclass(frozen=True, slots=True)
class Stage:
    """What the plays of this module share."""

    root: Path
    clean: Clean
    cached: Clean
    underlay: dict[str, str]

    @property
    def cache(self) -> tuple[str, str]:
        """One cache for all plays: what one of them built another finds."""
        return "--cache", str(self.root.with_name("cache"))


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Stage:
    """Return a folder for all plays, which is the same for each, and an underlay."""
    root = tmp_path_factory.mktemp("stage")
    return Stage(root / "play", Clean(), Clean(cached=True), underlay(root / "underlay"))


@given(merged=st.booleans(), python=st.booleans(), steps=STEPS)
@SETTINGS
def test_plain_packages_are_as_built_anew(
    forge: Forge, stage: Stage, *, merged: bool, python: bool, steps: list[list[tuple[str, int]]]
) -> None:
    workspace = Evolving(stage.root, merged=merged)
    workspace.write({**PLAIN, **(PYTHON if python else {})})
    play(forge, stage.clean, workspace, steps)


@given(merged=st.booleans(), steps=STEPS)
@SETTINGS
def test_interface_packages_are_as_built_anew(
    forge: Forge, stage: Stage, *, merged: bool, steps: list[list[tuple[str, int]]]
) -> None:
    workspace = Evolving(stage.root, merged=merged)
    workspace.write(MESSAGES)
    workspace.variables.update(stage.underlay)
    play(forge, stage.clean, workspace, steps)


@given(merged=st.booleans(), python=st.booleans(), steps=STEPS)
@SETTINGS
def test_what_comes_from_the_cache_is_as_built_anew(
    forge: Forge, stage: Stage, *, merged: bool, python: bool, steps: list[list[tuple[str, int]]]
) -> None:
    workspace = Evolving(stage.root, merged=merged)
    workspace.write({**PLAIN, **(PYTHON if python else {})})
    play(forge, stage.cached, workspace, steps, *stage.cache)


@given(merged=st.booleans(), steps=STEPS)
@SETTINGS
def test_interfaces_from_the_cache_are_as_built_anew(
    forge: Forge, stage: Stage, *, merged: bool, steps: list[list[tuple[str, int]]]
) -> None:
    workspace = Evolving(stage.root, merged=merged)
    workspace.write(MESSAGES)
    workspace.variables.update(stage.underlay)
    play(forge, stage.cached, workspace, steps, *stage.cache)
