"""Why a package is built, and what of its build folder is reused: decided in a world in memory.

A random package has commands that read, list and look for files, declared or not, and write more than their
rules say. After random changes, the native tool runs what the decision has left to it. It notices no time:
each file may be as old as it likes. What is in the build folder must be what a clean build makes.
"""

import itertools
import random
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import pytest

from forge.build.inputs.fingerprints import Changes
from forge.build.inputs.native_graph import Edge, NativeGraph
from forge.build.model import BuildInputs, BuildRecord, Fingerprint, Snapshot
from forge.build.reuse import Reuse, decide
from forge.build.up_to_date import COMMON_OPTIONS, InputChange, InputKind, reason_to_build
from forge.engine.accesses import Accesses, ObservedCommands

SOURCE, BUILD = "/ws/src/p", "/ws/build/p"
NAMES = tuple("abcdefgh")

Files = dict[str, str]
"""The world: the text of each file by its path."""


@dataclass(frozen=True)
class Command:
    """A command of the native tool: what its rule declares, and what it does besides."""

    output: str
    declared: tuple[str, ...]
    reported: tuple[str, ...] = ()
    """What it reads and writes to a depfile."""
    secret: tuple[str, ...] = ()
    """What it reads without saying so, if it exists."""
    lists: str = ""
    beside: str = ""
    """What it writes beside its output; only now and then, if this ends with '?'."""

    def run(self, files: Files) -> Accesses:
        """Write the outputs into the world, and return what was asked of it."""
        asked = (*self.declared, *self.reported, *self.secret)
        read = [path for path in asked if path in files]
        missing = [path for path in asked if path not in files]
        names = sorted(path for path in files if path.rpartition("/")[0] == self.lists)
        text = f"{self.output}({','.join(f'{path}={files[path]}' for path in read)};{','.join(names)})"
        text = str(hash_of(text))
        written = {self.output: text}
        side = self.beside.removesuffix("?")
        if side and (side == self.beside or int(text) % 2):
            written[side] = f"beside {text}"
        files |= written
        return Accesses(
            read=frozenset(read),
            listed=frozenset(filter(None, [self.lists])),
            searched=frozenset(path.rpartition("/")[0] for path in missing),
            written=frozenset(written),
        )

    @property
    def edge(self) -> Edge:
        """What build.ninja says of it."""
        return Edge("CUSTOM_COMMAND", (self.output,), self.declared)


def hash_of(text: str) -> int:
    """Return a short digest that is the same in every process."""
    return int.from_bytes(random.Random(text).randbytes(4), "big")


@dataclass
class Package:
    """A random package in a world."""

    chance: random.Random
    files: Files = field(default_factory=dict)
    commands: list[Command] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Write some sources and commands; each may use what those before it have made."""
        chance = self.chance
        for name in NAMES:
            if chance.random() < 0.7:
                self.files[f"{SOURCE}/{chance.choice(('', 'x/'))}{name}"] = str(chance.randrange(3))
        for number in range(chance.randrange(1, 6)):
            earlier = [command.output for command in self.commands]
            declared = chance.sample(earlier, min(len(earlier), chance.randrange(3)))
            above = self.above(declared)
            # Which secretly read what somebody makes who need not have run is no rule of a sane package.
            sides = [command.beside.removesuffix("?") for command in above if command.beside]
            self.commands.append(
                Command(
                    f"{BUILD}/{number}.o",
                    (*declared, *self.some_sources(2)),
                    self.some_sources(3),
                    (*self.some_sources(2), *chance.sample(sides, min(len(sides), chance.randrange(2)))),
                    chance.choice(("", "", SOURCE, f"{SOURCE}/x")),
                    chance.choice(("", f"{BUILD}/{number}.map", f"{BUILD}/{number}.su?")),
                )
            )

    def some_sources(self, limit: int) -> tuple[str, ...]:
        """Return paths of sources that exist or not."""
        paths = [f"{SOURCE}/{folder}{name}" for folder in ("", "x/") for name in NAMES]
        return tuple(self.chance.sample(paths, self.chance.randrange(limit + 1)))

    def above(self, outputs: list[str]) -> list[Command]:
        """Return the commands that have certainly run before one that uses these outputs."""
        found = [command for command in self.commands if command.output in outputs]
        for command in found:
            found += [each for each in self.commands if each.output in command.declared and each not in found]
        return found

    def change(self) -> Changes:
        """Edit, add and remove some sources."""
        before = {path: text for path, text in self.files.items() if path.startswith(SOURCE)}
        for _ in range(self.chance.randrange(1, 4)):
            path = f"{SOURCE}/{self.chance.choice(('', 'x/'))}{self.chance.choice(NAMES)}"
            if path in self.files and self.chance.random() < 0.4:
                del self.files[path]
            else:
                self.files[path] = str(self.chance.randrange(4))
        after = {path: text for path, text in self.files.items() if path.startswith(SOURCE)}
        both = before.keys() & after.keys()
        return Changes(
            frozenset(after.keys() - before.keys()),
            frozenset(before.keys() - after.keys()),
            frozenset(path for path in both if before[path] != after[path]),
        )

    def clean(self) -> Files:
        """Return the world after a clean build."""
        files = {path: text for path, text in self.files.items() if path.startswith(SOURCE)}
        for command in self.commands:
            command.run(files)
        return files


def missing_of(package: Package, files: Files) -> frozenset[str]:
    """Return what some command has looked for in vain."""
    asked = {path for each in package.commands for path in (*each.declared, *each.reported, *each.secret)}
    return frozenset(asked - files.keys())


def run_native_tool(package: Package, seen: dict[str, Accesses], dropped: frozenset[str]) -> int:
    """Remove what is not reused; run what lacks its output or uses what has just been made; count it."""
    for path in dropped:
        package.files.pop(path, None)
    made: set[str] = set()
    ran = 0
    for command in package.commands:
        known = {*command.declared, *command.reported}
        if command.output not in package.files or not made.isdisjoint(known):
            left = seen[command.output].written
            seen[command.output] = command.run(package.files)
            # As ObservedCommands.merged() does it.
            if any(path in package.files for path in left - seen[command.output].written):
                seen[command.output] |= Accesses(written=left)
            made.add(command.output)
            ran += 1
    return ran


def graph_of(package: Package) -> NativeGraph:
    """Return what a run of ninja knows of a package."""
    return NativeGraph(
        tuple(command.edge for command in package.commands),
        {command.output: command.reported for command in package.commands},
        tool="ninja",
    )


def test_reused_outputs_match_a_clean_build() -> None:
    """And many are reused: it would also hold if everything ran again."""
    ran, all_commands = 0, 0
    for seed in range(2000):
        package = Package(random.Random(seed))
        seen = {command.output: command.run(package.files) for command in package.commands}
        missing = missing_of(package, package.files)
        for _ in range(4):
            changes = package.change()
            commands = ObservedCommands(Accesses(), seen, missing, Accesses())
            decision = decide(graph_of(package), changes, commands, package.files.__contains__)
            assert decision.reuse is Reuse.EVERYTHING, seed
            ran += run_native_tool(package, seen, decision.dropped)
            all_commands += len(package.commands)
            missing |= missing_of(package, package.files)
            assert package.files == package.clean(), seed
    assert ran < 0.7 * all_commands


@pytest.mark.parametrize("unknown", ["blind", "outside", "no record"])
def test_a_partially_observed_command_reruns_in_a_new_folder(unknown: str) -> None:
    for seed in range(50):
        package = Package(random.Random(seed))
        seen = {command.output: command.run(package.files) for command in package.commands}
        one = package.chance.choice(package.commands).output
        if unknown == "no record":
            del seen[one]
        else:
            seen[one] = replace(seen[one], blind=unknown == "blind", outside=unknown == "outside")
        graph = NativeGraph(tuple(command.edge for command in package.commands), tool="ninja")
        commands = ObservedCommands(Accesses(), seen, frozenset(), Accesses())
        if changes := package.change():
            decision = decide(graph, changes, commands, package.files.__contains__)
            assert decision.reuse is Reuse.PRODUCTS, seed
            assert one in decision.dropped, seed


# --- why a package is built

NOW = BuildInputs(
    forge="1\nx\n3\n/here",
    options=(*COMMON_OPTIONS, "-DA=1"),
    tools=(("c++", "12"),),
    environment=(("CXX", "g++"),),
    sources="sources",
    needs=(("need", "1"),),
    underlays="underlays",
)
RECORD = BuildRecord(NOW, complete=True, installed=Fingerprint("", "installed"))
WORLD = Snapshot(
    present=frozenset({"p"}),
    installed={"p": Fingerprint("", "installed")},
    source_changes={"p": "'x' changed"},
)
OUTSIDE = InputChange(InputKind.OUTSIDE, "'/etc/x' changed")

State = tuple[BuildInputs, BuildRecord | None, Snapshot]


def with_other_option(number: int, now: BuildInputs, record: BuildRecord | None, world: Snapshot) -> State:
    options = (f"other {word}" if at == number else word for at, word in enumerate(now.options))
    return replace(now, options=tuple(options)), record, world


REASONS: dict[str, Callable[[BuildInputs, BuildRecord | None, Snapshot], State]] = {
    # The most significant comes first: what explains the others.
    "not built yet": lambda now, record, world: (now, None, world),
    "the last build did not finish": lambda now, record, world: (
        now,
        record and replace(record, complete=False),
        world,
    ),
    **{
        f"the {name} changed": partial(with_other_option, number)
        for number, name in enumerate(COMMON_OPTIONS)
    },
    "an installed file": lambda now, record, world: (
        now,
        record,
        replace(world, installed={"p": Fingerprint("", "edited")}),
    ),
    "'/etc/x' changed": lambda now, record, world: (
        now,
        record,
        replace(world, changed_externals={"p": OUTSIDE}),
    ),
    "'y' was modified during": lambda now, record, world: (
        now,
        record and replace(record, saved=("y",)),
        world,
    ),
    "forge": lambda now, record, world: (
        replace(now, forge=now.forge.replace("1", "2", 1)),
        record,
        world,
    ),
    "the tool 'c++'": lambda now, record, world: (replace(now, tools=(("c++", "13"),)), record, world),
    "the environment variable 'CXX'": lambda now, record, world: (
        replace(now, environment=(("CXX", "clang"),)),
        record,
        world,
    ),
    "the option": lambda now, record, world: (
        replace(now, options=(*now.options[:-1], "-DA=2")),
        record,
        world,
    ),
    "'x' changed": lambda now, record, world: (replace(now, sources="edited"), record, world),
    "the dependency 'need'": lambda now, record, world: (replace(now, needs=(("need", "2"),)), record, world),
    "packages were added to or removed from an underlay": lambda now, record, world: (
        replace(now, underlays="others"),
        record,
        world,
    ),
}
"""What changed, by the beginning of the reason that is told."""
LAYOUT_FIRST = "the install layout changed"


def expected(names: tuple[str, ...]) -> str:
    """Return the most significant reason; of the options of every package, the layout explains the others."""
    first = min(names, key=[*REASONS].index)
    common = {f"the {name} changed" for name in COMMON_OPTIONS}
    return LAYOUT_FIRST if first in common and LAYOUT_FIRST in names else first


def test_an_unchanged_package_is_up_to_date() -> None:
    assert reason_to_build("p", NOW, RECORD, WORLD) is None


@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_most_significant_change_is_the_reason(count: int) -> None:
    for names in itertools.combinations(REASONS, count):
        state: State = (NOW, RECORD, WORLD)
        for name in names:
            state = REASONS[name](*state)
        reason = reason_to_build("p", *state)
        assert reason is not None, names
        assert reason.text.startswith(expected(names)), names
