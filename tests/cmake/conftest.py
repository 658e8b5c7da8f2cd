"""CMake projects on the embedded ament, built by a real CMake.

The embedded packages are installed once per session. FORGE_TEST_CMAKE names another CMake to try, and
CMAKE_GENERATOR another build tool than Ninja.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

import pytest

from tests.packages import write_files

collect_ignore = ["shapes"]
"""Packages with tests of their own."""

ROOT = Path(__file__).parents[2]
EMBEDDED = ROOT / "forge" / "embedded"
PYTHON_VERSION = f"{sys.version_info.major}.{sys.version_info.minor}"
BUILD_TOOLS = ("ament_cmake", "ament_lint_auto", "rosidl_default_runtime", "rosidl_default_generators")
INTERFACES = ("builtin_interfaces", "unique_identifier_msgs", "service_msgs", "action_msgs", "std_msgs")

MANIFEST = """\
<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>1.2.3</version>
  <description>A package of the tests.</description>
  <maintainer email="somebody@example.com">Somebody</maintainer>
  <license>Apache-2.0</license>
  {lines}
  <export><build_type>ament_cmake</build_type></export>
</package>
"""


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a command ended, and what it printed."""

    code: int
    text: str

    @property
    def flat(self) -> str:
        """The text with runs of blanks and line ends as one blank: CMake wraps its messages."""
        return " ".join(self.text.split())

    def said(self, name: str) -> str:
        """Return what message(STATUS "name=...") printed."""
        begin = f"-- {name}="
        return next(line.removeprefix(begin) for line in self.text.splitlines() if line.startswith(begin))


@dataclass(frozen=True, slots=True)
class Project:
    """A CMake project with folders of its own, and the prefixes in which it finds others."""

    source: Path
    build: Path
    prefix: Path
    prefixes: tuple[Path, ...]
    variables: Mapping[str, str] = field(default_factory=dict)

    def configure(self, *arguments: str) -> Outcome:
        """Run CMake, which must succeed."""
        outcome = self.try_to_configure(*arguments)
        assert outcome.code == 0, outcome.text
        return outcome

    def try_to_configure(self, *arguments: str) -> Outcome:
        """Run CMake; see Outcome for how it ended."""
        return self._run(
            "cmake",
            *("-S", str(self.source), "-B", str(self.build)),
            f"-DCMAKE_INSTALL_PREFIX={self.prefix}",
            f"-DPython3_EXECUTABLE={sys.executable}",
            f"-DFORGE_PYTHON_VERSION={PYTHON_VERSION}",
            f"-DFORGE_COMMAND={sys.executable};-m;forge",
            *arguments,
        )

    def make(self, *words: str) -> Outcome:
        """Build, which must succeed."""
        return self._succeed("cmake", "--build", str(self.build), *words)

    def try_to_make(self) -> Outcome:
        """Build; see Outcome for how it ended."""
        return self._run("cmake", "--build", str(self.build))

    def install(self, *arguments: str) -> Project:
        """Configure, build and install, all of which must succeed."""
        self.configure(*arguments)
        self.make()
        self._succeed("cmake", "--install", str(self.build))
        return self

    def test(self) -> Outcome:
        """Run the tests."""
        return self._run("cmake", "-E", "chdir", str(self.build), "ctest", "--output-on-failure")

    def files(self) -> set[str]:
        """Return what is installed."""
        return {str(path.relative_to(self.prefix)) for path in self.prefix.rglob("*") if path.is_file()}

    def read(self, path: str) -> str:
        """Return the text of an installed file."""
        return (self.prefix / path).read_text(encoding="utf-8")

    def _succeed(self, *argv: str) -> Outcome:
        outcome = self._run(*argv)
        assert outcome.code == 0, outcome.text
        return outcome

    def _run(self, *argv: str) -> Outcome:
        kept = {key: os.environ[key] for key in ("PATH", "HOME", "TMPDIR") if key in os.environ}
        paths = os.pathsep.join(map(str, self.prefixes))
        libraries = os.pathsep.join(f"{prefix}/lib" for prefix in self.prefixes)
        kept["LD_LIBRARY_PATH"] = libraries  # what a sourced workspace sets; installed programs count on it
        kept["CMAKE_GENERATOR"] = os.environ.get("CMAKE_GENERATOR", "Ninja")
        variables = {**kept, "PYTHONPATH": str(ROOT), "CMAKE_PREFIX_PATH": paths, **self.variables}
        done = subprocess.run(
            argv, env=variables, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
        )
        return Outcome(done.returncode, done.stdout)


class Ament(Protocol):
    """What the fixture `ament` gives."""

    def __call__(
        self, commands: str, name: str = "demo", *, manifest: str = "", files: Mapping[str, str] = ...
    ) -> Project:
        """Make a project: `commands` follow project() and find_package(ament_cmake)."""


@pytest.fixture(scope="session")
def embedded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a prefix with the embedded build tools."""
    base = tmp_path_factory.mktemp("embedded")
    return _install_embedded(BUILD_TOOLS, base / "build", base / "install", ())


@pytest.fixture(scope="session")
def interfaces(embedded: Path) -> Path:
    """Return a prefix with the interface packages that most others need."""
    base = embedded.parent
    return _install_embedded(INTERFACES, base / "build", base / "interfaces", (embedded,))


@pytest.fixture
def ament(tmp_path: Path, embedded: Path) -> Ament:
    """Make projects that see the build tools and, if they are installed, each other."""
    return projects_in(tmp_path, embedded)


def projects_in(folder: Path, *others: Path) -> Ament:
    """Return what makes projects in a folder, which see each other and what is in other prefixes."""
    prefixes = [*others]

    def make(
        commands: str, name: str = "demo", *, manifest: str = "", files: Mapping[str, str] | None = None
    ) -> Project:
        source = folder / "src" / name
        language = "CXX" if files and any(path.endswith(".cpp") for path in files) else "NONE"
        lists = f"cmake_minimum_required(VERSION 3.5...3.25)\nproject({name} {language})\n"
        lists += f"find_package(ament_cmake REQUIRED)\n{commands}\n"
        texts = {
            "CMakeLists.txt": lists,
            "package.xml": MANIFEST.format(name=name, lines=manifest),
            **(files or {}),
        }
        write_files(source, texts)
        prefix = folder / "install" / name
        project = Project(source, folder / "build" / name, prefix, tuple(prefixes))
        prefixes.insert(0, prefix)
        return project

    return make


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the longest file, so that no process works on it alone at the end."""
    items.sort(key=lambda item: item.path.name != "test_shapes.py")


def _install_embedded(names: tuple[str, ...], build: Path, prefix: Path, others: tuple[Path, ...]) -> Path:
    for name in names:
        Project(EMBEDDED / name, build / name, prefix, (prefix, *others)).install()
    return prefix
