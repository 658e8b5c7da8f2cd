"""The simulated team: the same for the same seed, and nothing lost."""

from __future__ import annotations

from dataclasses import replace
from math import isclose

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.bench.fleet import Fleet, World, kept_share, simulate
from tests.bench.fleet_graph import FILES, SHARES, between, draw
from tests.bench.fleet_page import page

SMALL = Fleet(packages=400, developers=7, runners=3, days=1)

fleets = st.builds(
    replace,
    st.just(SMALL),
    packages=st.integers(1, 500),
    runner_bytes=st.sampled_from([0.0, 1e8, 1e12]),
    without_effect=st.floats(0, 1),
    same_bytes=st.floats(0, 1),
    common_edits=st.floats(0, 1),
    seed=st.integers(0, 1000),
)
few = settings(max_examples=15, deadline=None)


@few
@given(st.integers(1, 400), st.integers(0, 1000))
def test_a_random_workspace_has_an_order_and_knows_its_dependents(packages: int, seed: int) -> None:
    town = draw(packages, seed, common=30, area=20)
    assert all(need < number for number, needs in enumerate(town.needs) for need in needs)
    for number in range(0, packages, 37):
        above = town.above(number)
        assert number in above
        assert all(user in above for each in above for user in town.users[each])
        assert all(set(town.needs[each]) & above for each in above - {number})
        assert number in town.area_of(number)


def test_a_quantile_is_met_and_between_two_nothing_jumps() -> None:
    assert [round(between(FILES, share)) for share in SHARES] == list(FILES)
    drawn = [between(FILES, share / 1000) for share in range(1001)]
    assert drawn == sorted(drawn)


@few
@given(fleets)
def test_every_lookup_is_a_hit_or_a_miss_and_every_request_reaches_the_server(fleet: Fleet) -> None:
    world = simulate(fleet)
    tallies = world.tallies.values()
    for tally in tallies:
        assert tally.hits + tally.misses == tally.lookups
        assert tally.lookups <= tally.requests
        assert min(tally.hits, tally.misses, tally.down, tally.up) >= 0
    assert isclose(sum(world.load.requests.values()), sum(tally.requests for tally in tallies))
    assert world.grown == sum(tally.up for tally in tallies)
    assert world.tallies["edit"].hits == 0


@few
@given(fleets)
def test_more_room_never_finds_less(fleet: Fleet) -> None:
    world = simulate(fleet)
    found = [kept_share(world, share * world.grown, 20) for share in (0, 0.2, 0.5, 0.9, 1, 2)]
    assert [one for _, one in found] == sorted(one for _, one in found)
    asked, last = found[-1]
    assert last == asked


@few
@given(fleets)
def test_a_machine_that_keeps_more_asks_for_less(fleet: Fleet) -> None:
    rooms = (0.0, 1e8, 1e12)
    worlds = [simulate(replace(fleet, runner_bytes=room)) for room in rooms]
    fetched = [world.tallies["push"].down + world.tallies["merge"].down for world in worlds]
    assert fetched == sorted(fetched, reverse=True)


def test_a_change_without_effect_stops_at_its_package() -> None:
    world = simulate(replace(SMALL, without_effect=1.0))
    assert world.tallies["push"].misses == world.tallies["push"].visits
    quick = World(replace(SMALL, without_effect=0.0), draw(400, 1))
    assert quick.affected(0) == quick.town.above(0)


def test_the_same_seed_prints_the_same_page() -> None:
    assert page(SMALL) == page(SMALL)
    assert page(SMALL) != page(replace(SMALL, seed=2))
