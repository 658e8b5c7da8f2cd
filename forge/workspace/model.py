"""The contents of a workspace: packages, their manifests, the selection."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from enum import Enum
from pathlib import Path

from forge.base.errors import Problem
from forge.base.frozen import frozen

CMAKE_TYPES = frozenset({"ament_cmake", "cmake"})
PYTHON_TYPES = frozenset({"ament_python", "python"})
"""The build types of packages built by CMake, and by Python's build backends."""


class DependencyKind(Enum):
    BUILD = "build"
    BUILD_EXPORT = "build_export"
    BUILDTOOL = "buildtool"
    BUILDTOOL_EXPORT = "buildtool_export"
    EXEC = "exec"
    TEST = "test"
    DOC = "doc"


BUILD_KINDS = frozenset({DependencyKind.BUILD, DependencyKind.BUILDTOOL})
RUN_KINDS = frozenset({DependencyKind.BUILD_EXPORT, DependencyKind.BUILDTOOL_EXPORT, DependencyKind.EXEC})
TEST_KINDS = frozenset({DependencyKind.TEST})


@frozen
class Dependency:
    """A dependency on a package or system key, and its types."""

    name: str
    kinds: frozenset[DependencyKind]
    versions: tuple[tuple[str, str], ...] = ()
    """Constraints such as ('gte', '1.2.0')."""


@frozen
class Person:
    name: str
    email: str | None = None


@frozen
class Export:
    """A child of the manifest's export element; `content` is its inner XML, stripped."""

    tag: str
    attributes: tuple[tuple[str, str], ...]
    content: str


@frozen
class Manifest:
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

    def names(self, kinds: frozenset[DependencyKind]) -> tuple[str, ...]:
        """Return the dependencies of any of `kinds`, in the manifest's order."""
        return tuple(d.name for d in self.dependencies if d.kinds & kinds)


@frozen
class Package:
    """A buildable folder; `embedded` for packages embedded in forge."""

    path: Path
    manifest: Manifest
    embedded: bool = False
    has_actions: bool = False
    """Whether there are .action files, which require interfaces that manifests usually omit."""
    has_services: bool = False
    """Whether there are .srv files, which require further interfaces in newer ROS distributions."""
    ros: bool = True
    """Whether there is a package.xml; otherwise metadata is derived from CMake or Python files."""
    settings: Mapping[str, object] = field(default_factory=dict, hash=False)
    """Options for this package from colcon.pkg, *.meta and forge.toml, by name without dashes."""
    hooks: tuple[str, ...] = ()
    """Additional scripts, relative to the prefix, that the environment of the package sources."""

    @property
    def name(self) -> str:
        return self.manifest.name

    @property
    def build_type(self) -> str:
        return self.manifest.build_type

    @property
    def type(self) -> str:
        """The type in colcon's terms: ros.ament_cmake, or cmake for a package without package.xml."""
        return f"ros.{self.build_type}" if self.ros else self.build_type

    @property
    def only_tested_with(self) -> frozenset[str]:
        tested, used = (self.manifest.names(kinds) for kinds in (TEST_KINDS, BUILD_KINDS | RUN_KINDS))
        return frozenset(tested) - frozenset(used)

    def option_values(self, option: str) -> tuple[str, ...]:
        value = self.settings.get(option, ())
        return tuple(map(str, value)) if isinstance(value, list | tuple) else (str(value),)


@frozen
class BrokenPackage:
    """A folder with an invalid manifest, and the name in it; if it is unreadable, the name of the folder."""

    name: str
    path: Path
    problems: tuple[Problem, ...]


@frozen
class Workspace:
    """All packages below the base paths, by name.

    `duplicates` are further packages with the name of an earlier one. `broken` are those with
    invalid manifests, which stop the commands that need them. `notes` are warnings.
    """

    root: Path
    packages: Mapping[str, Package]
    broken: tuple[BrokenPackage, ...] = ()
    duplicates: tuple[Package, ...] = ()
    notes: tuple[Problem, ...] = ()

    @property
    def all_packages(self) -> tuple[Package, ...]:
        return (*self.packages.values(), *self.duplicates)

    @property
    def problems(self) -> tuple[Problem, ...]:
        return tuple(problem for broken in self.broken for problem in broken.problems)


@frozen
class Selection:
    """The selected packages in topological order; `left_out` contains the reasons for the others."""

    names: tuple[str, ...]
    left_out: Mapping[str, str] = field(default_factory=dict)
