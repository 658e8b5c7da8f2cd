"""The ten shapes of tests/cmake/shapes, built by forge: copied and linked, with tests and without."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.cmake.conftest import ROOT
from tests.conftest import Golden

SHAPES = Path(__file__).parent / "shapes"
MESSAGES = int(os.environ.get("FORGE_TEST_MESSAGES", "120"))
BUILD_TOOLS = ("ament_cmake", "ament_lint_auto", "rosidl_default_generators")
PYTHON = f"python{sys.version_info.major}.{sys.version_info.minor}"


@dataclass(frozen=True, slots=True)
class Built:
    """A workspace of all shapes that was built in one way."""

    root: Path
    words: tuple[str, ...]

    @property
    def packages(self) -> list[str]:
        """The packages of the shapes; those that forge added are left out."""
        own = {path.parent.name for path in self.root.glob("src/**/package.xml")}
        return sorted(own - {"src"})

    def run(self, *argv: str, sourced: bool = False) -> str:
        """Run a program, which must succeed, far from other workspaces and with no forge on PATH."""
        names = ("PATH", "HOME", "TMPDIR", "CMAKE_GENERATOR")
        kept = {key: os.environ[key] for key in names if key in os.environ}
        if sourced:
            argv = ("sh", "-c", '. install/setup.sh && exec "$@"', "sh", *argv)
        done = subprocess.run(
            argv,
            cwd=self.root,
            env=kept,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout
        return done.stdout

    def ctest(self, name: str, *words: str) -> str:
        """Run CTest on a package and return what it said."""
        return self.run("cmake", "-E", "chdir", f"build/{name}", "ctest", *words, sourced=True)

    def build(self) -> str:
        """Build the workspace and return what was said."""
        return self.run("env", f"PYTHONPATH={ROOT}", sys.executable, "-m", "forge", "build", *self.words)


def _workspace(root: Path, messages: int, *words: str) -> Built:
    """Copy the shapes, write the many messages, build."""
    copy_shapes(root, messages)
    built = Built(root, words)
    built.build()
    return built


def copy_shapes(root: Path, messages: int) -> None:
    """Copy the shapes into a workspace, and write the many messages, that many of them."""
    shutil.copytree(SHAPES, root / "src", ignore=shutil.ignore_patterns("README.md"))
    folder = root / "src/4_many_messages/many_msgs/msg"
    folder.mkdir()
    for number in range(messages):
        before = f"Number{number - 1}[<=2] before\n" if number % 4 else ""
        (folder / f"Number{number}.msg").write_text(
            f"clock_types/Stamp stamp\nfloat64[{number + 1}] values\nstring name\n{before}", encoding="utf-8"
        )


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Built:
    """Build with tests, by copies."""
    return _workspace(tmp_path_factory.mktemp("copied"), MESSAGES)


@pytest.fixture(scope="module")
def linked(tmp_path_factory: pytest.TempPathFactory) -> Built:
    """Build without tests, by links, into one prefix; with a few of the many messages and of the users."""
    root = tmp_path_factory.mktemp("linked")
    arguments = ("--cmake-args", "-DBUILD_TESTING=OFF", "-DUSERS_OF=late_lib;sample_msgs;gate")
    return _workspace(root, 8, "--symlink-install", "--merge-install", *arguments)


@pytest.mark.newest_cmake
def test_every_shape_builds_and_installs_the_expected_files(copied: Built, golden: Golden) -> None:
    golden(
        "cmake/shapes", {f"{name}.txt": _listing(copied.root / "install" / name) for name in copied.packages}
    )


def _listing(prefix: Path) -> str:
    """Return what is installed, a path per line; what generated code is made of inside is left out."""
    paths = sorted(str(path.relative_to(prefix)) for path in prefix.rglob("*") if not path.is_dir())
    inside = re.compile(r"__pycache__|/detail/|/_[a-z]|[nN]umber_?(?!1\.)\d")
    version = re.compile(rf"{PYTHON}|py{PYTHON.removeprefix('python')}")
    return "".join(f"{version.sub('pythonX.Y', path)}\n" for path in paths if not inside.search(path))


@pytest.mark.newest_cmake
def test_a_second_build_has_nothing_to_do(copied: Built) -> None:
    assert "Starting" not in copied.build()
    for name in copied.packages:
        said = copied.run("cmake", "--build", f"build/{name}")
        assert not re.search(r"Building|Generating|Linking|^\[\d+/", said, re.MULTILINE), said


@pytest.mark.newest_cmake
def test_the_tests_of_the_shapes_pass(copied: Built) -> None:
    for name in copied.packages:
        copied.ctest(name, "--output-on-failure")


@pytest.mark.newest_cmake
def test_missing_linters_are_skipped_tests(copied: Built) -> None:
    listing = copied.ctest("late_lib", "-N")
    assert set(re.findall(r"#\d+: (\w+)$", listing, re.MULTILINE)) == {
        *("copyright", "cppcheck", "cpplint", "flake8", "lint_cmake", "pep257", "uncrustify", "xmllint"),
        "test_late",
    }


@pytest.mark.newest_cmake
def test_every_way_of_using_the_packages_works(copied: Built) -> None:
    programs = sorted((copied.root / "install/users/lib/users").iterdir())
    assert len(programs) == 20
    for program in programs:
        copied.run(str(program), sourced=True)


def test_third_party_macros_install_programs_and_index_entries(copied: Built) -> None:
    prefix = copied.root / "install/assembly"
    copied.run(str(prefix / "lib/assembly/wheel_runner"), sourced=True)
    assert (prefix / "share/ament_index/resource_index/parts/assembly").read_text(encoding="utf-8") == (
        "assembly::Wheel;lib/libwheel.so\nassembly::Engine;lib/libengine.so\nassembly::Pump;lib/libengine.so\n"
    )


def test_hand_written_python_next_to_generated_python_can_be_imported(copied: Built) -> None:
    code = "from sample_msgs.readings import sample_reading; import frame_msgs; print(sample_reading())"
    assert "high=4.5" in copied.run(sys.executable, "-c", code, sourced=True)


def test_plain_cmake_can_use_every_shape_without_ament(copied: Built) -> None:
    """Neither forge nor any build tool is there: only what the packages themselves installed."""
    prefixes = [path for path in (copied.root / "install").iterdir() if path.name not in BUILD_TOOLS]
    where = ";".join(str(path) for path in prefixes if path.is_dir())
    copied.run("cmake", "-S", "src/users/plain", "-B", "plain", "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={where}")
    copied.run("cmake", "--build", "plain")
    programs = [
        *(copied.root / "plain").glob("*_by_targets"),
        *(copied.root / "plain").glob("*_by_variables"),
    ]
    assert len(programs) == 19
    for program in programs:
        copied.run(str(program), sourced=True)


def test_symlink_installs_without_tests_work(linked: Built) -> None:
    installs_links = linked.run("cmake", "--version").split()[2].split(".") >= ["3", "22"]
    header = linked.root / "install/include/late_lib/late_lib/late.hpp"
    assert header.is_symlink() == installs_links
    assert (linked.root / "install/lib/liblate_lib.so").is_symlink() == installs_links
    programs = sorted((linked.root / "install/lib/users").iterdir())
    assert len(programs) == 6
    for program in programs:
        linked.run(str(program), sourced=True)
    for name in linked.packages:
        assert "Total Tests: 0" in linked.ctest(name, "-N"), name
    assert "Starting" not in linked.build()
