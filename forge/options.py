"""Options that several commands share, and what they mean together."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from forge.capacity import MemoryLimit, memory_limit
from forge.errors import Problem, SelectionError
from forge.layout import Layout
from forge.settings import setting

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.cli import Parser

LOG_LEVELS = {"debug": 10, "info": 20, "warning": 30, "error": 40, "critical": 50}
"""How much forge says about itself: from info on why packages are built, from debug on every command."""


EXECUTORS = ("parallel", "sequential")
CLUSTER = "dask"
"""The executor whose packages are built on other machines; for `forge build` alone."""

EVENT_HANDLERS = (
    "what to print: 'console_direct+' shows the output of every program as it comes, 'status-' does without "
    "the moving lines of a terminal; 'forge extensions' names all"
)
"""What --event-handlers is for."""


def add_layout(parser: Parser) -> None:
    """Add where results go."""
    group = parser.add_argument_group("where results go")
    group.add_argument("--build-base", default="build", metavar="DIR", help="where to build (default: build)")
    group.add_argument(
        "--install-base", default="install", metavar="DIR", help="where to install (default: install)"
    )
    group.add_argument(
        "--merge-install", action="store_true", help="one prefix for all packages, not one for each"
    )
    group.add_argument(
        "--log-base",
        default=argparse.SUPPRESS,
        metavar="DIR",
        help="where logs go; /dev/null for none (default: log)",
    )
    group.add_argument(
        "--no-wait",
        action="store_true",
        help="where another forge is at work there: say so and end with 2, instead of waiting",
    )
    group.add_argument("--log-level", default=argparse.SUPPRESS, metavar="LEVEL", help=argparse.SUPPRESS)


def add_budget(parser: Parser, *, cluster: bool = False) -> None:
    """Add how much runs at a time, and where if it may be a cluster."""
    executors = (*EXECUTORS, CLUSTER) if cluster else EXECUTORS
    group = parser.add_argument_group("how much at a time")
    group.add_argument(
        "--jobs",
        type=_positive,
        metavar="N",
        help="jobs of all packages and their compilers together (default: those of the make above, or of "
        "MAKEFLAGS, else the processors that affinity and cgroup quotas leave)",
    )
    group.add_argument(
        "--parallel-workers",
        type=int,
        default=0,
        metavar="N",
        help="packages at a time, at most (default: as many as jobs)",
    )
    group.add_argument(
        "--executor",
        choices=executors,
        default=_executor(executors),
        help="several packages at a time, or one after the other as 'forge list -t' has them"
        + (", or on the workers of Dask's --scheduler" if cluster else "")
        + " (default: parallel)",
    )
    if cluster:
        _add_cluster(group)
    group.add_argument(
        "--memory-limit",
        type=_size,
        metavar="SIZE",
        help="while more is in use no job is added: 80%%, 12G, none (default: a tenth stays available, "
        "or 1 GiB if that is less)",
    )
    group.add_argument(
        "--load-limit", type=float, metavar="X", help="while the load average is above this no job is added"
    )


def _add_cluster(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        default=os.environ.get("FORGE_SCHEDULER"),
        help="the scheduler of Dask for '--executor dask', such as tcp://HOST:8786; --jobs is then for each "
        "worker, and --parallel-workers for all of them together (default: one for each thread of a worker)",
    )
    group.add_argument(
        "--worker-resources",
        nargs="*",
        default=[],
        type=_amount,
        metavar="NAME=N",
        help="what each package takes of the resources that the workers declare to Dask, such as memory=4e9",
    )


def refuse_half_a_cluster(options: argparse.Namespace) -> None:
    """Raise SelectionError for the cluster's executor without a scheduler; one alone may stand in a file."""
    if options.executor == CLUSTER and not options.scheduler:
        hint = "start one with `dask scheduler`, and give the address that it prints"
        raise SelectionError(Problem("'--executor dask' needs '--scheduler ADDRESS'", hint=hint))


def add_cache(parser: Parser) -> None:
    """Add where results of packages are kept for other builds."""
    group = parser.add_argument_group("what other builds have built")
    group.add_argument(
        "--cache",
        nargs="?",
        const="",
        metavar="DIR",
        help="take what packages install from a cache where it has been built before, and keep it there "
        "(default: the user's own folder)",
    )
    group.add_argument(
        "--remote-cache", metavar="URL", help="and share it with others: http://HOST:PORT, s3://BUCKET"
    )
    group.add_argument(
        "--cache-read-only", action="store_true", help="take from the remote cache, put nothing into it"
    )
    group.add_argument(
        "--cache-timeout",
        type=_seconds,
        default=10.0,
        metavar="SECONDS",
        help="how long the remote cache is waited for before the build goes on without (default: 10)",
    )
    group.add_argument(
        "--cache-size",
        type=byte_count,
        metavar="SIZE",
        help="what the folder may take; what was used least of late goes first (default: 20G)",
    )


def cache_wanted(options: argparse.Namespace, variables: Mapping[str, str]) -> bool:
    """Tell if packages are to be looked for in a cache, and kept there."""
    return bool(remote_cache(options, variables)) or options.cache is not None


def remote_cache(options: argparse.Namespace, variables: Mapping[str, str]) -> str:
    """Return the URL of the remote cache, '' for none; raises ForgeError for what cannot be one."""
    url: str = options.remote_cache or variables.get("FORGE_REMOTE_CACHE", "")
    if url:
        from forge.caching.urls import check  # noqa: PLC0415  (most builds have none)

        check(url)
    return url


def layout_of(options: argparse.Namespace, root: Path) -> Layout:
    """Return the absolute folders that the options name; the null device means no logs."""
    logs = options.log_base or setting("LOG_PATH", os.environ) or "log"
    return Layout(
        build=_absolute(options.build_base, root),
        install=_absolute(options.install_base, root),
        logs=None if logs == os.devnull else _absolute(logs, root),
        merged=options.merge_install,
        symlink=getattr(options, "symlink_install", False),
    )


def log_level_of(options: argparse.Namespace) -> int:
    """Return --log-level as Python's logging counts: 10 debug, 20 info, 30 warning and so on.

    Raises SelectionError for a word that is no level.
    """
    word = str(options.log_level or setting("LOG_LEVEL", os.environ) or "warning").lower()
    if word.isdigit():
        return int(word)
    if word not in LOG_LEVELS:
        hint = f"the levels are {', '.join(LOG_LEVELS)}, or a number"
        raise SelectionError(Problem(f"'{word}' is no log level", hint=hint))
    return LOG_LEVELS[word]


def spelled(path: Path | str, options: argparse.Namespace) -> str:
    """Return a path of the workspace as it reads where the command was typed."""
    origin = getattr(options, "origin", os.curdir)
    if origin == os.curdir or Path(path).is_absolute():
        return str(path)
    return os.path.relpath(path, origin)


def _executor(executors: tuple[str, ...]) -> str:
    """Return the executor that the environment prefers, if it is one."""
    word = setting("DEFAULT_EXECUTOR", os.environ)
    return word if word in executors else executors[0]


def _absolute(path: str, root: Path) -> Path:
    """Return a path from the command line as an absolute one, links in it left as they are."""
    return Path(os.path.normpath(root / Path(path).expanduser()))


def _positive(text: str) -> int:
    if not text.isdigit() or not int(text):
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of jobs")
    return int(text)


def _size(text: str) -> MemoryLimit:
    try:
        return memory_limit(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is neither a size nor a share of the memory") from None


def _amount(text: str) -> tuple[str, float]:
    name, equals, number = text.partition("=")
    try:
        if name and equals:
            return name, float(number)
    except ValueError:
        pass
    raise argparse.ArgumentTypeError(f"'{text}' is no amount of a resource, such as memory=4e9")


def _seconds(text: str) -> float:
    try:
        found = float(text)
    except ValueError:
        found = 0.0
    if not 0 < found < float("inf"):
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of seconds")
    return found


def byte_count(text: str) -> int:
    """Return how many bytes '500M', '20G' or '0' are, as the type of an option."""
    try:
        size = 0 if text == "0" else memory_limit(text).size
    except ValueError:
        size = None
    if size is None:
        raise argparse.ArgumentTypeError(f"'{text}' is no size such as 500M or 20G")
    return size
