"""What this process may use of the machine: processors, memory, load; as cgroups and affinity allow.

Every function takes the folder that stands for '/', so that other machines can be told of in files.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path("/")
_UNITS = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}
_LEAST_SHARE, _LEAST_BYTES = 0.1, 1 << 30


@frozen
class Memory:
    """Bytes of memory: all that there is for us, and what is left of it."""

    total: int
    available: int


@frozen
class MemoryLimit:
    """How much memory may be in use before new jobs wait: a share of all, or bytes; both None: no limit."""

    share: float | None = None
    size: int | None = None

    def exceeded(self, memory: Memory) -> bool:
        """Tell if more is in use than may be."""
        used = memory.total - memory.available
        return (self.share is not None and used > self.share * memory.total) or (
            self.size is not None and used > self.size
        )


def careful(memory: Memory) -> MemoryLimit:
    """Return the limit for who asked for none: a tenth stays available, or a GiB if that is less."""
    return MemoryLimit(size=memory.total - int(min(_LEAST_SHARE * memory.total, _LEAST_BYTES)))


def memory_limit(text: str) -> MemoryLimit:
    """Read '80%', '12G' or 'none'; raises ValueError for anything else."""
    if text == "none":
        return MemoryLimit()
    found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*(%|[KMGT]?)(?:i?B)?", text, re.IGNORECASE)
    if not found or not float(found[1]):
        raise ValueError(text)
    number, unit = float(found[1]), found[2].upper()
    return MemoryLimit(share=number / 100) if unit == "%" else MemoryLimit(size=int(number * _UNITS[unit]))


def processors(root: Path = ROOT) -> int:
    """Return how many processors we may use: a part that a cgroup grants of one counts as a whole."""
    usable = len(os.sched_getaffinity(0))
    for folder in _folders("cpu", root):
        quota, period = _quota(folder)
        if quota > 0 and period > 0:
            usable = min(usable, -(-quota // period))
    return max(1, usable)


def memory(root: Path = ROOT) -> Memory | None:
    """Return the memory that is left, the least of machine and cgroups; None where nobody says."""
    said = dict(re.findall(r"^(\w+):\s+(\d+) kB", _text(root / "proc/meminfo"), re.MULTILINE))
    if "MemTotal" not in said or "MemAvailable" not in said:
        return None
    found = Memory(int(said["MemTotal"]) << 10, int(said["MemAvailable"]) << 10)
    for folder in _folders("memory", root):
        limit = _first_number(folder, "memory.max", "memory.limit_in_bytes")
        used = _first_number(folder, "memory.current", "memory.usage_in_bytes")
        if 0 < limit < found.total and used >= 0:
            left = max(0, limit - used + _reclaimable(folder))
            found = Memory(limit, min(found.available, left))
    return found


def load(root: Path = ROOT) -> float:
    """Return the load average of the last minute; 0 where nobody says."""
    first = _text(root / "proc/loadavg").partition(" ")[0]
    return float(first) if first else 0.0


def shortage(limit: MemoryLimit | None, load_limit: float | None) -> bool:
    """Tell if no job should be added now, for want of memory or because the machine has enough to do."""
    if load_limit is not None and load() >= load_limit:
        return True
    now = memory()
    return now is not None and (limit or careful(now)).exceeded(now)


def _folders(controller: str, root: Path) -> Iterator[Path]:
    """Yield the folders of our cgroup and those above it which may limit `controller`, in version 2 and 1."""
    groups = {}
    for line in _text(root / "proc/self/cgroup").splitlines():
        _, controllers, path = line.split(":", 2)
        groups.update(dict.fromkeys(controllers.split(","), path))
    for line in _text(root / "proc/self/mountinfo").splitlines():
        mount, _, system = line.partition(" - ")
        kind, _, options = system.split(" ", 2)
        name = "" if kind == "cgroup2" else controller
        if kind in {"cgroup", "cgroup2"} and name in groups and (not name or name in options.split(",")):
            top, point = mount.split(" ")[3:5]
            yield from _upwards(root / point.lstrip("/"), top, groups[name])


def _upwards(point: Path, top: str, group: str) -> Iterator[Path]:
    """Yield a cgroup's folder below its mount `point`, which shows the cgroup `top`, and those above.

    In a container the mount may show our group as its root, whatever its name outside.
    """
    inside = group.removeprefix(top.rstrip("/")).strip("/") if group.startswith(top) else ""
    folder = point / inside
    while True:
        yield folder
        if folder == point:
            return
        folder = folder.parent


def _quota(folder: Path) -> tuple[int, int]:
    words = _text(folder / "cpu.max").split()
    if words:
        return (int(words[0]) if words[0].isdigit() else -1), int(words[1])
    return _first_number(folder, "cpu.cfs_quota_us"), _first_number(folder, "cpu.cfs_period_us")


def _reclaimable(folder: Path) -> int:
    """Return the bytes that a cgroup uses and gives up when asked: pages of files, caches of the kernel."""
    found = re.findall(r"^(\w+) (\d+)$", _text(folder / "memory.stat"), re.MULTILINE)
    said: dict[str, str] = dict(found)
    # Version 1 tells of the group alone, and by these longer names of all groups below it too.
    names = ("inactive_file", "active_file", "slab_reclaimable")
    return sum(int(said.get(f"total_{name}", said.get(name, "0"))) for name in names)


def _first_number(folder: Path, *names: str) -> int:
    """Return the number in the first of the files that is there; -1 for none, and for 'max'."""
    said = next((text for name in names if (text := _text(folder / name).strip())), "")
    return int(said) if said.isdigit() else -1


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
