"""Fixtures of all tests: files, runs of forge, goldens, generated Python, required tools."""

from __future__ import annotations

import difflib
import gc
import os
import shutil
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Protocol
from unittest.mock import patch

import pytest
from hypothesis import HealthCheck, settings

from forge.base.extensions import OPTIONS, is_installed
from forge.base.files import write_if_changed
from forge.cli.main import main
from forge.output.handlers import CI_SERVICES
from tests.generated import generate, importable, probe_catalog
from tests.packages import write_files
from tests.rosidl import DEBIAN, EMPY, MODULES

# A suite that was started in the background, or below nohup, ignores these, and what it starts would, too.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)

# How long an example takes says more about the machine than about forge.
settings.register_profile("forge", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("quick", settings.get_profile("forge"), max_examples=25)
settings.load_profile("forge")

if TYPE_CHECKING:
    from tests.browser import Browser

Variables = Mapping[str, str | None]
"""Values by name; None takes a variable away."""

collect_ignore = ["golden"]
"""Goldens hold tests as well: those of the packages that `forge pkg create` makes."""

GOLDEN = Path(__file__).parent / "golden"

REMEDIES = {
    **{str(path): "make peers" for path in EMPY.values()},
    str(DEBIAN): "make debian-peers",
    str(MODULES / "rosidl_parser"): "make debian-peers",
    "/usr/include/catch2/catch.hpp": "apt-get install catch2",
    "/usr/include/fastcdr/Cdr.h": "apt-get install libfastcdr-dev",
    "/usr/sbin/nginx": "apt-get install nginx-light",
    "aarch64-linux-gnu-g++": "apt-get install g++-aarch64-linux-gnu",
    "bash": "apt-get install bash",
    "cargo": "apt-get install cargo",
    "ccache": "apt-get install ccache",
    "chromedriver": "apt-get install chromium-driver",
    "chromium": "apt-get install chromium",
    "clang": "apt-get install clang",
    "clang++": "apt-get install clang",
    "cmake": "pip install cmake",
    "colcon": "make peers",
    "dash": "apt-get install dash",
    "distcc": "apt-get install distcc",
    "distccd": "apt-get install distcc",
    "fish": "apt-get install fish",
    "g++": "apt-get install g++",
    "gcc": "apt-get install gcc",
    "gcov": "apt-get install gcc",
    "gcovr": "pip install gcovr",
    "git": "apt-get install git",
    "make": "apt-get install make",
    "ninja": "pip install ninja",
    "openssl": "apt-get install openssl",
    "pgrep": "apt-get install procps",
    "pkg-config": "apt-get install pkg-config",
    "python-zig": "make peers",
    "qemu-aarch64": "apt-get install qemu-user",
    "sccache": "apt-get install sccache",
    "shellcheck": "apt-get install shellcheck",
    "strace": "apt-get install strace",
    "zsh": "apt-get install zsh",
}
"""The command that brings each tool, or file, which a test may need."""

_FOREIGN = (
    *("AMENT_", "CLICOLOR", "CMAKE_PREFIX_PATH", "COLCON_", "FORCE_COLOR", "FORGE_", "PYTHONPATH", "ROS_"),
    *("GITHUB_", "GITLAB_CI"),
)
_LEFT_OUT = "left_out"
SLOW = "make test-all"
"""The command that runs the slow tests, too."""


class Tree(Protocol):
    """What the fixture `tree` gives."""

    def __call__(self, files: Mapping[str, str]) -> Path:
        """Write the files below the test's folder and return that; a text with '#!' is executable."""


@dataclass(frozen=True, slots=True)
class Ran:
    """What a command line left behind: its exit code and what it printed, children included."""

    code: int
    out: str
    err: str


class Forge(Protocol):
    """What the fixture `forge` gives."""

    def __call__(self, *argv: str, cwd: Path | None = None, env: Variables | None = None) -> Ran:
        """Run the command line in-process; `env` adds variables, and takes away those that are None."""


class Golden(Protocol):
    """What the fixture `golden` gives."""

    def __call__(self, case: Path | str, files: Mapping[str, str]) -> None:
        """Hold `files` against CASE/expected, or write them there; a str is below tests/golden."""


@pytest.fixture(autouse=True)
def process_is_left_alone() -> Iterator[None]:
    """Restore variables and sys.path, and fail a test that left some changed for those after it."""
    before, path = _variables(), list(sys.path)
    yield
    after = _variables()
    changed = sorted(name for name in before.keys() | after.keys() if before.get(name) != after.get(name))
    if sys.path != path:
        changed.append("sys.path")
        sys.path[:] = path
    if changed:
        os.environ.clear()
        os.environ.update(before)
        pytest.fail(f"left changed: {' '.join(changed)}", pytrace=False)


@pytest.fixture
def own_environment() -> Iterator[None]:
    """Restore the environment after a test; setuptools, run in this process, sets variables."""
    with patch.dict(os.environ):
        yield


def _variables() -> dict[str, str]:
    """Return the environment without the variable that pytest itself changes."""
    return {name: value for name, value in os.environ.items() if name != "PYTEST_CURRENT_TEST"}


@pytest.fixture
def tree(tmp_path: Path) -> Tree:
    """Make files from a table of paths and texts."""

    return partial(write_files, tmp_path)


@pytest.fixture
def built(forge: Forge, tree: Tree) -> Tree:
    """Make the files of a workspace, and build it."""

    def build(files: Mapping[str, str]) -> Path:
        root = tree(files)
        ran = forge("build", cwd=root)
        assert ran.code == 0, ran.err
        return root

    return build


@pytest.fixture(scope="session")
def detected_compilers(tmp_path_factory: pytest.TempPathFactory) -> Path | None:
    """Return a folder for the results of compiler detection, which all workspaces of a session share.

    A module that counts how often compilers are started has a fixture of this name that returns None.
    """
    return tmp_path_factory.mktemp("compilers")


@pytest.fixture
def forge(capfd: pytest.CaptureFixture[str], detected_compilers: Path | None) -> Forge:
    """Run forge as its users do, but in-process and far from any ROS that this shell has sourced.

    Half of what a small workspace takes is compiler detection. A build folder gets the results of an
    earlier one if forge gives both the same key, as it does for builds in one folder.
    """

    def run(*argv: str, cwd: Path | None = None, env: Variables | None = None) -> Ran:
        capfd.readouterr()
        with surroundings(cwd, env or {}), _detecting_once(detected_compilers):
            try:
                code = main(argv)
            except SystemExit as leaving:  # argparse leaves this way, after --help and after mistakes
                code = leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
        out, err = capfd.readouterr()
        return Ran(code, out, err)

    return run


@pytest.fixture
def golden(request: pytest.FixtureRequest) -> Golden:
    """Compare texts with those that a reviewer has accepted."""
    accept: bool = request.config.getoption("--accept")

    def hold(case: Path | str, files: Mapping[str, str]) -> None:
        expected = GOLDEN / case / "expected"
        if accept:
            _accept(expected, files)
        else:
            differences = "".join(_differences(_read(expected), files))
            if differences:
                pytest.fail(f"{differences}\nif this is intended: pytest --accept", pytrace=False)

    return hold


@pytest.fixture(scope="module")
def probe(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Generate the package 'probe' and let it be imported; gives the folder it is in."""
    folder = tmp_path_factory.mktemp("python")
    generate(folder, probe_catalog())
    with importable(folder):
        yield folder


@pytest.fixture
def msg(probe: Path) -> ModuleType:
    """Import probe.msg."""
    assert (probe / "probe" / "msg").is_dir()
    return import_module("probe.msg")


@pytest.fixture(scope="session")
def chromium() -> Iterator[Browser]:
    """Run one browser for all tests of pages."""
    from tests.browser import started

    with started() as running:
        yield running


@pytest.fixture
def browser(chromium: Browser) -> Iterator[Browser]:
    """Open pages in a real browser; the test fails when one of them complains. It `needs` both programs."""
    yield chromium
    assert chromium.complaints() == []


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add --accept, --once and --skip-slow."""
    parser.addoption("--accept", action="store_true", help="write what goldens are to expect from now on")
    parser.addoption("--once", metavar="FILE", help="skip the tests listed in FILE; add those that pass")
    parser.addoption("--skip-slow", action="store_true", help="leave out the tests that are marked slow")


def pytest_configure(config: pytest.Config) -> None:
    """Let tests find the programs of their own virtual environment, activated or not, and last the peers'.

    FORGE_TEST_CMAKE names a CMake that everybody finds first, and CMAKE_GENERATOR what all projects are
    built by.
    """
    if "FORGE_TEST_CMAKE" in os.environ:
        _put_first(Path(os.environ["FORGE_TEST_CMAKE"]), config)
    for folder in (Path(sys.executable).parent, GOLDEN.parents[1] / ".venv-peers" / "bin"):
        if folder.is_dir() and str(folder) not in os.environ.get("PATH", "").split(os.pathsep):
            os.environ["PATH"] = os.pathsep.join(filter(None, (os.environ.get("PATH"), str(folder))))
    if sys.prefix != sys.base_prefix:
        os.environ["VIRTUAL_ENV"] = sys.prefix
    # forge would print for the service that runs the tests.
    for name in CI_SERVICES.values():
        os.environ.pop(name, None)


def _put_first(cmake: Path, config: pytest.Config) -> None:
    """Put a CMake and its CTest first on PATH, and nothing else that lies beside them."""
    folder = tempfile.TemporaryDirectory(prefix="forge-test-cmake-")
    config.add_cleanup(folder.cleanup)
    for program in ("cmake", "ctest"):
        Path(folder.name, program).symlink_to(cmake.absolute().with_name(program))
    os.environ["PATH"] = os.pathsep.join((folder.name, os.environ.get("PATH", "")))


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Do not run what has passed elsewhere."""
    file = config.getoption("--once")
    if file and Path(file).exists():
        passed = frozenset(Path(file).read_text(encoding="utf-8").splitlines())
        config.hook.pytest_deselected(items=[item for item in items if item.nodeid in passed])
        items[:] = [item for item in items if item.nodeid not in passed]


def pytest_collection_finish() -> None:
    """Spare garbage collections the thousands of tests; at its end, pytest makes five, a second each."""
    gc.freeze()


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Leave out a test whose tool this machine lacks, and slow ones on request."""
    if item.config.getoption("--skip-slow") and item.get_closest_marker("slow"):
        pytest.skip(f"slow: {SLOW}")
    for marker in item.iter_markers("needs"):
        for tool in marker.args:
            if not _is_there(tool):
                item.user_properties.append((_LEFT_OUT, tool))
                pytest.skip(f"needs {tool}")


def _is_there(tool: str) -> bool:
    """Tell if the machine has a program, or a file where a path is given."""
    return Path(tool).exists() if tool.startswith("/") else shutil.which(tool) is not None


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say what was left out, and which command brings it back."""
    tools, reasons = _left_out(terminalreporter)
    if not tools and not reasons:
        return
    terminalreporter.section("left out")
    for tool, count in sorted(tools.items()):
        remedy = REMEDIES.get(tool, f"put '{tool}' on PATH")
        terminalreporter.line(f"{count} for want of {tool}: {remedy}")
    for reason, count in sorted(reasons.items()):
        terminalreporter.line(f"{count} because of: {reason}")
    if terminalreporter.config.getoption("--skip-slow"):
        terminalreporter.line("more random edits, kills and faults: make soak; more messages: make fuzz")
        terminalreporter.line("thousands of packages: make scale; all benchmark scenarios: make quick-bench")


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write down what has passed; where FORGE_TEST_NOTHING_LEFT_OUT is set, fail if anything was left out."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    file = session.config.getoption("--once")
    if reporter and file and not hasattr(session.config, "workerinput"):  # xdist's workers report as well
        with Path(file).open("a", encoding="utf-8") as lines:
            lines.writelines(f"{report.nodeid}\n" for report in reporter.stats.get("passed", []))
    if reporter and os.environ.get("FORGE_TEST_NOTHING_LEFT_OUT") == "1" and any(_left_out(reporter)):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def _left_out(reporter: pytest.TerminalReporter) -> tuple[Counter[str], Counter[str]]:
    """Count the tests left out, by the tool they need and, for the others, by their reason."""
    tools: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    for report in reporter.stats.get("skipped", []):
        tool = dict(getattr(report, "user_properties", ())).get(_LEFT_OUT)
        if tool is not None:
            tools[str(tool)] += 1
        else:
            reasons[report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)] += 1
    return tools, reasons


@contextmanager
def _detecting_once(results: Path | None) -> Iterator[None]:
    """Let a build folder without results of compiler detection take those of the same key."""
    if results is None or not is_installed(OPTIONS, "toolchain-cache"):
        yield
        return
    from forge.plugins.compiler_probe.probe import Toolchain

    detect = Toolchain._configure

    def configure(toolchain: Toolchain, variables: Mapping[str, str]) -> None:
        home = toolchain._home
        if not home.exists() and (results / home.name).is_dir():
            shutil.copytree(results / home.name, home, symlinks=True)
        detect(toolchain, variables)
        if toolchain._results() is not None and not (results / home.name).exists():
            shutil.copytree(home, results / home.name, symlinks=True)

    with patch.object(Toolchain, "_configure", configure):
        yield


@contextmanager
def surroundings(cwd: Path | None, env: Variables) -> Iterator[None]:
    """Change the working folder and the environment for a while."""
    with pytest.MonkeyPatch.context() as changes:
        for name in [name for name in os.environ if name.startswith(_FOREIGN)]:
            changes.delenv(name)
        for name, value in env.items():
            if value is None:
                changes.delenv(name, raising=False)
            else:
                changes.setenv(name, value)
        if cwd is not None:
            changes.chdir(cwd)
        yield


def _read(folder: Path) -> dict[str, str]:
    """Return every file below the folder by its relative path."""
    paths = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_text(encoding="utf-8") for path in paths}


def _differences(expected: Mapping[str, str], actual: Mapping[str, str]) -> Iterator[str]:
    """Yield a unified diff per file that is not as expected, missing and additional ones included."""
    for name in sorted(expected.keys() | actual.keys()):
        if name not in actual:
            yield f"missing: {name}\n"
        elif name not in expected:
            yield f"not expected: {name}\n{actual[name]}\n"
        elif expected[name] != actual[name]:
            before, after = (texts[name].splitlines(keepends=True) for texts in (expected, actual))
            yield from difflib.unified_diff(before, after, f"expected/{name}", f"actual/{name}")


def _accept(expected: Path, files: Mapping[str, str]) -> None:
    """Make the folder hold exactly these files."""
    for name in _read(expected).keys() - files.keys():
        (expected / name).unlink()
    for name, text in files.items():
        write_if_changed(expected / name, text)
