"""Parsers return a value or one error for any bytes; FORGE_FUZZ_EXAMPLES inputs per parser."""

from __future__ import annotations

import os
import random

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from forge.plugins.package_cache import keys
from forge.plugins.package_cache.trees import decode_index
from tests.fuzz.food import SEEDS, mutated
from tests.fuzz.harnesses import HARNESSES

EXAMPLES = int(os.environ.get("FORGE_FUZZ_EXAMPLES", "12"))
SEED = int(os.environ.get("FORGE_TEST_SEED", "1"))


@pytest.mark.parametrize("name", HARNESSES)
def test_mutated_inputs_are_parsed_or_rejected(name: str) -> None:
    chance = random.Random(f"{name} {SEED}")
    for seed in SEEDS[name]:
        HARNESSES[name](seed)
    for _ in range(EXAMPLES):
        data = mutated(name, chance)
        try:
            HARNESSES[name](data)
        except BaseException as error:
            error.args = (*error.args, f"given {data!r}")
            raise


def test_cache_seeds_use_the_current_formats() -> None:
    assert all(map(decode_index, SEEDS["cached-tree"]))
    assert all(map(keys.decode_lists, SEEDS["cached-inputs"]))


@pytest.mark.parametrize("name", HARNESSES)
def test_any_bytes_are_parsed_or_rejected(name: str) -> None:
    @settings(max_examples=EXAMPLES, database=None, derandomize=True, suppress_health_check=list(HealthCheck))
    @given(st.one_of(st.binary(max_size=200), st.text(max_size=200).map(str.encode)))
    @example(b"")
    def check(data: bytes) -> None:
        HARNESSES[name](data)

    check()
