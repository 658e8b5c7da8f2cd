"""The command-line options for parallelism."""

from __future__ import annotations

from forge.base.frozen import frozen
from forge.base.options import option
from forge.toolchain.resources import MemoryLimit, memory_limit


def _positive(text: str) -> int:
    if not text.isdigit() or not int(text):
        raise ValueError(f"'{text}' is not a positive number of jobs")
    return int(text)


def _workers(text: str) -> int:
    if not text.isdigit():
        raise ValueError(f"'{text}' is not a number of packages; 0 is the number of jobs")
    return int(text)


@frozen
class JobOptions:
    GROUP = "parallelism"

    jobs: int | None = option(
        "maximum number of jobs, compilers of all packages included (default: from a parent make or "
        "MAKEFLAGS, else the available CPUs)",
        parse=_positive,
        metavar="N",
        short="-j",
    )
    parallel_workers: int = option(
        "maximum number of packages to process in parallel (default: the number of jobs)",
        default=0,
        parse=_workers,
        metavar="N",
    )
    memory_limit: MemoryLimit | None = option(
        "start no new jobs while memory use is above this limit: 80%%, 12G, none (default: keep 10%% or "
        "1 GiB free, whichever is less)",
        parse=memory_limit,
        metavar="SIZE",
    )
    load_limit: float | None = option(
        "start no new jobs while the load average is above this limit", parse=float, metavar="X"
    )
