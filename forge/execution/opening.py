"""Opens the job pool of a build according to its options, the environment and the tools."""

from __future__ import annotations

import contextlib
import json
from functools import partial
from typing import TYPE_CHECKING

from forge.base.env_vars import own_cache
from forge.base.errors import Problem
from forge.base.files import write_if_changed
from forge.base.layout import STYLES_FILE
from forge.execution.job_pool import JobPool
from forge.execution.jobserver import common_style, create_pool, join_pool, supported_styles
from forge.execution.makeflags import read_make_flags
from forge.toolchain.resources import is_overloaded, processors

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from forge.build.recipes.context import BuildContext
    from forge.execution.options import JobOptions

_MAX_STORED_STYLES = 8
"""Workspaces and virtual environments have different tools, and share the file."""


def open_job_pool(
    options: JobOptions,
    context: BuildContext,
    variables: Mapping[str, str],
    *,
    compiles: bool,
    remote_slots: int,
    warn: Callable[[Iterable[Problem]], object],
) -> JobPool:
    """Return the job pool of a build: that of a parent make, else a new one with the requested size.

    Without a requested number, the `remote_slots` of a distributed compiler are added to the local
    processors. If the build `compiles`, its tools share one jobserver style, because one may start the other;
    supported styles are detected by trial.
    """
    flags = read_make_flags(variables.get("MAKEFLAGS", ""))
    level = variables.get("CMAKE_BUILD_PARALLEL_LEVEL", "")
    jobs = options.jobs or flags.jobs or (int(level) if level.isdigit() else 0)
    local = jobs or processors()
    jobs = jobs or local + (0 if flags.auth else remote_slots)
    pool = join_pool(flags.auth) if flags.auth and not options.jobs else None
    if flags.auth and pool is None and not options.jobs:
        hint = "start the make rule with '+', or pass --jobs to forge"
        warn([Problem("cannot connect to the jobserver of the parent make", hint=hint)])
    supported = _styles(context, variables) if compiles else {}
    style = pool.style if pool else common_style(supported)
    if pool is None and style is not None:
        pool = create_pool(style, jobs)
    tools = frozenset(name for name, styles in supported.items() if style in styles)
    overloaded = partial(is_overloaded, options.memory_limit, context.load_limit)
    job_pool = JobPool(jobs, pool, tools, flags, overloaded)
    job_pool.local = min(local, job_pool.jobs)
    return job_pool


def _styles(context: BuildContext, variables: Mapping[str, str]) -> dict[str, frozenset[str]]:
    """Return the jobserver styles that each tool supports; results are cached by tool version."""
    file = (own_cache(variables) or context.layout.build) / STYLES_FILE
    identity = "\n".join(
        f"{name} {identity}" for name, identity in context.tools if name in {"ninja", "make"}
    )
    stored = {}
    with contextlib.suppress(OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        stored = json.loads(file.read_bytes())["styles"]
        return {name: frozenset(styles) for name, styles in stored[identity].items()}
    tools = {"ninja": context.ninja, "make": context.make}
    found = {name: supported_styles(name, tool, variables) for name, tool in tools.items() if tool}
    others = [*stored.items()][-_MAX_STORED_STYLES + 1 :] if isinstance(stored, dict) else []
    styles = {name: sorted(of_tool) for name, of_tool in found.items()}
    with contextlib.suppress(OSError):  # read-only cache folder
        write_if_changed(file, json.dumps({"styles": {**dict(others), identity: styles}}))
    return found
