"""A workspace of any number of packages, drawn like ROS 2's: who needs whom, how large, how long to build."""

from __future__ import annotations

import random
from bisect import bisect_right
from dataclasses import dataclass
from math import exp, log

SHARES = (0.0, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99, 1.0)
"""Which quantiles the tables below have, measured on 136 packages of ROS 2 Humble, built from source."""
NEEDS = (0, 0, 1, 3, 5, 10, 13, 15, 26, 27)
FILES = (19, 22, 23, 25, 32, 56, 144, 200, 711, 785)
SMALL_BYTES = (9043, 18966, 20895, 24602, 57052, 180811, 1088814, 4053283, 6255781, 8751532)
SECONDS = (0.1, 0.5, 0.6, 0.7, 1.2, 2.6, 34.2, 64.0, 318.6, 352.0)
LARGE = ((1_102_960, 1_384_464, 2_272_664, 6_568_592, 20_899_216), (127, 7, 1, 0, 0, 0, 1))
"""Sizes of files of a mebibyte or more, and how many packages have none, one, two, ... of them."""
INDEX_BYTES = 120
"""What the index of a package has for each file."""


@dataclass(frozen=True, slots=True)
class PackageCost:
    """What the cache keeps of a package, and what building it takes."""

    small: int
    large: tuple[int, ...]
    files: int
    seconds: float

    @property
    def index(self) -> int:
        """The bytes of its index."""
        return INDEX_BYTES * self.files

    @property
    def contents(self) -> int:
        """The bytes of all else."""
        return self.small + sum(self.large)

    @property
    def blobs(self) -> int:
        """How many blobs hold that: one for all small files, one for each large one."""
        return 1 + len(self.large)


@dataclass(frozen=True, slots=True)
class Town:
    """Packages by number: first the common ones, then those of each area; needs have lower numbers."""

    needs: tuple[tuple[int, ...], ...]
    users: tuple[tuple[int, ...], ...]
    costs: tuple[PackageCost, ...]
    common: int
    area: int

    def above(self, package: int) -> frozenset[int]:
        """Return the package and all that need it, however deep."""
        found = {package}
        waiting = [package]
        while waiting:
            for user in self.users[waiting.pop()]:
                if user not in found:
                    found.add(user)
                    waiting.append(user)
        return frozenset(found)

    def area_of(self, package: int) -> range:
        """Return the packages of the same area; the common ones are one of their own."""
        if package < self.common:
            return range(self.common)
        first = self.common + (package - self.common) // self.area * self.area
        return range(first, min(first + self.area, len(self.needs)))


def draw(packages: int, seed: int, *, common: int = 200, area: int = 100, local: float = 0.6) -> Town:
    """Return a workspace: `local` is the share of needs that lie in the same area, the rest is common.

    Of the common packages the first are needed most, the number n by 1/n of what the first one has.
    """
    chance = random.Random(seed)
    common = min(common, packages)
    needs = [_needs(number, common, area, local, chance) for number in range(packages)]
    users: list[list[int]] = [[] for _ in needs]
    for number, wanted in enumerate(needs):
        for need in wanted:
            users[need].append(number)
    costs = tuple(_package_cost(chance) for _ in needs)
    return Town(tuple(needs), tuple(map(tuple, users)), costs, common, area)


def between(values: tuple[float, ...], share: float) -> float:
    """Return the value below which that share lies, between two known ones as a power of the lower."""
    place = min(bisect_right(SHARES, share), len(SHARES) - 1)
    low, high = values[place - 1], values[place]
    way = (share - SHARES[place - 1]) / (SHARES[place] - SHARES[place - 1])
    if low <= 0:
        return low + (high - low) * way
    return exp(log(low) + (log(high) - log(low)) * way)


def _needs(number: int, common: int, area: int, local: float, chance: random.Random) -> tuple[int, ...]:
    wanted = min(round(between(NEEDS, chance.random())), number)
    first = common + (number - common) // area * area if number >= common else 0
    lower = min(number, common)
    found: set[int] = set()
    for _ in range(wanted):
        if number > first and (number < common or chance.random() < local):
            found.add(chance.randrange(first, number))
        else:
            # The inverse of a sum of 1/n: the number n is drawn with a chance of about 1/n.
            found.add(int(exp(chance.random() * log(lower + 1))) - 1)
    return tuple(sorted(found))


def _package_cost(chance: random.Random) -> PackageCost:
    """Return a package's size and duration; one that is large takes long."""
    share = chance.random()
    sizes, counts = LARGE
    (count,) = chance.choices(range(len(counts)), counts)
    large = tuple(chance.choice(sizes) for _ in range(count))
    small, files = (round(between(values, share)) for values in (SMALL_BYTES, FILES))
    return PackageCost(small, large, files, between(SECONDS, share))
