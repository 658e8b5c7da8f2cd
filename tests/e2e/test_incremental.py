"""After any sequence of edits, an incremental build equals a clean one."""

import os
import shutil
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

from tests.conftest import Forge, Ran
from tests.evolving import EDITS, LOW, LOW_MSGS, MESSAGES, PLAIN, PYTHON, Entry, Evolving, differences, look
from tests.packages import manifest_text
from tests.snippets import shell
from tests.underlay_states import Below, below

Steps = Sequence[Sequence[tuple[str, int]]]
"""The edits, with their numbers, between one build and the next."""

pytestmark = [pytest.mark.slow, pytest.mark.needs("cmake", "g++")]

EXAMPLES = int(os.environ.get("FORGE_TEST_SEQUENCES", "3"))
"""How many sequences each of the four tests tries; `make soak` asks for many."""
FEWER = int(os.environ.get("FORGE_TEST_SEQUENCES", "2"))
"""The same for interfaces, which take longer; with the cache they are other ones."""
SEED = int(os.environ.get("FORGE_TEST_SEED", "1"))

STEPS = st.lists(
    st.lists(st.tuples(st.sampled_from(sorted(EDITS)), st.integers(0, 99)), min_size=1, max_size=3),
    min_size=1,
    max_size=6,
)


@dataclass(frozen=True, slots=True)
class Way:
    """How a workspace is built, and if it has a package of Python; `observed` with the observing library."""

    merged: bool
    symlink: bool
    python: bool
    observed: bool
    cached: bool = False


OBSERVED = st.sampled_from((True, True, True, False))
WAYS = st.builds(Way, st.booleans(), st.booleans(), st.booleans(), OBSERVED)
CACHED = st.builds(Way, st.booleans(), st.booleans(), st.booleans(), OBSERVED, st.just(value=True))
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
            assert ran.code == 0, f"a clean build fails: {ran.out}{ran.err}"
            assert "came from the cache" not in ran.out
            self._trees[key] = look(workspace.home / "install")
            shutil.rmtree(workspace.home)
            parked.rename(workspace.home)
        return self._trees[key]


def underlay(root: Path) -> Path:
    """Build everything that interface packages need; return its prefix."""
    (root / "src").mkdir(parents=True)
    (root / "src" / "package.xml").write_text(UNDERLAY, encoding="utf-8")
    (root / "src" / "CMakeLists.txt").write_text("project(all_of_it NONE)\n", encoding="utf-8")
    shell("forge build --merge-install", root)
    return root / "install"


def _started(ran: Ran) -> set[str]:
    return {line.split()[2] for line in ran.out.splitlines() if line.startswith("Starting >>>")}


@dataclass(frozen=True, slots=True)
class Stage:
    """What the plays of this module share."""

    root: Path
    clean: Clean
    cached: Clean
    plain: Below
    interfaces: Below

    @property
    def cache(self) -> tuple[str, str]:
        """One cache for all plays: what one of them built another finds."""
        return "--cache", str(self.root.with_name("cache"))


def make_stage(root: Path) -> Stage:
    """Return a folder for all plays, which is the same for each, and underlays."""
    under = root / "play" / "under"
    under.parent.mkdir()
    prefix = underlay(root / "underlay")
    plain = below(root / "plain", LOW, under)
    return Stage(
        root / "play", Clean(), Clean(cached=True), plain, below(root / "msgs", LOW_MSGS, under, prefix)
    )


def play(
    forge: Forge,
    stage: Stage,
    workspace: Evolving,
    steps: Steps,
    way: Way,
) -> None:
    """Build after each step and hold what is installed against a clean build."""
    cache = stage.cache if way.cached else ()
    clean = stage.cached if way.cached else stage.clean
    unobserved = () if way.observed else ("--no-observer",)

    def build(workspace: Evolving, *cache: str) -> Ran:
        return forge(
            "--log-base",
            "/dev/null",
            "build",
            *cache,
            *unobserved,
            *workspace.options(),
            cwd=workspace.home,
            env=workspace.variables,
        )

    ran = build(workspace, *cache)
    assert ran.code == 0, ran.out + ran.err
    may: set[str] = set()
    built = workspace.packages
    for step in steps:
        for name, number in step:
            may |= EDITS[name](workspace, number)
        if not {*built} <= {*workspace.packages}:
            # What is left of a package that is gone is the user's to remove; forge warns of it.
            assert forge("clean", "--yes", "stale", cwd=workspace.home, env=workspace.variables).code == 0
        with workspace.saving() as saved:
            ran = build(workspace, *cache)
        built = workspace.packages
        if workspace.broken:
            assert ran.code in {1, 2}, ran.out  # 2 where a damaged hook of ours stays, too
            may |= saved
            continue
        assert ran.code == 0, ran.out + ran.err
        if saved:
            # It may have built either state; the next one has only one.
            assert _started(ran) <= may | saved, f"ran for nothing: {sorted(_started(ran) - may - saved)}"
            may = saved
            ran = build(workspace, *cache)
            assert ran.code == 0, ran.out + ran.err
        started = _started(ran)
        expected = clean.tree(workspace, build)
        wrong = differences(look(workspace.home / "install"), expected)
        assert not wrong, "; ".join(wrong)
        assert started <= may, f"ran for nothing: {sorted(started - may)}"
        may = set()


@pytest.fixture(scope="module")
def stage(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    """Return what the plays share; say at the end how many there were."""
    tried.clear()
    yield make_stage(tmp_path_factory.mktemp("stage"))
    reporter = request.config.pluginmanager.get_plugin("terminalreporter")
    for name, number in tried.items():
        if reporter is not None:
            reporter.write_line(f"{name}: {number} sequences of edits, seed {SEED}")


tried: Counter[str] = Counter()
"""How many sequences each test has tried."""


@given(way=WAYS, steps=STEPS)
@seed(SEED)
@SETTINGS
def test_incremental_builds_of_plain_packages_match_clean_builds(
    forge: Forge, stage: Stage, *, way: Way, steps: Steps
) -> None:
    play_plain(forge, stage, way, steps)
    tried["plain packages"] += 1


@given(way=WAYS, steps=STEPS)
@seed(SEED)
@settings(SETTINGS, max_examples=FEWER)
def test_incremental_builds_of_interfaces_match_clean_builds(
    forge: Forge, stage: Stage, *, way: Way, steps: Steps
) -> None:
    play_interfaces(forge, stage, way, steps)
    tried["interfaces"] += 1


@given(way=CACHED, steps=STEPS)
@seed(SEED)
@SETTINGS
def test_cached_builds_match_clean_builds(forge: Forge, stage: Stage, *, way: Way, steps: Steps) -> None:
    play_plain(forge, stage, way, steps)
    tried["plain packages, cached"] += 1


@given(way=CACHED, steps=STEPS)
@seed(SEED + 1)
@settings(SETTINGS, max_examples=FEWER)
def test_cached_interfaces_match_clean_builds(forge: Forge, stage: Stage, *, way: Way, steps: Steps) -> None:
    play_interfaces(forge, stage, way, steps)
    tried["interfaces, cached"] += 1


def play_plain(forge: Forge, stage: Stage, way: Way, steps: Steps) -> None:
    """Play with packages that know nothing of ROS, and perhaps one of Python."""
    workspace = stage.plain.evolving(stage.root, merged=way.merged, symlink=way.symlink)
    workspace.write({**PLAIN, **(PYTHON if way.python else {})})
    play(forge, stage, workspace, steps, way)


def play_interfaces(forge: Forge, stage: Stage, way: Way, steps: Steps) -> None:
    """Play with packages of interfaces, and one that uses them."""
    workspace = stage.interfaces.evolving(stage.root, merged=way.merged, symlink=way.symlink)
    workspace.write(MESSAGES)
    play(forge, stage, workspace, steps, way)
