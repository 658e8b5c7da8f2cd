"""Parsers need linear time and memory, and reject input that is nested too deeply.

FORGE_FUZZ_SIZE is the size of the largest inputs in bytes. Processor time is measured. The limits are
generous: a quadratic parser takes sixteen times as long for four times the input.
"""

from __future__ import annotations

import os
import signal
import time
import tracemalloc

import pytest

from tests.fuzz.growth import SHAPES, Shape
from tests.fuzz.harnesses import HARNESSES

SIZE = int(os.environ.get("FORGE_FUZZ_SIZE", "8000"))
TIME_LIMIT = 30 + SIZE / 20_000
"""Seconds of processor time: seven times that of the slowest parser while coverage is measured."""

CASES = [
    pytest.param(name, shape, id=f"{name}-{shape.name}")
    for name, shapes in SHAPES.items()
    for shape in shapes
]


def seconds(name: str, data: bytes) -> float:
    """Return the processor time of a harness; fail the test if it exceeds the limit."""

    def stop(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, TIME_LIMIT)
    begun = time.process_time()
    try:
        HARNESSES[name](data)
    except TimeoutError:
        # No traceback: pytest itself fails on one that a signal interrupted in deep recursion.
        pytest.fail(f"{len(data)} bytes take more than {TIME_LIMIT} s", pytrace=False)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)
    return time.process_time() - begun


@pytest.mark.parametrize(("name", "shape"), CASES)
def test_parsing_time_is_linear(name: str, shape: Shape) -> None:
    for _ in range(3):
        short, long = (seconds(name, shape.of(size)) for size in (SIZE // 4, SIZE))
        if long <= 8 * short + 0.15:
            return
    pytest.fail(f"{long:.2f} s for {SIZE} bytes, {short:.2f} s for a quarter of them")


@pytest.mark.parametrize(("name", "shape"), CASES if "FORGE_FUZZ_SIZE" in os.environ else CASES[::12])
def test_parsing_memory_is_linear(name: str, shape: Shape) -> None:
    data = shape.of(SIZE // 8)
    HARNESSES[name](data[: len(data) // 2])  # what this loads is not counted
    tracemalloc.start()
    try:
        HARNESSES[name](data)
        assert tracemalloc.get_traced_memory()[1] < 4_000_000 + 1000 * len(data)
    finally:
        tracemalloc.stop()


def test_every_harness_has_growth_shapes() -> None:
    assert SHAPES.keys() == HARNESSES.keys()
