"""`python -m tests.bench.fleet`: what a team's package cache has to carry, simulated; prints Markdown.

Developers and a CI farm work on one workspace for some days. Who asks the cache for which packages follows
from the dependency graph and from what forge's keys depend on: a change that comes out different gives all
packages above it new keys. Nothing is measured here; what is assumed stands in `Fleet`, and the shape of the
workspace in tests/bench/fleet_graph.py. The same seed prints the same bytes.
"""

from __future__ import annotations

import random
import sys
from bisect import bisect_right
from collections import OrderedDict, defaultdict
from dataclasses import dataclass, field, replace
from heapq import merge
from itertools import accumulate
from typing import TYPE_CHECKING

from tests.bench.fleet_graph import draw

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from tests.bench.fleet_graph import PackageCost, Town

_BIN = 10.0
"""Seconds over which a peak is taken."""
_REMARK = 400
"""Bytes of an answer that has no blob: a list of external files, a result, or 404."""


@dataclass(frozen=True, slots=True)
class Fleet:
    """Who works, how often, and what with. Times are seconds; a day is `hours` of work."""

    packages: int = 10_000
    developers: int = 100
    runners: int = 40
    days: int = 3
    hours: float = 10.0
    pulls: int = 3
    builds: int = 12
    pushes: int = 3
    """Pulls of main, builds between edits, and pushed states that CI builds, for each developer and day."""
    common_edits: float = 0.02
    """The share of changes that are made in a package of the common ones."""
    without_effect: float = 0.3
    """The share of changes after which the package comes out the same: nothing above it is looked at."""
    same_bytes: float = 0.7
    """The share of packages that are built since something below changed, and come out the same."""
    runner_bytes: float = 0.0
    """How much each CI machine keeps from one job to the next."""
    runner_cores: int = 32
    jobs: int = 8
    """Packages that each client looks up at a time."""
    latency: float = 0.001
    link: float = 125e6
    """Bytes a second between a client and the server."""
    seed: int = 1


@dataclass(slots=True)
class Tally:
    """What one kind of client did; a lookup is one question for the result of a package."""

    visits: int = 0
    lookups: int = 0
    hits: int = 0
    misses: int = 0
    requests: int = 0
    down: int = 0
    up: int = 0
    seconds: float = 0.0
    """Of one core, for what was built."""

    @property
    def rate(self) -> float:
        """The share of lookups that found something; 1 where nobody asked."""
        return self.hits / self.lookups if self.lookups else 1.0


@dataclass(slots=True)
class Cost:
    """Packages that were found, the requests that this took, and the bytes."""

    found: int = 0
    requests: int = 0
    down: int = 0

    def add(self, bundle: PackageCost, *, fetched: bool, times: int = 1) -> None:
        """Add a package, or take it away with `times` -1; without `fetched` its bytes are here already."""
        self.found += times
        self.requests += times * (3 + bundle.blobs * fetched)
        self.down += times * (2 * _REMARK + bundle.index + bundle.contents * fetched)


@dataclass(slots=True)
class Load:
    """What the server carries, in bins of time."""

    requests: dict[int, float] = field(default_factory=lambda: defaultdict(float))
    sent: dict[int, float] = field(default_factory=lambda: defaultdict(float))

    def add(self, begun: float, requests: int, sent: int, fleet: Fleet) -> float:
        """Spread a visit over the time that it takes; return that."""
        seconds = transfer_seconds(requests, sent, fleet)
        first, last = int(begun / _BIN), int((begun + seconds) / _BIN)
        for place in range(first, last + 1):
            self.requests[place] += requests / (last - first + 1)
            self.sent[place] += sent / (last - first + 1)
        return seconds


def transfer_seconds(requests: int, sent: int, fleet: Fleet) -> float:
    """Return how long a client takes that asks so much: it waits for answers, or for bytes."""
    return max(requests * fleet.latency / fleet.jobs, sent / fleet.link)


class World:
    """The workspace's main branch, what the server has of it, and what everybody does with both."""

    def __init__(self, fleet: Fleet, town: Town) -> None:
        """Begin with a state of main that CI has built."""
        self.fleet, self.town = fleet, town
        self.chance = random.Random(fleet.seed)
        self.tallies = {name: Tally() for name in ("pull", "edit", "push", "merge")}
        self.load = Load()
        self.commits: list[float] = []
        self.changed: OrderedDict[int, int] = OrderedDict()
        """Packages by the commit that gave them their present key, the latest last."""
        self.different: dict[int, int] = {}
        """The same for the commit since which they have their present bytes."""
        self.pending: dict[int, float] = {}
        """When the server will have the present results that it has not got yet."""
        self.history: dict[int, list[int]] = defaultdict(list)
        self.grown = 0
        """Bytes that were added to the server."""
        self.based = [0] * fleet.developers
        self.runner_at = [0] * fleet.runners
        self.jobs = 0
        sizes = [bundle.index + bundle.contents for bundle in town.costs]
        kept = bisect_right([*accumulate(reversed(sizes))], fleet.runner_bytes)
        self.forgotten = len(sizes) - kept
        """How many packages, the first ones of the order, a CI machine has no room for."""
        self.lost = Cost()
        """What looking up and fetching all of these costs."""
        for bundle in town.costs[: self.forgotten]:
            self.lost.add(bundle, fetched=True)

    def live(self) -> None:
        """Let the days pass."""
        for begun, who, what in self.events():
            if what == "pull":
                self.pull(begun, who)
            elif what == "edit":
                self.edit(begun, who)
            else:
                self.push(begun, who, merged=what == "merge")

    def events(self) -> Iterator[tuple[float, int, str]]:
        """Yield time, developer and what is done, in the order of time."""
        fleet = self.fleet
        often = {"pull": fleet.pulls, "edit": fleet.builds, "push": fleet.pushes, "merge": 1}
        streams = []
        for who in range(fleet.developers):
            found = []
            for day in range(fleet.days):
                for what, count in often.items():
                    found += [(self.moment(day, what, number), who, what) for number in range(count)]
            streams.append(sorted(found))
        return merge(*streams)

    def moment(self, day: int, what: str, number: int) -> float:
        """Return when something is done: most begin their day with a pull."""
        length = self.fleet.hours * 3600
        if what == "pull" and number == 0:
            return day * length + min(max(self.chance.gauss(3600, 1200), 0.0), length)
        return day * length + self.chance.uniform(0, length)

    def edited(self, who: int) -> int:
        """Return the package that a developer changes: of the area, those that few others need the most."""
        town = self.town
        areas = max(1, (len(town.needs) - town.common) // town.area)
        common = self.chance.random() < self.fleet.common_edits or len(town.needs) <= town.common
        own = range(town.common) if common else town.area_of(town.common + who % areas * town.area)
        # The rank from the top, where nobody waits, is drawn with a chance of about 1/n.
        rank = int(len(own) ** self.chance.random())
        return own[-min(rank, len(own))]

    def affected(self, package: int) -> frozenset[int]:
        """Return the packages that get new keys by a change."""
        if self.chance.random() < self.fleet.without_effect:
            return frozenset({package})
        return self.town.above(package)

    def since(self, commit: int) -> list[int]:
        """Return the packages whose key has changed since a commit."""
        found = []
        for package in reversed(self.changed):
            if self.changed[package] <= commit:
                break
            found.append(package)
        return found

    def pull(self, begun: float, who: int) -> None:
        """Bring a workspace to main: what has changed since is looked up, and built where it is not there."""
        based, self.based[who] = self.based[who], len(self.commits)
        cost, absent = Cost(), self.absent(begun)
        changed = self.since(based)
        for each in changed:
            if each not in absent:
                cost.add(self.town.costs[each], fetched=self.different.get(each, 0) > based)
        self.attempt("pull", begun, cost, absent.intersection(changed))

    def edit(self, begun: float, who: int) -> None:
        """Build what an edit changed of the own area; nobody has built that before."""
        package = self.edited(who)
        built = self.affected(package).intersection(self.town.area_of(package))
        self.attempt("edit", begun, Cost(), built)

    def push(self, begun: float, who: int, *, merged: bool) -> None:
        """Let CI build a change on the state that its branch began from, or on main, where it then is."""
        kind = "merge" if merged else "push"
        package, based = self.edited(who), self.based[who]
        affected = self.affected(package)
        # What the branch was built with is what main has now, unless somebody changed it in between.
        new = {each for each in affected if not merged or self.changed.get(each, 0) > based}
        cost, missing = self.job(
            len(self.commits) if merged else based, affected, self.absent(begun) | new, new
        )
        seconds = self.attempt(kind, begun, cost, missing)
        work = [self.town.costs[each].seconds for each in new]
        ended = begun + seconds + max(sum(work) / self.fleet.runner_cores, max(work, default=0.0))
        self.load.add(ended, *self.upload(self.tallies[kind], new, package), self.fleet)
        if merged:
            self.commit(begun, affected, package)
            self.pending.update(dict.fromkeys(new, ended))

    def job(
        self, upto: int, affected: frozenset[int], absent: Collection[int], new: Collection[int]
    ) -> tuple[Cost, set[int]]:
        """Return what a CI machine fetches, and what it looks up in vain.

        It asks for what it has no room for, and for what changed since its last job.
        """
        runner = self.jobs % self.fleet.runners
        self.jobs += 1
        seen, self.runner_at[runner] = self.runner_at[runner], upto
        cost, costs = replace(self.lost), self.town.costs
        for each in absent:
            if each < self.forgotten:
                cost.add(costs[each], fetched=True, times=-1)
        changed = set(self.since(min(seen, upto)) if self.forgotten < len(costs) else ()) | affected
        for each in changed.difference(absent):
            if each >= self.forgotten:
                cost.add(costs[each], fetched=self.different.get(each, 0) > seen)
        return cost, {each for each in absent if each < self.forgotten or each in new or each in changed}

    def commit(self, begun: float, affected: frozenset[int], package: int) -> None:
        """Let main have a change."""
        self.commits.append(begun)
        number = len(self.commits)
        for each in affected:
            self.changed[each] = number
            self.changed.move_to_end(each)
            self.history[each].append(number)
            if each == package or self.chance.random() >= self.fleet.same_bytes:
                self.different[each] = number

    def absent(self, now: float) -> frozenset[int]:
        """Return the packages whose present result is not on the server yet."""
        self.pending = {each: time for each, time in self.pending.items() if time > now}
        return frozenset(self.pending)

    def attempt(self, kind: str, begun: float, cost: Cost, missing: Collection[int]) -> float:
        """Count what was found and what was not, which one request tells; return how long that takes."""
        tally = self.tallies[kind]
        requests, down = cost.requests + len(missing), cost.down + len(missing) * _REMARK
        tally.visits += 1
        tally.lookups += cost.found + len(missing)
        tally.hits += cost.found
        tally.misses += len(missing)
        tally.requests += requests
        tally.down += down
        tally.seconds += sum(self.town.costs[each].seconds for each in sorted(missing))
        return self.load.add(begun, requests, down, self.fleet)

    def upload(self, tally: Tally, packages: set[int], changed: int) -> tuple[int, int]:
        """Send results: for each blob a question and, where it is new, the bytes; return how much."""
        requests = sent = 0
        for each in sorted(packages):
            bundle = self.town.costs[each]
            new = each == changed or self.chance.random() >= self.fleet.same_bytes
            requests += 1 + bundle.blobs + 1 + new * bundle.blobs + 2
            sent += bundle.index + 2 * _REMARK + new * bundle.contents
        tally.requests += requests
        tally.up += sent
        self.grown += sent
        return requests, sent


def kept_share(world: World, room: float, visits: int = 200) -> tuple[int, int]:
    """Return how many results an older state of main asks for, and how many of these a server still has.

    The server has the present state and `room` bytes more, and what was replaced first goes first. The older
    states are those of the simulated days, each as likely.
    """
    chance = random.Random(world.fleet.seed)
    whole = max(1, len(world.commits))
    horizon = whole - room / (world.grown / whole) if world.grown else 0.0
    asked = found = 0
    for _ in range(visits):
        commit = chance.randrange(whole)
        for numbers in world.history.values():
            place = bisect_right(numbers, commit)
            if place < len(numbers):
                asked += 1
                found += numbers[place] >= horizon
    return asked, found


def simulate(fleet: Fleet, town: Town | None = None) -> World:
    """Return the world after its days."""
    world = World(fleet, town or draw(fleet.packages, fleet.seed))
    world.live()
    return world


def main() -> int:
    """Print the tables of docs/explanation/scale.md."""
    from tests.bench.fleet_page import page

    sys.stdout.write(page(Fleet()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
