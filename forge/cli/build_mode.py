"""How a build reports its result; `forge build --watch` overrides it."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TYPE_CHECKING

from forge.base.errors import WarningReporter
from forge.toolchain.programs import PYTHON_TYPES
from forge.workspace.resolve import INTERFACE_GROUP

if TYPE_CHECKING:
    from collections.abc import Iterable
    from contextlib import AbstractContextManager

    from forge.build.tasks import BuildPlan
    from forge.output.console import ConsoleReporter
    from forge.workspace.model import Package


_MANY = 4
"""Starting the worker takes as long as three Python packages save by it."""


def has_many_wheels(packages: Iterable[Package]) -> bool:
    """Tell whether there are enough Python packages for a worker that installs them."""
    return sum(package.build_type in PYTHON_TYPES for package in packages) >= _MANY


class BuildMode:
    """A single build with colcon's output; `WatchLoop` overrides the methods."""

    quiet = False
    """Whether to omit progress messages; failures and stderr output of packages are printed in any case."""
    silent_if_up_to_date = False
    """Whether to print nothing if all packages are up to date."""

    def __init__(self) -> None:
        """Start without warnings."""
        self.warn = WarningReporter()

    def worker(self, plan: BuildPlan, *, has_rosidl: bool) -> AbstractContextManager[dict[str, str]]:
        """Return a context that yields the environment variables for the worker of short commands.

        With `has_rosidl`, the generators of a distribution compile the interfaces.
        """
        packages = [task.package for task in plan.tasks.values()]
        compiles = not has_rosidl and any(INTERFACE_GROUP in each.manifest.groups for each in packages)
        installs = has_many_wheels(packages)
        if not (compiles or installs):
            return nullcontext({})
        from forge.cli.worker import INTERFACE_MODULES, WHEEL_MODULES, worker

        return worker(*INTERFACE_MODULES * compiles, *WHEEL_MODULES * installs)

    def conclude(self, _plan: BuildPlan, report: ConsoleReporter, seconds: float) -> None:
        """Print the summary of a build."""
        report.summarise(seconds)
