"""`forge extensions`: list the extension points, and the distributions that extend them."""

from __future__ import annotations

from forge import __version__
from forge.base import extensions as groups
from forge.base.env_vars import EXECUTORS
from forge.build.build_types import OWN as BUILD_TYPES
from forge.cli.options import NoOptions
from forge.environment.shells import SHELLS
from forge.interfaces.writing import TARGETS
from forge.output.handlers import HANDLERS

Options = NoOptions


def run(_: Options) -> int:
    """Print each kind with its names; other distributions extend it by entry points of its group, if any."""
    handlers = [f"{name}{'+' if on else '-'}" for name, on in HANDLERS.items()]
    for kind, own, group in (
        ("commands", (), groups.COMMANDS),
        ("build types", BUILD_TYPES, groups.BUILD_TYPES),
        ("recipes", (), groups.RECIPES),
        ("interface targets", TARGETS, groups.TARGETS),
        ("interface verbs", (), groups.VERBS),
        ("verbs of forge pkg", (), groups.PKG_VERBS),
        ("toolchains", (), groups.TOOLCHAINS),
        ("remote cache backends", (), groups.STORES),
        ("caches", (), groups.CACHES),
        ("event handlers", handlers, ""),
        ("reporters", (), groups.REPORTERS),
        ("hints", (), groups.HINTS),
        ("suggestions", (), groups.SUGGESTIONS),
        ("executors", EXECUTORS, groups.EXECUTORS),
        ("shells", SHELLS, ""),
    ):
        print(f"{kind} (entry points '{group}'):" if group else f"{kind}:")
        own_names = sorted({*own, *groups.installed(group)})
        rows = [(name, f"ros-forge {__version__}") for name in own_names]
        for name, entry in groups.entry_points(group).items() if group else ():
            remark = " (not used: forge has its own)" if name in own_names else ""
            rows.append((name, f"{groups.distribution_of(entry)}{remark}"))
        width = max((len(name) for name, _ in rows), default=0)
        for name, distribution in rows:
            print(f"  {name:<{width}}  {distribution}")
    return 0
