"""The nouns of building: frozen, valid once born."""

from __future__ import annotations

from dataclasses import field
from enum import Enum
from typing import TYPE_CHECKING

from forge.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence
    from pathlib import Path

    from forge.errors import Problem


class Kind(Enum):
    """What a package.xml tag says about a dependency (REP 149)."""

    BUILD = "build"
    BUILD_EXPORT = "build_export"
    BUILDTOOL = "buildtool"
    BUILDTOOL_EXPORT = "buildtool_export"
    EXEC = "exec"
    TEST = "test"
    DOC = "doc"


BUILD_KINDS = frozenset({Kind.BUILD, Kind.BUILDTOOL})
RUN_KINDS = frozenset({Kind.BUILD_EXPORT, Kind.BUILDTOOL_EXPORT, Kind.EXEC})
TEST_KINDS = frozenset({Kind.TEST})


@frozen
class Dependency:
    """Another package or system key, and in which roles it is needed."""

    name: str
    kinds: frozenset[Kind]
    versions: tuple[tuple[str, str], ...] = ()
    """Constraints such as ('gte', '1.2.0')."""


@frozen
class Person:
    """A maintainer or an author."""

    name: str
    email: str | None = None


@frozen
class Export:
    """A child of the manifest's export element: tag, attributes and inner XML, stripped."""

    tag: str
    attributes: tuple[tuple[str, str], ...]
    content: str


@frozen
class Manifest:
    """A package.xml after its conditions were evaluated."""

    name: str
    version: str
    description: str
    build_type: str
    dependencies: tuple[Dependency, ...]
    path: Path
    format: int = 3
    maintainers: tuple[Person, ...] = ()
    licenses: tuple[str, ...] = ()
    group_dependencies: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()
    exports: tuple[Export, ...] = ()
    warnings: tuple[Problem, ...] = ()

    def names(self, kinds: frozenset[Kind]) -> tuple[str, ...]:
        """Return the dependencies that are needed in any of `kinds`, in the manifest's order."""
        return tuple(d.name for d in self.dependencies if d.kinds & kinds)


@frozen
class Package:
    """A folder that can be built. `embedded` ones forge brought along."""

    path: Path
    manifest: Manifest
    embedded: bool = False
    has_actions: bool = False
    """There are .action files, which need interfaces that nobody writes into a manifest."""
    ros: bool = True
    """The manifest is a package.xml; else it was gathered from CMakeLists.txt or Python's metadata."""
    settings: Mapping[str, object] = field(default_factory=dict, hash=False)
    """Options for this package alone, by their name without dashes: colcon.pkg, *.meta, forge.toml."""
    hooks: tuple[str, ...] = ()
    """Scripts, relative to the prefix, that its environment sources too."""

    @property
    def name(self) -> str:
        """The manifest's name."""
        return self.manifest.name

    @property
    def build_type(self) -> str:
        """The manifest's build type, such as ament_cmake."""
        return self.manifest.build_type

    @property
    def type(self) -> str:
        """What colcon calls its type: ros.ament_cmake, or cmake for one without a package.xml."""
        return f"ros.{self.build_type}" if self.ros else self.build_type

    def words(self, option: str) -> tuple[str, ...]:
        """Return the package's own values of an option that takes a list of words."""
        value = self.settings.get(option, ())
        return tuple(map(str, value)) if isinstance(value, list | tuple) else (str(value),)


@frozen
class Workspace:
    """All packages below the base paths, by name.

    Of equal names the first folder counts, `twins` are in the others. `problems` are manifests that could
    not be read: no build starts with any. `notes` deserve a warning in any case.
    """

    root: Path
    packages: Mapping[str, Package]
    problems: tuple[Problem, ...] = ()
    twins: tuple[Package, ...] = ()
    notes: tuple[Problem, ...] = ()


@frozen
class Selection:
    """The packages to work on, in topological order; `left_out` says why others are not."""

    names: tuple[str, ...]
    left_out: Mapping[str, str] = field(default_factory=dict)


@frozen
class Change:
    """One edit of an environment variable; `operation` is a dsv word (workspace spec 8.3)."""

    operation: str
    variable: str
    value: str


@frozen
class Mark:
    """A set of files at one moment, as digests.

    `stamp` is of their stats ('' when these cannot be trusted), `digest` of names, modes and contents,
    `linked` of the contents that links bring in from elsewhere.
    """

    stamp: str = ""
    digest: str = ""
    linked: str = ""


Pairs = tuple[tuple[str, str], ...]


@frozen
class Parts:
    """What a package is made from, in words and digests; equal parts make an equal package.

    `options` are the words of its steps, `tools` the identities of programs by name, `environment` the
    variables that builds may read, `sources` a digest. `needs` has for each direct dependency a digest of
    what it gives: its installed files and those of all below it. `underlays` is a digest of the names that
    packages could be found by below it.
    """

    forge: str = ""
    options: tuple[str, ...] = ()
    tools: Pairs = ()
    environment: Pairs = ()
    sources: str = ""
    needs: Pairs = ()
    underlays: str = ""


@frozen
class Record:
    """What the journal remembers of a package's last build.

    `complete` is False from the moment it began until it ended well. `files` are what it installed, as
    absolute paths; `externals` the files outside the workspace that its build read, and `external` the
    digest of their contents. Times are seconds since the epoch; a package that was restored began at 0.
    `tree` is what the files come to whatever the path, for the package cache; '' when nobody has asked.
    `saved` are inputs that were written while the build ran: what it made may be of any state of them.
    `from_empty` tells if it began in an empty build folder. `read_from` are packages that it does not
    declare to need, and of which it read files in their build folders or prefixes. `folders` are the empty
    folders that it installed, as absolute paths with '/' at their end.
    """

    parts: Parts
    complete: bool = False
    sources: Mark = Mark()
    installed: Mark = Mark()
    files: tuple[str, ...] = ()
    externals: tuple[str, ...] = ()
    external: str = ""
    seconds: float = 0.0
    began: float = 0.0
    tree: str = ""
    saved: tuple[str, ...] = ()
    from_empty: bool = False
    read_from: tuple[str, ...] = ()
    folders: tuple[str, ...] = ()


@frozen
class Snapshot:
    """What is on disk today, beside the records of yesterday.

    `sources` and `installed` are marks of today, the latter of the files that the record lists. `moved`
    names an input that changed outside of the package, by package. `listed` are the files that tools list
    in a package's build folder as installed. `present` are the packages whose prefix says they are
    complete. `news` are source files that changed, by package, for explanations.
    """

    records: Mapping[str, Record] = field(default_factory=dict)
    sources: Mapping[str, Mark] = field(default_factory=dict)
    installed: Mapping[str, Mark] = field(default_factory=dict)
    moved: Mapping[str, str] = field(default_factory=dict)
    listed: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    present: frozenset[str] = frozenset()
    news: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


CONFIGURE = "cmake"
"""The label of the step that configures a package."""

TEST_FAILURES = "test failures"
"""What an exit code may mean; the same words stand in colcon's own note of a package's tests."""
SUCCESS, FAILURE = "success", "failure"


@frozen
class Step:
    """One program to run: printed, hashed, logged and repeated by hand as it stands here."""

    label: str
    argv: tuple[str, ...]
    cwd: Path
    env: Pairs = ()
    """Variables set for this step alone, beyond the environment of its task."""
    record: tuple[Path, str] | None = None
    """A file that says this step was done, by these words: then it does not run again."""
    replaces: tuple[str, ...] = ()
    """Files that it made the last time; links among them are removed before it starts."""
    meanings: tuple[tuple[int, str], ...] = ()
    """Exit codes that are no failure of the task, and what they say instead."""
    after: str = ""
    """When it runs: always, or only after a step with TEST_FAILURES (FAILURE) or without (SUCCESS)."""

    def meaning(self, code: int) -> str | None:
        """Return what an exit code says, or None when it is 0 or fails the task."""
        return dict(self.meanings).get(code)


@frozen
class Task:
    """The work on one package. `needs` come first and make up its environment, lowest first."""

    name: str
    package: Package
    prefix: Path
    build_dir: Path
    needs: Collection[str]
    steps: Sequence[Step]
    reason: str
    parts: Parts = Parts()  # complete but for `needs` when the task is conditional
    sources: Mark = Mark()
    files: Sequence[tuple[Path, str]] = ()
    """What the steps read and forge writes before them, when it changed."""
    conditional: bool = False
    """It runs only if a package that is built before it comes out different."""
    clean: tuple[Path, ...] = ()
    """Files and folders that are removed first."""
    reconfigure: bool = False
    """CMake runs in any case."""
    anew: bool = False
    """It begins in an empty build folder."""
    after: frozenset[str] = frozenset()
    """Other tasks that go first, since the last build read files of theirs that it had not declared."""
    earlier: tuple[str, ...] = ()
    """What earlier builds installed, as absolute paths, whether or not they ended well."""
    desk: str = "handover"
    """The folder below `build_dir` for what the steps see and the line that repeats the last of them."""

    @property
    def embedded(self) -> bool:
        """Tell if forge brought the package along."""
        return self.package.embedded


@frozen
class BuildPlan:
    """Tasks in topological order, and the packages that need none."""

    tasks: Mapping[str, Task]
    fresh: tuple[str, ...] = ()


@frozen
class Started:
    """A task began; `parts` is what it is made from, dependencies included."""

    task: str
    parts: Parts = Parts()


@frozen
class Fresh:
    """A conditional task turned out to need nothing."""

    task: str


@frozen
class StepStarted:
    """A step of a task began; `environment` holds only what differs from forge's own."""

    task: str
    step: Step
    environment: tuple[tuple[str, str], ...] = ()


@frozen
class StepFinished:
    """A step ended with the exit code of its program (negative: a signal)."""

    task: str
    step: Step
    code: int


@frozen
class Output:
    """Lines that a task's program printed, with their ends; of a very long line a piece, without one."""

    task: str
    lines: bytes
    stderr: bool


@frozen
class Finished:
    """A task ended: `step` failed, or `record` says what was made; `cache` is a remark of the cache's."""

    task: str
    code: int
    seconds: float
    step: Step | None = None
    record: Record | None = None
    cache: str = ""


@frozen
class Aborted:
    """A task was stopped before its end: another failed, or the user interrupted."""

    task: str
    seconds: float


@frozen
class Skipped:
    """A task did not start; `because` names the failed package, or says 'interrupted'."""

    task: str
    because: str


Event = Fresh | Started | StepStarted | StepFinished | Output | Finished | Aborted | Skipped
