"""Options shared by several commands, and the values derived from them."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.env_vars import setting
from forge.base.errors import Problem, SelectionError
from forge.base.layout import Layout
from forge.execution.job_pool import JobOptions
from forge.toolchain.resources import MemoryLimit, memory_limit

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.cli.main import Parser

LOG_LEVELS = {"debug": 10, "info": 20, "warning": 30, "error": 40, "critical": 50}
"""Log levels: info explains why packages are built, debug also prints every command."""


EXECUTORS = ("parallel", "sequential")
CLUSTER = "dask"
"""The executor that builds packages on other machines; only for `forge build`."""

EVENT_HANDLERS = (
    "enable (+) or disable (-) event handlers: 'console_direct+' prints output immediately, 'status-' "
    "disables the status line; 'forge extensions' lists all"
)
"""The help text of --event-handlers."""


def add_layout(parser: Parser) -> None:
    """Add the options for build, install and log folders."""
    group = parser.add_argument_group("output folders")
    group.add_argument("--build-base", default="build", metavar="DIR", help="build folder (default: build)")
    group.add_argument(
        "--install-base", default="install", metavar="DIR", help="install folder (default: install)"
    )
    group.add_argument(
        "--merge-install",
        action="store_true",
        help="install all packages into one prefix instead of one prefix per package",
    )
    group.add_argument(
        "--log-base",
        default=argparse.SUPPRESS,
        metavar="DIR",
        help="log folder; /dev/null disables logs (default: log)",
    )
    group.add_argument(
        "--no-wait",
        action="store_true",
        help="exit with code 2 instead of waiting if the build folder is locked by another process",
    )
    group.add_argument("--log-level", default=argparse.SUPPRESS, metavar="LEVEL", help=argparse.SUPPRESS)


def add_budget(parser: Parser, *, cluster: bool = False) -> None:
    """Add the options for parallelism; `cluster` adds those for a Dask cluster."""
    executors = (*EXECUTORS, CLUSTER) if cluster else EXECUTORS
    group = parser.add_argument_group("parallelism")
    group.add_argument(
        "--jobs",
        type=_positive,
        metavar="N",
        help="maximum number of jobs, compilers of all packages included (default: from a parent make or"
        " MAKEFLAGS, else the available CPUs)",
    )
    group.add_argument(
        "--parallel-workers",
        type=int,
        default=0,
        metavar="N",
        help="maximum number of packages to process in parallel (default: the number of jobs)",
    )
    group.add_argument(
        "--executor",
        choices=executors,
        default=_executor(executors),
        help="process packages in parallel, or sequentially in topological order"
        + (", or on the workers of a Dask cluster (see --scheduler)" if cluster else "")
        + " (default: parallel)",
    )
    if cluster:
        _add_cluster(group)
    group.add_argument(
        "--memory-limit",
        type=_size,
        metavar="SIZE",
        help="start no new jobs while memory use is above this limit: 80%%, 12G, none (default: keep "
        "10%% or 1 GiB free, whichever is less)",
    )
    group.add_argument(
        "--load-limit",
        type=float,
        metavar="X",
        help="start no new jobs while the load average is above this limit",
    )


def _add_cluster(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        default=os.environ.get("FORGE_SCHEDULER"),
        help="address of the Dask scheduler, such as tcp://HOST:8786; --jobs then applies per worker, "
        "--parallel-workers to all workers together (default: one package per worker thread)",
    )
    group.add_argument(
        "--worker-resources",
        nargs="*",
        default=[],
        type=_amount,
        metavar="NAME=N",
        help="resources of Dask workers that each package requires, such as memory=4e9",
    )


def job_options_of(options: argparse.Namespace) -> JobOptions:
    """Return the values of the options that add_budget adds."""
    return JobOptions(
        jobs=options.jobs or 0,
        packages=options.parallel_workers or 0,
        memory_limit=options.memory_limit,
        load_limit=options.load_limit,
        sequential=options.executor == "sequential",
    )


def refuse_half_a_cluster(options: argparse.Namespace) -> None:
    """Raise SelectionError if --executor dask lacks --scheduler; the reverse is allowed, for option files."""
    if options.executor == CLUSTER and not options.scheduler:
        hint = "start a scheduler with `dask scheduler` and use the address it prints"
        raise SelectionError(Problem("'--executor dask' needs '--scheduler ADDRESS'", hint=hint))


def add_cache(parser: Parser) -> None:
    """Add the options of the package cache."""
    group = parser.add_argument_group("package cache")
    group.add_argument(
        "--cache",
        nargs="?",
        const="",
        metavar="DIR",
        help="restore installed files of packages from a cache, and store them there (default folder: "
        "~/.cache/forge/packages)",
    )
    group.add_argument(
        "--remote-cache",
        metavar="URL",
        help="share results through this remote cache, too: http://HOST:PORT, s3://BUCKET",
    )
    group.add_argument(
        "--cache-read-only", action="store_true", help="read from the remote cache, but upload nothing"
    )
    group.add_argument(
        "--cache-timeout",
        type=_seconds,
        default=10.0,
        metavar="SECONDS",
        help="timeout of the remote cache, after which the build continues without it (default: 10)",
    )
    group.add_argument(
        "--cache-size",
        type=byte_count,
        metavar="SIZE",
        help="size limit of the cache folder; the least recently used entries are removed first "
        "(default: 20G)",
    )


def cache_wanted(options: argparse.Namespace, variables: Mapping[str, str]) -> bool:
    """Tell whether a package cache is enabled."""
    return bool(remote_cache(options, variables)) or options.cache is not None


def remote_cache(options: argparse.Namespace, variables: Mapping[str, str]) -> str:
    """Return the URL of the remote cache, '' for none; raises ForgeError for an invalid URL."""
    url: str = options.remote_cache or variables.get("FORGE_REMOTE_CACHE", "")
    if url:
        from forge.cache.urls import check_url  # noqa: PLC0415  (only needed with a remote cache)

        check_url(url)
    return url


def layout_of(options: argparse.Namespace, root: Path) -> Layout:
    """Return the absolute folders named by the options; the null device disables logs."""
    logs = options.log_base or setting("LOG_PATH", os.environ) or "log"
    return Layout(
        build=_absolute(options.build_base, root),
        install=_absolute(options.install_base, root),
        logs=None if logs == os.devnull else _absolute(logs, root),
        merged=options.merge_install,
        symlink=getattr(options, "symlink_install", False),
    )


def log_level_of(options: argparse.Namespace) -> int:
    """Return --log-level as a level of Python's logging module: 10 debug, 20 info, 30 warning and so on.

    Raises SelectionError for an unknown level.
    """
    level = str(options.log_level or setting("LOG_LEVEL", os.environ) or "warning").lower()
    if level.isdigit():
        return int(level)
    if level not in LOG_LEVELS:
        hint = f"use {', '.join(LOG_LEVELS)}, or a number"
        raise SelectionError(Problem(f"unknown log level '{level}'", hint=hint))
    return LOG_LEVELS[level]


def spelled(path: Path | str, options: argparse.Namespace) -> str:
    """Return a path of the workspace relative to the folder in which the command was typed."""
    origin = getattr(options, "origin", os.curdir)
    if origin == os.curdir or Path(path).is_absolute():
        return str(path)
    return os.path.relpath(path, origin)


def _executor(executors: tuple[str, ...]) -> str:
    """Return the default executor from the environment, if it is valid."""
    name = setting("DEFAULT_EXECUTOR", os.environ)
    return name if name in executors else executors[0]


def _absolute(path: str, root: Path) -> Path:
    """Return a path from the command line as an absolute path, without resolving links."""
    return Path(os.path.normpath(root / Path(path).expanduser()))


def _positive(text: str) -> int:
    if not text.isdigit() or not int(text):
        raise argparse.ArgumentTypeError(f"'{text}' is not a positive number of jobs")
    return int(text)


def _size(text: str) -> MemoryLimit:
    try:
        return memory_limit(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is neither a size nor a percentage of memory") from None


def _amount(text: str) -> tuple[str, float]:
    name, equals, number = text.partition("=")
    try:
        if name and equals:
            return name, float(number)
    except ValueError:
        pass
    raise argparse.ArgumentTypeError(f"'{text}' is not of the form NAME=NUMBER, such as memory=4e9")


def _seconds(text: str) -> float:
    try:
        found = float(text)
    except ValueError:
        found = 0.0
    if not 0 < found < float("inf"):
        raise argparse.ArgumentTypeError(f"'{text}' is not a positive number of seconds")
    return found


def byte_count(text: str) -> int:
    """Return the number of bytes in '500M', '20G' or '0'; used as an argparse type."""
    try:
        size = 0 if text == "0" else memory_limit(text).size
    except ValueError:
        size = None
    if size is None:
        raise argparse.ArgumentTypeError(f"'{text}' is not a size such as 500M or 20G")
    return size
