"""Opening the audit that `forge build --audit` asks for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.audit.tracing import start_audit
from forge.errors import Problem, SelectionError
from forge.launching.choice import chosen
from forge.options import CLUSTER, cache_wanted

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from forge.audit.tracing import Audit


def audit_of(options: argparse.Namespace, build: Path, variables: Mapping[str, str]) -> Audit:
    """Return the audit that was asked for.

    Raises SelectionError with all options that would keep steps from running here, and EnvironmentFault
    where there is no strace.
    """
    others = list(_in_the_way(options, variables))
    if others:
        message = (
            f"--audit has to see every step run on this machine; that does not go with {', '.join(others)}"
        )
        raise SelectionError(
            Problem(message, hint="leave them out, in forge.toml and in the environment, too")
        )
    return start_audit(build, variables)


def _in_the_way(options: argparse.Namespace, variables: Mapping[str, str]) -> Iterator[str]:
    if options.watch:
        yield "--watch"
    if options.executor == CLUSTER:
        yield f"--executor {CLUSTER}"
    if cache_wanted(options, variables):
        yield "a package cache (--cache, --remote-cache)"
    if chosen(options.compiler_launcher):
        yield "--compiler-launcher"
