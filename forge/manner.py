"""In which manner a build is done: by itself, as it is typed; `watching` has others."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from forge.model import BuildPlan
    from forge.reporting import Report


class Manner:
    """A build by itself, told in colcon's words; the methods are what a watched build does otherwise."""

    quiet = False
    """Whether events go without words; failures and what packages say on stderr are told in any case."""
    checking = False
    """Whether nothing to do is nothing to tell."""

    def worker(self, plan: BuildPlan) -> AbstractContextManager[dict[str, str]]:
        """Return what gives the variables that lead interface packages to a warm worker."""
        from forge.undertaking import warm_worker  # noqa: PLC0415  (a build of nothing has none)

        return warm_worker(plan)

    def conclude(self, _plan: BuildPlan, report: Report, seconds: float) -> None:
        """Tell what came of it all."""
        report.summarise(seconds)
