"""How a build reports its result; `forge build --watch` overrides it."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TYPE_CHECKING

from forge.base.errors import WarningReporter
from forge.workspace.resolve import INTERFACE_GROUP

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from forge.build.tasks import BuildPlan
    from forge.output.console import ConsoleReporter


class BuildMode:
    """A single build with colcon's output; `WatchLoop` overrides the methods."""

    quiet = False
    """Whether to omit progress messages; failures and stderr output of packages are printed in any case."""
    silent_if_up_to_date = False
    """Whether to print nothing if all packages are up to date."""

    def __init__(self) -> None:
        """Start without warnings."""
        self.warn = WarningReporter()

    def worker(self, plan: BuildPlan) -> AbstractContextManager[dict[str, str]]:
        """Return a context that yields the environment variables for the worker of interface packages."""
        if not any(INTERFACE_GROUP in task.package.manifest.groups for task in plan.tasks.values()):
            return nullcontext({})
        from forge.cli.worker import worker  # noqa: PLC0415  (only for interface packages)

        return worker()

    def conclude(self, _plan: BuildPlan, report: ConsoleReporter, seconds: float) -> None:
        """Print the summary of a build."""
        report.summarise(seconds)
