"""How a build reports its result; `forge build --watch` overrides it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from forge.build.tasks import BuildPlan
    from forge.output.console import ConsoleReporter


class BuildMode:
    """A single build with colcon's output; `WatchLoop` overrides the methods."""

    quiet = False
    """Whether to omit progress messages; failures and stderr output of packages are printed in any case."""
    checking = False
    """Whether to print nothing if all packages are up to date."""

    def worker(self, plan: BuildPlan) -> AbstractContextManager[dict[str, str]]:
        """Return a context that yields the environment variables for the generator worker."""
        from forge.cli.session import warm_worker  # noqa: PLC0415  (not needed if all is up to date)

        return warm_worker(plan)

    def conclude(self, _plan: BuildPlan, report: ConsoleReporter, seconds: float) -> None:
        """Print the summary of a build."""
        report.summarise(seconds)
