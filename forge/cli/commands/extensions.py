"""`forge extensions`: list what can be extended, and the distributions that do so."""

from __future__ import annotations

from collections.abc import Iterable

from forge import __version__
from forge.base.env_vars import EXECUTORS
from forge.base.extensions import (
    BUILD_TYPES,
    CACHES,
    COMMANDS,
    RECIPES,
    REPORTERS,
    STORES,
    TOOLCHAINS,
    VERBS,
    distribution_of,
    entry_points,
    installed,
)
from forge.base.extensions import EXECUTORS as EXECUTOR_GROUP
from forge.base.extensions import TARGETS as TARGET_GROUP
from forge.build.build_types import OWN as CORE_BUILD_TYPES
from forge.cli.options import NoOptions
from forge.environment.shells import SHELLS
from forge.interfaces.rendering import TARGETS
from forge.output.handlers import HANDLERS

Options = NoOptions


def run(_: Options) -> int:
    handlers = (f"{name}{'+' if on else '-'}" for name, on in HANDLERS.items())
    _print("commands", (), COMMANDS)
    _print("build types", CORE_BUILD_TYPES, BUILD_TYPES)
    _print("recipes", (), RECIPES)
    _print("interface targets", TARGETS, TARGET_GROUP)
    _print("interface verbs", (), VERBS)
    _print("toolchains", (), TOOLCHAINS)
    _print("remote cache backends", (), STORES)
    _print("caches", (), CACHES)
    _print("event handlers", handlers)
    _print("reporters", (), REPORTERS)
    _print("executors", EXECUTORS, EXECUTOR_GROUP)
    _print("shells", SHELLS)
    return 0


def _print(kind: str, own: Iterable[str], group: str = "") -> None:
    """Print one kind; other distributions extend it by entry points of `group`, if it has one."""
    print(f"{kind} (entry points '{group}'):" if group else f"{kind}:")
    rows = [(name, f"ros-forge {__version__}") for name in sorted({*own, *installed(group)})]
    known = {name for name, _ in rows}
    for name, entry in entry_points(group).items() if group else ():
        remark = " (not used: forge has its own)" if name in known else ""
        rows.append((name, f"{distribution_of(entry)}{remark}"))
    width = max((len(name) for name, _ in rows), default=0)
    for name, distribution in rows:
        print(f"  {name:<{width}}  {distribution}")
