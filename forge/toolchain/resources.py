"""The processors, memory and load within cgroups and affinity; tests simulate others below `root`."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from forge.base.files import text_or_nothing
from forge.base.frozen import frozen

ROOT = Path("/")
_UNITS = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}
_LEAST_SHARE, _LEAST_BYTES = 0.1, 1 << 30

LIBRARY_PATH_BELOW = "FORGE_LIBRARY_PATH_BELOW"
"""The variable with LD_LIBRARY_PATH without the packages of the workspace."""


@frozen
class Memory:
    """Bytes of memory: the total within limits, and the available part."""

    total: int
    available: int


@frozen
class MemoryLimit:
    """The memory use above which new jobs wait: a share, or bytes; no limit if both are None."""

    share: float | None = None
    size: int | None = None

    def left(self, memory: Memory) -> float:
        """Return the bytes that may still be used; negative if too much is in use, infinite without limit."""
        used = memory.total - memory.available
        share = float("inf") if self.share is None else self.share * memory.total
        return min(share, float("inf") if self.size is None else self.size) - used

    def exceeded(self, memory: Memory) -> bool:
        return self.left(memory) < 0


def default_memory_limit(memory: Memory) -> MemoryLimit:
    """Return the default limit, which keeps 10 % or 1 GiB free, whichever is less."""
    return MemoryLimit(size=memory.total - int(min(_LEAST_SHARE * memory.total, _LEAST_BYTES)))


def memory_limit(text: str) -> MemoryLimit:
    """Parse '80%', '12G' or 'none'; raises ValueError for anything else."""
    if text == "none":
        return MemoryLimit()
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*(%|[KMGT]?)(?:i?B)?", text, re.IGNORECASE)
    if not match or not float(match[1]):
        raise ValueError(f"'{text}' is neither a size nor a percentage of memory")
    number, unit = float(match[1]), match[2].upper()
    return MemoryLimit(share=number / 100) if unit == "%" else MemoryLimit(size=int(number * _UNITS[unit]))


def processors(root: Path = ROOT) -> int:
    """Return the number of usable processors; fractional cgroup quotas are rounded up."""
    usable = len(os.sched_getaffinity(0))
    for folder in _folders("cpu", root):
        if words := text_or_nothing(folder / "cpu.max").split():
            quota, period = int(words[0]) if words[0].isdigit() else -1, int(words[1])
        else:
            quota = _first_number(folder, "cpu.cfs_quota_us")
            period = _first_number(folder, "cpu.cfs_period_us")
        if quota > 0 and period > 0:
            usable = min(usable, -(-quota // period))
    return max(1, usable)


def memory(root: Path = ROOT) -> Memory | None:
    """Return the minimum of the machine's and the cgroups' memory; None if it is unknown."""
    fields = dict(re.findall(r"^(\w+):\s+(\d+) kB", text_or_nothing(root / "proc/meminfo"), re.MULTILINE))
    if "MemTotal" not in fields or "MemAvailable" not in fields:
        return None
    minimum = Memory(int(fields["MemTotal"]) << 10, int(fields["MemAvailable"]) << 10)
    for folder in _folders("memory", root):
        limit = _first_number(folder, "memory.max", "memory.limit_in_bytes")
        used = _first_number(folder, "memory.current", "memory.usage_in_bytes")
        if 0 < limit < minimum.total and used >= 0:
            left = max(0, limit - used + _reclaimable(folder))
            minimum = Memory(limit, min(minimum.available, left))
    return minimum


def load(root: Path = ROOT) -> float:
    """Return the load average of the last minute; 0 if it is unknown."""
    first = text_or_nothing(root / "proc/loadavg").partition(" ")[0]
    return float(first) if first else 0.0


def is_overloaded(limit: MemoryLimit | None, load_limit: float | None) -> bool:
    """Return whether to start no new jobs because of memory use or load."""
    if load_limit is not None and load() >= load_limit:
        return True
    now = memory()
    return now is not None and (limit or default_memory_limit(now)).exceeded(now)


def _folders(controller: str, root: Path) -> Iterator[Path]:
    """Yield the folders of our cgroup and its parents that may limit `controller`, for cgroup v2 and v1."""
    groups = {}
    for line in text_or_nothing(root / "proc/self/cgroup").splitlines():
        _, controllers, path = line.split(":", 2)
        groups.update(dict.fromkeys(controllers.split(","), path))
    for line in text_or_nothing(root / "proc/self/mountinfo").splitlines():
        mount, _, system = line.partition(" - ")
        kind, _, options = system.split(" ", 2)
        name = "" if kind == "cgroup2" else controller
        if kind in {"cgroup", "cgroup2"} and name in groups and (not name or name in options.split(",")):
            top, point = mount.split(" ")[3:5]
            group, base = groups[name], root / point.lstrip("/")
            # In a container the mount may show our cgroup as its root.
            inside = group.removeprefix(top.rstrip("/")).strip("/") if group.startswith(top) else ""
            folder = base / inside
            yield folder
            while folder != base:
                folder = folder.parent
                yield folder


def _reclaimable(folder: Path) -> int:
    """Return the bytes of a cgroup that can be reclaimed: page cache and kernel caches."""
    pairs = re.findall(r"^(\w+) (\d+)$", text_or_nothing(folder / "memory.stat"), re.MULTILINE)
    values: dict[str, str] = dict(pairs)
    # In version 1, only the names with the prefix total_ include child groups.
    names = ("inactive_file", "active_file", "slab_reclaimable")
    return sum(int(values.get(f"total_{name}", values.get(name, "0"))) for name in names)


def _first_number(folder: Path, *names: str) -> int:
    """Return the number in the first existing file; -1 for none and for 'max'."""
    first = next((text for name in names if (text := text_or_nothing(folder / name).strip())), "")
    return int(first) if first.isdigit() else -1
