"""Opens the audit of `forge build --audit`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.base.errors import Problem, SelectionError
from forge.build.audit.tracing import start_audit
from forge.cli.options import CLUSTER, cache_wanted
from forge.toolchain.compiler_launchers.choice import chosen

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from forge.build.audit.tracing import Audit


def audit_of(options: argparse.Namespace, build: Path, variables: Mapping[str, str]) -> Audit:
    """Return the audit of this build.

    Raises SelectionError for options that prevent steps from running on this machine, and EnvironmentFault if
    strace is missing.
    """
    others = list(_conflicting_options(options, variables))
    if others:
        message = f"--audit cannot be combined with {', '.join(others)}: all steps must run on this machine"
        raise SelectionError(
            Problem(message, hint="remove these options, also from forge.toml and the environment")
        )
    return start_audit(build, variables)


def _conflicting_options(options: argparse.Namespace, variables: Mapping[str, str]) -> Iterator[str]:
    if options.watch:
        yield "--watch"
    if options.executor == CLUSTER:
        yield f"--executor {CLUSTER}"
    if cache_wanted(options, variables):
        yield "a package cache (--cache, --remote-cache)"
    if chosen(options.compiler_launcher):
        yield "--compiler-launcher"
