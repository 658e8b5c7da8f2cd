"""After any sequence of edits, an incremental build equals a clean one."""

import itertools
import os
import random
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from tests.conftest import Forge, Ran
from tests.evolving import (
    EDITS,
    LOW,
    LOW_MSGS,
    MADE,
    MESSAGES,
    NEEDS,
    PLAIN,
    PYTHON,
    Entry,
    Evolving,
    differences,
    look,
)
from tests.packages import manifest_text
from tests.snippets import shell
from tests.underlay_states import Below, below

Steps = Sequence[Sequence[tuple[str, int]]]
"""The edits, with their numbers, between one build and the next."""

pytestmark = [pytest.mark.slow, pytest.mark.needs("cmake", "g++")]

SEQUENCES = int(os.environ.get("FORGE_TEST_SEQUENCES", "200"))
"""How many sequences of edits of small packages are tried in all; `make soak` asks for more."""
INTERFACES = int(os.environ.get("FORGE_TEST_INTERFACE_SEQUENCES", "4"))
"""The same for interfaces, which take longer."""
SEED = int(os.environ.get("FORGE_TEST_SEED", "1"))

SETS = (" ".join(NEEDS), *3 * ("base user", "data reader", "maker taker", "script data"))
"""Packages that a workspace may have, for each of thirteen sequences; a few are built sooner than all."""


@dataclass(frozen=True, slots=True)
class Way:
    """How a workspace is built; `observed` with the observing library."""

    cached: bool
    observed: bool
    merged: bool
    symlink: bool

    def __str__(self) -> str:
        words = {
            "cached": self.cached,
            "unobserved": not self.observed,
            "merged": self.merged,
            "linked": self.symlink,
        }
        return "-".join(word for word, holds in words.items() if holds) or "plain"


WAYS = [Way(*flags) for flags in itertools.product((False, True), repeat=4)]
UNDERLAY = manifest_text(
    "all_of_it",
    *(f"<depend>{name}</depend>" for name in ("ament_cmake", "rosidl_default_generators", "std_msgs")),
    build_type="cmake",
)


class Clean:
    """Builds from nothing, in the folder of the workspace itself; equal ones are made once.

    With `cached` they are told of a cache, an empty one, since that changes what compilers are told.
    All are observed, which changes nothing that is installed.
    """

    def __init__(self, *, cached: bool = False) -> None:
        self._cached = cached
        self._trees: dict[str, Mapping[str, Entry]] = {}

    def knows(self, workspace: Evolving) -> bool:
        return workspace.key() in self._trees

    def tree(self, workspace: Evolving, build: Callable[..., Ran]) -> Mapping[str, Entry]:
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
    """A folder for all plays of this module, which is the same for each, and what they share."""

    root: Path
    underlay: Below
    clean: Mapping[bool, Clean]
    """By whether a cache is used."""

    def begin(self, files: Mapping[str, str], way: Way, build: Callable[[Evolving], Ran]) -> Evolving:
        """Return a workspace that has just been built, or a copy of an earlier one."""
        workspace = self.underlay.evolving(self.root, merged=way.merged, symlink=way.symlink)
        workspace.observed = way.observed
        begun = self.root.with_name(f"{way} {' '.join(sorted({name.split('/')[1] for name in files}))}")
        if begun.is_dir():
            shutil.rmtree(self.root)
            shutil.copytree(begun, self.root, symlinks=True)
            return workspace
        workspace.write(files)
        ran = build(workspace)
        assert ran.code == 0, ran.out + ran.err
        if not way.cached:  # The cache has a copy already.
            shutil.copytree(self.root, begun, symlinks=True)
        return workspace


def make_stage(root: Path, low: Mapping[str, str], prefix: Path | None = None) -> Stage:
    """Return a stage above an underlay in two states."""
    play = root / "play"
    play.mkdir(parents=True)
    clean = {cached: Clean(cached=cached) for cached in (False, True)}
    return Stage(play, below(root / "below", low, play / "under", prefix), clean)


def play(forge: Forge, stage: Stage, files: Mapping[str, str], way: Way, steps: Steps) -> None:
    """Build after each step, and hold what is installed in the end against a clean build.

    So is what is installed before, if a clean build of the same sources is known.
    """
    unobserved = () if way.observed else ("--no-observer",)
    cache = ("--cache", str(stage.root.with_name("cache"))) if way.cached else ()
    clean = stage.clean[way.cached]

    def run(workspace: Evolving, *words: str) -> Ran:
        return forge(
            *("--log-base", "/dev/null", "build", *words, *workspace.options()),
            cwd=workspace.home,
            env=workspace.variables,
        )

    def build(workspace: Evolving) -> Ran:
        return run(workspace, *unobserved, *cache)

    workspace = stage.begin(files, way, build)
    built = workspace.packages
    may: set[str] = set()
    waiting = [*steps]
    while waiting or workspace.broken:
        repairs = [("break", workspace.packages.index(name)) for name in sorted(workspace.broken)]
        for name, number in waiting.pop(0) if waiting else repairs:
            may |= EDITS[name](workspace, number)
        if not {*built} <= {*workspace.packages}:
            # What is left of a package that is gone is the user's to remove; forge warns of it.
            assert forge("clean", "--yes", "stale", cwd=workspace.home, env=workspace.variables).code == 0
        built = workspace.packages
        with workspace.saving() as saved:
            ran = build(workspace)
        if workspace.broken:
            assert ran.code in {1, 2}, ran.out  # 2 where a damaged hook of ours stays, too
            may |= saved
            continue
        assert ran.code == 0, ran.out + ran.err
        if saved:
            # It may have built either state; the next one has only one.
            assert _started(ran) <= may | saved, f"ran for nothing: {sorted(_started(ran) - may - saved)}"
            may = saved
            ran = build(workspace)
            assert ran.code == 0, ran.out + ran.err
        if not waiting or clean.knows(workspace):
            wrong = differences(look(workspace.home / "install"), clean.tree(workspace, run))
            if not way.observed:
                # Nobody knows whose file 'post.txt' is unless it was restored, nor whose an empty folder is.
                names = ("data", "maker") if way.merged else ("maker",)
                unknown = tuple(f"different: .forge_files/{name}.json:" for name in names)
                wrong = [line for line in wrong if not line.startswith(unknown)]
            assert not wrong, "; ".join(wrong)
        assert _started(ran) <= may, f"ran for nothing: {sorted(_started(ran) - may)}"
        may = set()
    again = _started(build(workspace))
    assert not again, f"ran again: {sorted(again)}"


def random_steps(chance: random.Random) -> Steps:
    """Return edits for one to four builds; some of them are made again, which may undo them."""
    steps: list[list[tuple[str, int]]] = []
    for _ in range(chance.choices((1, 2, 3, 4), (4, 3, 2, 1))[0]):
        edits = [(chance.choice(sorted(EDITS)), chance.randrange(100)) for _ in range(chance.randint(1, 3))]
        if steps and chance.random() < 0.2:
            edits[0] = chance.choice(steps[-1])
        steps.append(edits)
    return steps


def play_some(forge: Forge, stage: Stage, way: Way, count: int, kits: Sequence[Mapping[str, str]]) -> None:
    """Play many times, in workspaces of each of the kits in turn.

    Observed and unobserved builds play the same edits, and share clean builds.
    """
    chance = random.Random(f"{SEED} {replace(way, observed=True)}")
    for files in itertools.islice(itertools.cycle(kits), count):
        steps = random_steps(chance)
        try:
            play(forge, stage, files, way, steps)
        except AssertionError as error:
            packages = " ".join(sorted({name.split("/")[1] for name in files}))
            raise AssertionError(f"{packages}, edits before each build {steps}: {error}") from error


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Stage:
    """Return a stage for packages that know nothing of ROS."""
    return make_stage(tmp_path_factory.mktemp("plain"), LOW)


@pytest.fixture(scope="module")
def interface_stage(tmp_path_factory: pytest.TempPathFactory) -> Stage:
    """Return a stage for packages of interfaces."""
    root = tmp_path_factory.mktemp("interfaces")
    return make_stage(root, LOW_MSGS, underlay(root / "underlay"))


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_incremental_builds_of_plain_packages_match_clean_builds(
    forge: Forge, stage: Stage, way: Way
) -> None:
    files = {**PLAIN, **PYTHON, **MADE}
    kits = [{n: t for n, t in files.items() if n.split("/")[1] in kit.split()} for kit in SETS]
    play_some(forge, stage, way, -(-SEQUENCES // len(WAYS)), kits)


@pytest.mark.parametrize("way", [WAYS[0b0100], WAYS[0b1110], WAYS[0b0011], WAYS[0b1101]], ids=str)
def test_incremental_builds_of_interfaces_match_clean_builds(
    forge: Forge, interface_stage: Stage, way: Way
) -> None:
    play_some(forge, interface_stage, way, -(-INTERFACES // 4), [MESSAGES])
