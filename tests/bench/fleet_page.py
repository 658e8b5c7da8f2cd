"""The tables of docs/explanation/scale.md, from simulated days."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from statistics import mean
from typing import TYPE_CHECKING

import jinja2

from tests.bench.fleet import Fleet, Tally, World, kept_share, simulate, transfer_seconds
from tests.bench.fleet_graph import draw

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.bench.fleet_graph import Town

_TEMPLATES = Path(__file__).parent / "templates"
_KINDS = {
    "pull": "a developer brings a clone to main",
    "edit": "a developer builds an edit",
    "push": "CI builds a pushed branch",
    "merge": "CI builds main",
}
_CASES = {"nothing": 0.0, "half of the workspace": 0.5, "all of it": 1.001}
_LINKS = {"1 Gbit/s, 1 ms away": (125e6, 0.001), "50 Mbit/s, 20 ms away": (6.25e6, 0.02)}
_BIN = 10.0


def page(fleet: Fleet) -> str:
    """Return the tables as Markdown."""
    town = draw(fleet.packages, fleet.seed)
    whole = sum(package.index + package.contents for package in town.costs)
    worlds = {
        name: simulate(replace(fleet, runner_bytes=share * whole), town) for name, share in _CASES.items()
    }
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES), undefined=jinja2.StrictUndefined, trim_blocks=True,
        lstrip_blocks=True, keep_trailing_newline=True, autoescape=False,
    )  # fmt: skip
    return environment.get_template("fleet.md.j2").render(
        fleet=fleet,
        workspace=_workspace(town, whole),
        visits=[_visits(name, world) for name, world in worlds.items()],
        server=[_server(name, world) for name, world in worlds.items()],
        clones=list(_clones(fleet, town)),
        rebuilds=list(_rebuilds(fleet, town)),
        rooms=list(_rooms(worlds["all of it"], whole)),
    )


def _workspace(town: Town, whole: int) -> dict[str, str]:
    above = [len(town.above(package)) - 1 for package in range(len(town.needs))]
    return {
        "needs": f"{mean(map(len, town.needs)):.1f}",
        "above": f"{sorted(above)[len(above) // 2]}",
        "most_above": f"{max(above):,}",
        "files": f"{sum(package.files for package in town.costs):,}",
        "gigabytes": f"{whole / 1e9:.1f}",
        "core_hours": f"{sum(package.seconds for package in town.costs) / 3600:.0f}",
    }


def _visits(name: str, world: World) -> dict[str, object]:
    return {
        "keeps": name,
        "rows": [_visit(word, world.tallies[kind], world) for kind, word in _KINDS.items()],
    }


def _visit(word: str, tally: Tally, world: World) -> tuple[str, ...]:
    days = world.fleet.days
    return (
        word,
        f"{tally.visits / days:,.0f}",
        f"{tally.lookups / tally.visits:,.0f}",
        f"{100 * tally.rate:.1f} %",
        f"{tally.requests / days:,.0f}",
        f"{tally.down / days / 1e9:,.1f}",
        f"{tally.up / days / 1e9:,.1f}",
        f"{tally.seconds / days / 3600:,.0f}",
    )


def _server(name: str, world: World) -> tuple[str, ...]:
    fleet = world.fleet
    seconds = fleet.days * fleet.hours * 3600
    requests, sent = world.load.requests.values(), world.load.sent.values()
    most = max(sent) * 8 / _BIN
    return (
        name,
        f"{sum(requests) / seconds:,.0f}",
        f"{max(requests) / _BIN:,.0f}",
        f"{sum(sent) * 8 / seconds / 1e6:,.0f}",
        f"{most / 1e6:,.0f}",
        f"{fleet.developers * 1e9 / most:,.0f}",
    )


def _clones(fleet: Fleet, town: Town) -> Iterator[tuple[str, ...]]:
    requests = sum(3 + package.blobs for package in town.costs)
    down = sum(800 + package.index + package.contents for package in town.costs)
    for name, (link, latency) in _LINKS.items():
        near = replace(fleet, link=link, latency=latency)
        yield (
            name,
            f"{requests:,}",
            f"{down / 1e9:.1f}",
            f"{transfer_seconds(requests, 0, near):,.0f}",
            f"{transfer_seconds(0, down, near):,.0f}",
        )


def _rebuilds(fleet: Fleet, town: Town) -> Iterator[tuple[str, ...]]:
    """Yield what a change comes to: at the root, in a common library, in an area, and at its top."""
    middle = town.common + town.area // 2
    places = {
        "the one that most others need": 0,
        f"common, number {town.common // 2}": town.common // 2,
        "in the middle of an area": middle,
        "at the top of an area": town.common + town.area - 1,
    }
    for name, package in places.items():
        above = town.above(package)
        work = sum(town.costs[each].seconds for each in above)
        chain = _longest(town, above)
        all_runners = max(chain, work / (fleet.runner_cores * fleet.runners))
        hours = f"{work / 3600:,.1f}"
        yield (
            name,
            f"{len(above):,}",
            hours,
            f"{max(chain, work / fleet.runner_cores) / 60:,.0f}",
            f"{all_runners / 60:,.0f}",
        )


def _longest(town: Town, packages: frozenset[int]) -> float:
    """Return how long the longest chain of some packages takes to build."""
    length: dict[int, float] = {}
    for each in sorted(packages):
        below = max((length[need] for need in town.needs[each] if need in length), default=0.0)
        length[each] = below + town.costs[each].seconds
    return max(length.values())


def _rooms(world: World, whole: int) -> Iterator[tuple[str, ...]]:
    daily = world.grown / world.fleet.days
    for days in (0.0, 0.5, 1.0, 2.0, float(world.fleet.days)):
        asked, found = kept_share(world, days * daily)
        size = f"{(whole + days * daily) / 1e9:.1f}"
        yield f"{days:g}", size, f"{100 * found / max(asked, 1):.0f} %"
