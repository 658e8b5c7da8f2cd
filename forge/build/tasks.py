"""Build tasks and their steps, as data, and the command lines that repeat a step by hand."""

from __future__ import annotations

import shlex
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.frozen import Pairs, frozen
from forge.base.layout import SCRATCH_DIR
from forge.build.model import BuildInputs, Fingerprint

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from forge.build.up_to_date import InputChange
    from forge.workspace.model import Package

TEST_FAILURES = "test failures"
"""A possible meaning of an exit code. colcon writes the same text to a package's test result file."""

REPEATED_ALONE = "building again, alone and with one job"
"""The end of a message about a build step after a program was killed for lack of memory."""
KILLED_ALONE = "was killed again, although nothing else ran"
"""The end of a message about a build step after a program was killed again, although nothing else ran."""

CACHED, NOT_CACHED = "cached", "tests ran: "
"""Remarks of `forge test --cached` about a package: its pass was replayed, or the reason why not."""


TIMED_OUT = 124
"""The exit code of a step that timed out, as in timeout(1)."""


class StepKind(Enum):
    """The kind of a step; the values are the labels shown to users."""

    CONFIGURE = "cmake"
    BUILD = "build"
    """The only kind whose program runs parallel jobs."""
    BUILD_TARGET = "build target"
    INSTALL = "install"
    CTEST = "ctest"
    PYTEST = "pytest"
    UNITTEST = "unittest"
    TEST = "test"
    """The tests of a build type that is neither CMake's nor Python's."""


TEST_STEPS = frozenset({StepKind.CTEST, StepKind.PYTEST, StepKind.UNITTEST, StepKind.TEST})


class StepCondition(Enum):
    """Whether a step runs, depending on the previous one."""

    ALWAYS = "always"
    TESTS_FAILED = "tests failed"
    TESTS_PASSED = "tests passed"


@frozen
class Step:
    """One program to run. It is printed, hashed, logged and repeated by hand exactly as stored here."""

    kind: StepKind
    argv: tuple[str, ...]
    cwd: Path
    env: Pairs = ()
    """Variables set for this step only, in addition to the environment of its task."""
    record: tuple[Path, str] | None = None
    """A stamp file and its content. If the file has this content, the step is skipped."""
    meanings: tuple[tuple[int, str], ...] = ()
    """Nonzero exit codes that do not fail the task, and their meanings."""
    condition: StepCondition = StepCondition.ALWAYS
    prefix: Path | None = None
    """The prefix if it is an argument of a program of forge, which is not observed itself."""
    stage: Path | None = None
    """The folder into which the step installs instead."""
    target: str = ""
    """The target of a BUILD_TARGET step."""
    seconds: float = 0
    """The time limit: after it, the program and its descendants are stopped, with the exit code TIMED_OUT."""
    tests_at_once: int = 0
    """The maximum number of concurrent tests of CTest, job limit permitting; 0 if forge does not set it."""
    tests: int = 0
    """The number of tests of CTest if it runs them concurrently, or an upper limit."""

    @property
    def label(self) -> str:
        return f"{self.kind.value} '{self.target}'" if self.target else self.kind.value

    def meaning(self, code: int) -> str | None:
        """Return the meaning of an exit code, or None if it is 0 or fails the task."""
        return dict(self.meanings).get(code)


@frozen
class Task:
    """The work on one package. `needs` are its transitive dependencies in topological order."""

    name: str
    package: Package
    prefix: Path
    build_dir: Path
    needs: Collection[str]
    steps: Sequence[Step]
    reason: str
    change: InputChange | None = None
    """The input change that requires the build, if there is one."""
    inputs: BuildInputs = BuildInputs()  # without `needs` while the task is conditional
    sources: Fingerprint = Fingerprint()
    files: Sequence[tuple[Path, str]] = ()
    """Generated files for the steps; forge writes those that changed before the first step."""
    conditional: bool = False
    """Run only if the installed files of a dependency change in this build."""
    clean: tuple[Path, ...] = ()
    """Files and folders to remove before the first step."""
    reconfigure: bool = False
    """Run CMake's configure step even if it is up to date."""
    from_empty: bool = False
    """Start in an empty build folder."""
    after: frozenset[str] = frozenset()
    """Other tasks to run first: undeclared dependencies whose files the last build read."""
    earlier: tuple[str, ...] = ()
    """Files that earlier builds installed, successful or not, as absolute paths."""
    intact: bool = False
    """The installed files are those of the last build."""
    stage: Path | None = None
    """The folder into which the steps install, if the prefix is kept until they have succeeded."""
    prepared: bool = False
    """Only the install step runs, after the others have succeeded."""
    kept: Sequence[str] = ()
    """Names in the build folder that are kept when it is emptied, unless the task is `from_empty`."""
    scratch_dir: str = SCRATCH_DIR
    """The folder below `build_dir` for the steps' environment and the command that repeats the last step."""

    @property
    def embedded(self) -> bool:
        return self.package.embedded


@frozen
class BuildPlan:
    """Tasks in topological order, and the packages that are up to date."""

    tasks: Mapping[str, Task]
    fresh: tuple[str, ...] = ()


def environment_file(task: Task) -> Path:
    """Return the file in a task's scratch folder that exports the environment of its steps."""
    return task.build_dir / task.scratch_dir / "environment.sh"


def step_line(step: Step, environment: Path | None = None) -> str:
    """Return a shell command that runs a step, after sourcing the file `environment` if given."""
    source = f". {shlex.quote(str(environment))} && " if environment else ""
    variables = "".join(f"{name}={shlex.quote(value)} " for name, value in step.env)
    return f"{source}cd {shlex.quote(str(step.cwd))} && {variables}{shlex.join(step.argv)}"
