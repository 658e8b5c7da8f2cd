"""Processor and memory usage, sampled a few times per second."""

import time

from forge.plugins.charts.reporter import Sampler, processor_times
from forge.toolchain.resources import memory
from tests.conftest import Tree


def test_processor_time_is_split_into_busy_and_idle(tree: Tree) -> None:
    text = "cpu  10 2 3 100 5 1 1 4 7 0\ncpu0 10 2 3 100 5 1 1 4 7 0\n"
    assert processor_times(tree({"proc/stat": text})) == (21, 126)
    assert processor_times(tree({"other/file": ""}) / "other") is None
    assert processor_times(tree({"odd/proc/stat": "page 1 2\n"}) / "odd") is None


def test_a_busy_processor_is_sampled_as_busy() -> None:
    sampler = Sampler(0.02)
    end = time.monotonic() + 0.3
    while time.monotonic() < end:
        pass
    sampler.stop()
    machine = memory()
    assert machine is not None
    assert max(busy for _, busy, _ in sampler.samples) > 0.3
    assert all(0 < used < machine.total for _, _, used in sampler.samples)
    times = [moment for moment, _, _ in sampler.samples]
    assert times == sorted(times)


def test_a_stopped_sampler_takes_no_more_samples() -> None:
    sampler = Sampler(0.01)
    sampler.stop()
    taken = len(sampler.samples)
    time.sleep(0.1)
    sampler.stop()
    assert len(sampler.samples) == taken


def test_the_number_of_samples_is_bounded() -> None:
    sampler = Sampler(0.01, most=8)
    time.sleep(0.8)
    sampler.stop()
    assert 2 < len(sampler.samples) <= 9
    # They still cover the whole time.
    assert sampler.samples[-1][0] - sampler.samples[0][0] > 0.4
