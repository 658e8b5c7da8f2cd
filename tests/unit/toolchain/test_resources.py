"""Processors and memory of simulated machines, and how compilers share them."""

import os

import pytest

from forge.toolchain.resources import (
    Memory,
    MemoryLimit,
    default_memory_limit,
    is_overloaded,
    load,
    memory,
    memory_limit,
    processors,
)
from tests.conftest import Tree

MEMINFO = "MemTotal:       16777216 kB\nMemFree:  1 kB\nMemAvailable:    8388608 kB\n"
GIB = 1 << 30
V2 = {
    "proc/self/cgroup": "0::/user/build\n",
    "proc/self/mountinfo": "31 23 0:28 / /sys/fs/cgroup rw - cgroup2 cgroup2 rw\n",
}
V1 = {
    "proc/self/cgroup": "9:name=systemd:/\n4:memory:/docker/1\n2:cpu,cpuacct:/docker/1\n",
    "proc/self/mountinfo": (
        "30 23 0:27 / / rw - ext4 /dev/sda rw\n"
        "31 23 0:28 /docker/1 /sys/fs/cgroup/cpu,cpuacct rw shared:1 - cgroup cgroup rw,cpu,cpuacct\n"
        "32 23 0:29 /docker/1 /sys/fs/cgroup/memory rw shared:2 - cgroup cgroup rw,memory\n"
    ),
}
HERE = len(os.sched_getaffinity(0))


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        ({}, HERE),
        (V2, HERE),
        ({**V2, "sys/fs/cgroup/user/build/cpu.max": "max 100000\n"}, HERE),
        ({**V2, "sys/fs/cgroup/user/build/cpu.max": "50000 100000\n"}, 1),
        ({**V2, "sys/fs/cgroup/user/build/cpu.max": "120000 100000\n"}, min(HERE, 2)),
        ({**V2, "sys/fs/cgroup/user/cpu.max": "100000 100000\n"}, 1),
        ({**V1, "sys/fs/cgroup/cpu,cpuacct/cpu.cfs_quota_us": "-1\n"}, HERE),
        (
            {
                **V1,
                "sys/fs/cgroup/cpu,cpuacct/cpu.cfs_quota_us": "100000\n",
                "sys/fs/cgroup/cpu,cpuacct/cpu.cfs_period_us": "100000\n",
            },
            1,
        ),
    ],
)
def test_cpu_quotas_of_all_enclosing_cgroups_limit_the_processors(
    tree: Tree, files: dict[str, str], expected: int
) -> None:
    assert processors(tree(files)) == expected


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        ({}, None),
        ({"proc/meminfo": MEMINFO}, Memory(16 * GIB, 8 * GIB)),
        (
            {
                **V2,
                "proc/meminfo": MEMINFO,
                "sys/fs/cgroup/user/memory.max": f"{4 * GIB}\n",
                "sys/fs/cgroup/user/memory.current": f"{3 * GIB}\n",
                "sys/fs/cgroup/user/memory.stat": f"anon 1\ninactive_file 1\nactive_file {GIB - 1}\n",
                "sys/fs/cgroup/user/build/memory.max": "max\n",
                "sys/fs/cgroup/user/build/memory.current": "1\n",
            },
            Memory(4 * GIB, 2 * GIB),
        ),
        (
            {
                **V1,
                "proc/meminfo": MEMINFO,
                "sys/fs/cgroup/memory/memory.limit_in_bytes": f"{2 * GIB}\n",
                "sys/fs/cgroup/memory/memory.usage_in_bytes": f"{GIB}\n",
                "sys/fs/cgroup/memory/memory.stat": f"inactive_file 5\ntotal_inactive_file {GIB // 2}\n",
            },
            Memory(2 * GIB, GIB + GIB // 2),
        ),
    ],
)
def test_available_memory_is_the_minimum_of_machine_and_cgroups(
    tree: Tree, files: dict[str, str], expected: Memory | None
) -> None:
    assert memory(tree(files)) == expected


def test_the_resources_of_this_machine_are_detected() -> None:
    now = memory()
    assert now is not None
    assert 0 < now.available <= now.total
    assert load() >= 0
    assert not is_overloaded(MemoryLimit(), None)
    assert is_overloaded(MemoryLimit(size=1), None)
    assert is_overloaded(None, 0.0)


@pytest.mark.parametrize(
    ("text", "limit"),
    [
        ("80%", MemoryLimit(share=0.8)),
        ("12G", MemoryLimit(size=12 * GIB)),
        ("1.5GiB", MemoryLimit(size=3 * GIB // 2)),
        ("512mb", MemoryLimit(size=GIB // 2)),
        ("none", MemoryLimit()),
    ],
)
def test_a_memory_limit_is_a_percentage_or_a_size(text: str, limit: MemoryLimit) -> None:
    assert memory_limit(text) == limit


@pytest.mark.parametrize("text", ["", "0", "-1G", "much", "5%%"])
def test_an_invalid_memory_limit_is_rejected(text: str) -> None:
    with pytest.raises(ValueError, match=f"^'{text}' is neither a size nor a percentage of memory$"):
        memory_limit(text)


def test_the_default_memory_limit_keeps_a_tenth_free_but_at_most_one_gib() -> None:
    assert not default_memory_limit(Memory(4 * GIB, GIB // 2)).exceeded(Memory(4 * GIB, GIB // 2))
    assert default_memory_limit(Memory(4 * GIB, GIB // 3)).exceeded(Memory(4 * GIB, GIB // 3))
    assert not default_memory_limit(Memory(64 * GIB, GIB)).exceeded(Memory(64 * GIB, GIB))
    assert default_memory_limit(Memory(64 * GIB, GIB - 1)).exceeded(Memory(64 * GIB, GIB - 1))
    assert MemoryLimit(share=0.5).exceeded(Memory(4 * GIB, GIB))
    assert not MemoryLimit().exceeded(Memory(4 * GIB, 0))
