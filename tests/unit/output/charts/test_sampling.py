"""Processor and memory usage, sampled a few times per second."""

from __future__ import annotations

import os
import threading
import time
from typing import TYPE_CHECKING

from forge.output.charts.sampling import Sampler, processor_times, sample_usage

if TYPE_CHECKING:
    from tests.conftest import Tree


def test_processor_time_is_split_into_busy_and_idle(tree: Tree) -> None:
    text = "cpu  10 2 3 100 5 1 1 4 7 0\ncpu0 10 2 3 100 5 1 1 4 7 0\n"
    assert processor_times(tree({"proc/stat": text})) == (21, 126)
    assert processor_times(tree({"other/file": ""}) / "other") is None
    assert processor_times(tree({"odd/proc/stat": "page 1 2\n"}) / "odd") is None


def test_a_busy_processor_is_sampled_as_busy() -> None:
    with sample_usage(wanted=True, period=0.02) as watch:
        end = time.monotonic() + 0.3
        while time.monotonic() < end:
            pass
        usage = watch.usage()
    assert usage is not None
    assert usage.processors == os.cpu_count()
    assert max(busy for _, busy, _ in usage.samples) > 0.3
    assert all(0 < used < usage.memory for _, _, used in usage.samples)
    times = [moment for moment, _, _ in usage.samples]
    assert times == sorted(times)


def test_nothing_is_sampled_unless_requested() -> None:
    threads = threading.active_count()
    with sample_usage(wanted=False) as watch:
        assert threading.active_count() == threads
        assert watch.usage() is None


def test_the_number_of_samples_is_bounded() -> None:
    sampler = Sampler(0.01, most=8)
    sampler.start()
    time.sleep(0.8)
    usage = sampler.usage()
    assert usage is not None
    assert 2 < len(usage.samples) <= 9
    # They still tell of the whole time.
    assert usage.samples[-1][0] - usage.samples[0][0] > 0.4
