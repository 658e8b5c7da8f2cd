"""forge works without each of its plugins, and finds the plugins of other distributions."""

import functools
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from tests.conftest import Tree
from tests.packages import distribution, manifest_text, write_files
from tests.snippets import ROOT, blocks
from tests.without_plugins import ALL, PLUGINS, copy_without

PAGE = (ROOT / "docs/how-to/plugins.md").read_text(encoding="utf-8")

NEEDS = (
    "<buildtool_depend>rosidl_default_generators</buildtool_depend>"
    "<member_of_group>rosidl_interface_packages</member_of_group>"
)
WORKSPACE = {
    "ws/src/shapes/package.xml": manifest_text("shapes", NEEDS),
    "ws/src/shapes/CMakeLists.txt": "cmake_minimum_required(VERSION 3.18)\nproject(shapes NONE)\n"
    "find_package(ament_cmake REQUIRED)\nfind_package(rosidl_default_generators REQUIRED)\n"
    "rosidl_generate_interfaces(shapes msg/Point.msg)\nament_package()\n",
    "ws/src/shapes/msg/Point.msg": "float64 x\n",
}
PLAIN = {
    "ws/src/shapes/package.xml": manifest_text("shapes", build_type="cmake"),
    "ws/src/shapes/CMakeLists.txt": "cmake_minimum_required(VERSION 3.18)\nproject(shapes NONE)\n"
    "install(FILES package.xml DESTINATION share/shapes)\n",
}


ALL_IN_ONE = """import sys
from forge.cli.main import main
for command in sys.argv[1:]:
    if code := main(command.split()):
        sys.exit(f"{command}: {code}")
"""
"""Runs several commands in one process, which takes half of the time."""


def run_forge(
    folder: Path, *words: str, path: Path = ROOT, variables: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Run forge with the modules in the folder `path` first."""
    return run_python(folder, "-m", "forge", *words, path=path, variables=variables)


def run_python(
    folder: Path, *words: str, path: Path, variables: Mapping[str, str] | None
) -> subprocess.CompletedProcess[str]:
    """Run Python with the modules in the folder `path` first."""
    environment = {
        "PYTHONPATH": str(path),
        "PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin",
        "HOME": str(folder),
        **(variables or {}),
    }
    argv = [sys.executable, *words]
    return subprocess.run(argv, cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def forge_without(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Return a function that copies forge without a plugin; it returns the folder for PYTHONPATH."""

    @functools.cache
    def forge_without(plugin: str) -> Path:
        copy = tmp_path_factory.mktemp(plugin) / "copy"
        return copy_without(plugin, copy, "forge", "templates", "_ros_forge.py")

    return forge_without


@pytest.fixture(scope="module")
def underlay(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Build the embedded packages once; return the variables of their prefix and of forge's caches."""
    root = write_files(tmp_path_factory.mktemp("underlay"), WORKSPACE) / "ws"
    ran = run_forge(root, "build", "--merge-install")
    assert ran.returncode == 0, ran.stderr
    prefix = str(root / "install")
    return {"AMENT_PREFIX_PATH": prefix, "CMAKE_PREFIX_PATH": prefix, "HOME": str(root)}


OF_INTERFACES = {"c_target", "fast_rosidl", "interface_pages", "interface_versions", "json_schema"}
OF_INTERFACES |= {"arrow", "idl", "python_cdr", "protobuf", "typescript", ALL}


@pytest.mark.parametrize("plugin", [ALL, *PLUGINS])
def test_forge_builds_without_the_plugin(
    plugin: str, request: pytest.FixtureRequest, tree: Tree, forge_without: Callable[[str], Path]
) -> None:
    """An interface package if the plugin has to do with interfaces, else one that is cheaper to build."""
    copy = forge_without(plugin)
    has_interfaces = plugin in OF_INTERFACES
    root = tree(WORKSPACE if has_interfaces else PLAIN) / "ws"
    variables = request.getfixturevalue("underlay") if has_interfaces else None
    commands = ["list", "build", "test"]
    of_plugins = {"completion": "completion bash", "extensions": "extensions", "test_results": "test-result"}
    commands += (command for each, command in of_plugins.items() if plugin not in {ALL, each})
    ran = run_python(root, "-c", ALL_IN_ONE, *commands, path=copy, variables=variables)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert (root / "install/shapes/share/shapes/package.xml").is_file()
    assert (root / "install/shapes/share/shapes/msg/Point.msg").is_file() == has_interfaces


@pytest.mark.parametrize(
    ("words", "what", "plugin", "extra"),
    [
        ("lsp", "command 'lsp'", "lsp", " with the extra 'lsp'"),
        (
            "build --executor dask --scheduler tcp://127.0.0.1:1",
            *("executor 'dask'", "dask", " with the extra 'dask'"),
        ),
        ("graph", "command 'graph'", "charts", ""),
        ("list -g", "command 'graph'", "charts", ""),
        ("cache stats", "command 'cache'", "package_cache", ""),
        ("build --cache", "option 'cache'", "package_cache", ""),
        ("list --mixin debug", "option 'mixin'", "mixins", ""),
        (
            "list --packages-select-build-failed",
            *("option 'packages-select-build-failed'", "last_results", ""),
        ),
        ("list --packages-select-changed", "option 'packages-select-changed'", "git_changes", ""),
        ("pkg create a", "verb 'create'", "create", ""),
        ("build --watch", "option 'watch'", "watch", ""),
        ("build --explain", "option 'explain'", "explain", ""),
        ("build --timings", "reporter 'timings'", "charts", ""),
        ("test --coverage", "reporter 'coverage'", "coverage", ""),
        ("test --last-failed", "selection of 'single-tests'", "single_tests", ""),
        ("test a::b", "selection of 'single-tests'", "single_tests", ""),
        ("test --retest-until-pass 1", "option 'retest-until-pass'", "flaky_tests", ""),
    ],
)
def test_using_a_missing_plugin_names_the_install_command(
    words: str, what: str, plugin: str, extra: str, tree: Tree, forge_without: Callable[[str], Path]
) -> None:
    root = tree({"ws/src/a/package.xml": manifest_text("a")}) / "ws"
    ran = run_forge(root, *words.split(), path=forge_without(plugin))
    assert ran.returncode == 2
    message = f"error: the {what} needs the plugin '{plugin}', which is not installed"
    assert ran.stderr.startswith(f"{message}\nhint: reinstall forge{extra}; see file:///")
    assert ran.stderr.count("\n") == 2
    assert [path.name for path in root.iterdir()] == ["src"]


def test_a_target_of_a_missing_plugin_names_the_install_command(
    tree: Tree, forge_without: Callable[[str], Path]
) -> None:
    copy = forge_without("cross")
    ran = run_forge(tree(WORKSPACE) / "ws", "build", "--target", "arm64", path=copy)
    assert ran.returncode == 2
    message = "error: the toolchain 'cross' needs the plugin 'cross', which is not installed"
    assert f"{message}\nhint: reinstall forge with the extra 'cross'; see file:///" in ran.stderr
    assert ran.stderr.count("error:") == 1


def test_an_idl_file_needs_the_plugin_idl(tree: Tree, forge_without: Callable[[str], Path]) -> None:
    root = tree({"msg/A.idl": "module p { module msg { struct A { long x; }; }; };"})
    words = ("interface", "generate", "--package", "p", "--output", "out", ".")
    ran = run_forge(root, *words, path=forge_without("idl"))
    message = "msg/A.idl: error: the format 'idl' needs the plugin 'idl', which is not installed\nhint:"
    assert (ran.returncode, ran.stderr[: len(message)]) == (2, message)


TOOLCHAIN = """\
import shutil
from pathlib import Path
from forge.base.layout import TOOLCHAIN_DIR
from forge.toolchain.targets import CrossBuild

SDK = Path(__file__).parent / "sdk"

def prepare(target, layout, variables, options):
    file = layout.build / TOOLCHAIN_DIR / "board.cmake"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(f'set(BOARD "{target}")\\nset(CMAKE_CROSSCOMPILING_EMULATOR "{SDK}/run")\\n')
    return CrossBuild(
        cmake_args=(f"-DCMAKE_TOOLCHAIN_FILE={file}",),
        variables={"BOARD_ROOT": str(SDK)},
        programs=(SDK / "version",),
        prepare_compilers=lambda packages: print("prepared", *(p.name for p in packages)) or (),
    )

def has_emulator(layout):
    return (SDK / "run").exists()
"""
BOARD = {
    "toolchain/board_toolchain.py": TOOLCHAIN,
    **distribution("board", "forge.toolchains", "board = board_toolchain", "toolchain/"),
    "toolchain/sdk/version": "1\n",
    "toolchain/sdk/run": "#!/bin/sh\ntouch ran\n",
    "ws/src/blink/package.xml": manifest_text("blink", build_type="cmake"),
    "ws/src/blink/CMakeLists.txt": "cmake_minimum_required(VERSION 3.18)\nproject(blink C)\n"
    "add_executable(blink main.c)\n"
    'file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/board "${BOARD} $ENV{BOARD_ROOT}")\n'
    "install(FILES ${CMAKE_CURRENT_BINARY_DIR}/board DESTINATION share/blink)\n"
    "enable_testing()\nadd_test(NAME blink COMMAND blink)\n",
    "ws/src/blink/main.c": "int main(void) { return 1; }\n",
}


@pytest.mark.needs("cmake")
def test_a_third_party_toolchain_builds_for_its_platform(tree: Tree) -> None:
    root = tree(BOARD)
    (root / "toolchain/sdk/run").chmod(0o755)

    def forge(*words: str) -> subprocess.CompletedProcess[str]:
        return run_forge(root / "ws", *words, path=root / "toolchain")

    assert "\n  board  board 1\n" in forge("extensions").stdout
    built = forge("build", "--target", "board")
    assert (built.returncode, "prepared blink\n" in built.stdout) == (0, True), built.stderr
    installed = root / "ws/install/board/blink/share/blink/board"
    assert installed.read_text() == f"board {root}/toolchain/sdk"
    assert "1 package unchanged" in forge("build", "--target", "board").stdout
    (root / "toolchain/sdk/version").write_text("2.0\n")
    assert "1 package finished" in forge("build", "--target", "board").stdout
    tested = forge("test", "--target", "board", "--return-code-on-test-failure")
    assert tested.returncode == 0, tested.stdout
    assert (root / "ws/build/board/blink/ran").is_file()
    (root / "toolchain/sdk/run").unlink()
    assert "cannot run the tests of programs for 'board'" in forge("test", "--target", "board").stderr


def test_packages_of_a_missing_build_type_plugin_are_skipped_with_a_hint(
    tree: Tree, forge_without: Callable[[str], Path]
) -> None:
    copy = forge_without("cargo")
    manifest = '[package]\nname = "b"\n'
    files = {"a/package.xml": manifest_text("a", build_type="ament_cargo"), "b/Cargo.toml": manifest}
    root = tree({f"ws/src/{name}": text for name, text in files.items()}) / "ws"
    lacks = "needs the plugin 'cargo', which is not installed"
    ran = run_forge(root, "list", path=copy)
    assert (ran.returncode, ran.stdout) == (0, "a\tsrc/a\t(ros.ament_cargo)\n")
    assert f"src/b/Cargo.toml: warning: the build type 'cargo' {lacks}\nhint: reinstall forge" in ran.stderr
    ran = run_forge(root, "build", path=copy)
    assert ran.returncode == 0
    assert "warning: skipping 'a': unknown build type 'ament_cargo'\n" in ran.stderr
    assert f"hint: the build type 'ament_cargo' {lacks}; reinstall forge; see file:///" in ran.stderr
    ran = run_forge(root, "build", "--packages-select", "a", path=copy)
    assert (ran.returncode, f"'ament_cargo' {lacks}" in ran.stderr) == (2, True)


def test_python_packages_without_the_plugin_give_a_hint(
    tree: Tree, forge_without: Callable[[str], Path]
) -> None:
    copy = forge_without("pyproject")
    project = '[build-system]\nbuild-backend = "hatchling.build"\n[project]\nname = "b"\n'
    files = {"a/package.xml": manifest_text("a", build_type="ament_python"), "a/pyproject.toml": project}
    root = tree({f"ws/src/{name}": text for name, text in {**files, "b/pyproject.toml": project}.items()})
    problem = "the build type 'python' needs the plugin 'pyproject', which is not installed\nhint:"
    ran = run_forge(root / "ws", "list", path=copy)
    assert (ran.returncode, ran.stdout) == (0, "a\tsrc/a\t(ros.ament_python)\n")
    assert f"src/b/pyproject.toml: warning: {problem}" in ran.stderr
    ran = run_forge(root / "ws", "build", path=copy)
    assert (ran.returncode, f"error: {problem}" in ran.stderr) == (1, True)


@pytest.mark.parametrize("url", ["http://127.0.0.1:1", "s3://bucket/folder"])
def test_a_remote_cache_without_its_plugin_is_rejected_before_the_build(
    url: str, tree: Tree, forge_without: Callable[[str], Path]
) -> None:
    copy = forge_without("remote_cache")
    root = tree(WORKSPACE) / "ws"
    ran = run_forge(root, "build", "--remote-cache", url, path=copy)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert re.fullmatch(
        r"error: the remote cache backend '(http|fsspec)' needs the plugin 'remote_cache', which is not "
        r"installed\nhint: reinstall forge with the extra 'remote'; see file:///.*\n",
        ran.stderr,
    )
    assert not (root / "build/shapes").exists()


def test_a_third_party_remote_cache_stores_and_restores(tree: Tree) -> None:
    code = next(block.text for block in blocks(PAGE) if "def connect" in block.text)
    root = tree({**PLAIN, "site/shelf.py": code, **distribution("shelf", "forge.stores", folder="site/")})
    for cache, restored in (("one", False), ("two", True)):
        words = ("build", "--cache", f"{root}/{cache}", "--remote-cache", f"shelf://{root}/shelf")
        ran = run_forge(root / "ws", *words, path=root / "site")
        assert (ran.returncode, ran.stderr) == (0, "")
        assert ("1 package came from the cache\n" in ran.stdout) == restored
        for folder in ("build", "install"):
            shutil.rmtree(root / "ws" / folder)
    assert "  shelf   shelf 1\n" in run_forge(root, "extensions", path=root / "site").stdout


def test_a_verb_of_a_missing_plugin_names_the_install_command(
    tmp_path: Path, forge_without: Callable[[str], Path]
) -> None:
    copy = forge_without("interface_pages")
    (tmp_path / "msg").mkdir()
    (tmp_path / "msg/X.msg").write_text("int8 a\n", encoding="utf-8")
    generate = ("interface", "generate", "--package", "p", "--output", "out", "--lang", "docs", ".")
    for words in (("interface", "docs", "-o", "out"), generate):
        ran = run_forge(tmp_path, *words, path=copy)
        assert (ran.returncode, ran.stdout) == (2, "")
        assert "'docs' needs the plugin 'interface_pages', which is not installed\nhint: " in ran.stderr


def test_a_third_party_verb_is_found(tree: Tree) -> None:
    code = '"""Count interfaces."""\ndef register(parser): parser.add_argument("-x", type=int)\n'
    root = tree(
        {
            "count_interfaces.py": code + "def run(options):\n    return options.x\n",
            **distribution("counting", "forge.interfaces.verbs", "count = count_interfaces"),
        }
    )
    assert run_forge(root, "interface", "count", "-x", "7", path=root).returncode == 7
    assert "Count interfaces." in run_forge(root, "interface", "count", "--help", path=root).stdout
    assert re.search(r"\n  count +counting 1\n", run_forge(root, "extensions", path=root).stdout)


def test_a_third_party_command_is_installed_from_a_wheel(tmp_path: Path) -> None:
    for block in blocks(PAGE):
        if block.mark.startswith("write: plugin_ws/"):
            path = tmp_path / "project" / Path(block.mark.removeprefix("write: ")).name
            path.parent.mkdir(exist_ok=True)
            path.write_text(block.text, encoding="utf-8")
    pip = (sys.executable, "-m", "pip", "install", "--quiet", "--no-build-isolation", "--no-deps", "--target")
    subprocess.run([*pip, str(tmp_path / "site"), str(tmp_path / "project")], check=True)
    ran = run_forge(tmp_path, "licenses", "project", path=tmp_path / "site")
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, "forge-licenses: none\n", "")
    help_text = run_forge(tmp_path, "licenses", "--help", path=tmp_path / "site").stdout
    assert "Print the license of each package below a folder." in help_text
    extensions = run_forge(tmp_path, "extensions", path=tmp_path / "site").stdout
    assert "licenses forge-licenses 1.0" in " ".join(extensions.split())


def write_reporter(root: Path, code: str) -> None:
    """Write a distribution with the reporter 'slowest'."""
    metadata = distribution("slowest", "forge.reporters", "slowest = forge_slowest")
    write_files(root, {**metadata, "forge_slowest.py": code})


def test_a_third_party_reporter_is_an_event_handler(tree: Tree) -> None:
    root = tree(PLAIN)
    (code,) = (block.text for block in blocks(PAGE) if block.mark == "write: forge_slowest.py")
    write_reporter(root, code)
    ran = run_forge(root / "ws", "build", "--event-handlers", "slowest+", path=root)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.endswith("slowest: shapes\n")
    ran = run_forge(root / "ws", "build", "--force", "--event-handlers", "slowest-", path=root)
    assert (ran.returncode, "slowest: " in ran.stdout) == (0, False)
    assert "slowest slowest 1" in " ".join(run_forge(root, "extensions", path=root).stdout.split())


LAZY = """from forge.output.reporters import Reporter
def start(run):
    return Lazy()
class Lazy(Reporter):
    def write(self):
        yield "a line"
"""


@pytest.mark.parametrize(
    ("code", "message"),
    [
        (
            "start = 1",
            "cannot be loaded from 'forge_slowest': it has no function 'start'",
        ),
        ("def start(run):\n    1 / 0", "failed: ZeroDivisionError: division by zero"),
        (f"{LAZY}        yield 1 / 0", "failed: ZeroDivisionError: division by zero"),
        (
            f"{LAZY}    def conclude(self, complete): pass",
            "failed: AttributeError: 'NoneType' object has no attribute 'lines'",
        ),
    ],
)
def test_an_error_in_a_third_party_reporter_has_a_location(code: str, message: str, tree: Tree) -> None:
    root = tree(PLAIN)
    write_reporter(root, code)
    ran = run_forge(root / "ws", "build", "--event-handlers", "slowest+", path=root)
    assert ran.returncode == 2
    assert f"error: the reporter 'slowest' {message}\n" in ran.stderr
    assert "Traceback" not in ran.stderr


BROKEN_SDK = {
    **PLAIN,
    "ws/src/shapes/CMakeLists.txt": "cmake_minimum_required(VERSION 3.18)\nproject(shapes NONE)\n"
    'message(NOTICE "board-sdk: no license")\nfind_package(nowhere_y REQUIRED)\n',
}


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("", "\n  hint: start the license server: systemctl --user start board-licenses\n"),
        (
            "def hint(failure):\n    1 / 0\n",
            ":2: error: the source of hints 'board' failed: ZeroDiv",
        ),
        ("hint = lambda _: 1", "error: the source of hints 'board' returned int instead of a str\n"),
    ],
)
def test_a_third_party_hint_is_used_if_no_other_is_known(
    code: str, message: str, tree: Tree, forge_without: Callable[[str], Path]
) -> None:
    (block,) = (block.text for block in blocks(PAGE) if block.mark == "write: forge_board.py")
    metadata = distribution("board", "forge.hints", "board = forge_board")
    root = tree({**BROKEN_SDK, "forge_board.py": code or block, **metadata})
    path = f"{root}:{forge_without('failure_hints')}"
    ran = run_forge(root / "ws", "build", path=Path(path))
    assert (ran.returncode, message in ran.stderr) == (2 if code else 1, True), ran.stderr
    if not code:
        ran = run_forge(root / "ws", "build", path=root)
        assert "\n  hint: install the system package that contains nowhere_yConfig.cmake" in ran.stderr
        assert "\nhints (entry points 'forge.hints'):\n" in run_forge(root, "extensions", path=root).stdout


def test_a_third_party_suggestion_is_used_if_no_other_is_known(
    tree: Tree, forge_without: Callable[[str], Path]
) -> None:
    (code,) = (block.text for block in blocks(PAGE) if block.mark == "write: forge_old_words.py")
    metadata = distribution("old", "forge.suggestions", "old = forge_old_words")
    root = tree({"forge_old_words.py": code, **metadata})
    path = Path(f"{root}:{forge_without('suggestions')}")
    ran = run_forge(root, "build", "--everything", path=path)
    message = (
        "error: unrecognized arguments: --everything\nhint: leave it out: 'forge build' builds all packages\n"
    )
    assert (ran.returncode, ran.stderr) == (2, message)
    ran = run_forge(root, "biuld", path=path)
    assert ran.stderr == "error: unknown command 'biuld'\nhint: 'forge --help' lists all commands\n"
    assert "hint: did you mean 'build'?" in run_forge(root, "biuld", path=root).stderr


def test_an_error_in_a_third_party_command_has_a_location(tree: Tree) -> None:
    code = "def register(parser): pass\ndef run(options):\n    return 1 / 0\n"
    root = tree({"broken.py": code, **distribution("broken", "forge.commands")})
    ran = run_forge(root, "broken", path=root)
    assert ran.returncode == 2
    assert (
        "broken.py:3: error: the command 'broken' failed: ZeroDivisionError: division by zero" in ran.stderr
    )


@pytest.fixture
def with_executor(tree: Tree) -> Path:
    """Return a workspace with two distributions beside it: the executor of the page, and a broken one."""
    nice = next(block.text for block in blocks(PAGE) if "class NiceExecutor" in block.text)
    files = {"nice.py": nice, "broken.py": nice.replace("steps = tuple(", "steps = 1 / 0, tuple(")}
    files |= distribution("nice", "forge.executors") | distribution("broken", "forge.executors")
    body = "cmake_minimum_required(VERSION 3.18)\nproject(low NONE)\n"
    body += 'install(CODE "execute_process(COMMAND nice)")\n'
    return tree(
        {
            **files,
            "ws/src/low/package.xml": manifest_text("low", build_type="cmake"),
            "ws/src/low/CMakeLists.txt": body,
        }
    )


def test_a_third_party_executor_runs_the_steps(with_executor: Path) -> None:
    ran = run_forge(with_executor / "ws", "build", "--executor", "nice", path=with_executor)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "Summary: 1 package finished" in ran.stdout
    log = (with_executor / "ws/log/latest_build/low/stdout_stderr.log").read_text(encoding="utf-8")
    assert "\n10\n" in log
    assert "  nice        nice 1\n" in run_forge(with_executor, "extensions", path=with_executor).stdout


def test_errors_in_a_third_party_executor_are_reported(with_executor: Path) -> None:
    ran = run_forge(with_executor / "ws", "build", "--executor", "broken", path=with_executor)
    assert ran.returncode == 2
    message = "broken.py:11: error: the executor 'broken' failed: ZeroDivisionError: division by zero"
    assert message in ran.stderr
    cross = run_forge(
        with_executor / "ws", "build", "--executor", "nice", "--target", "arm64", path=with_executor
    )
    assert cross.returncode == 2
    assert cross.stderr.startswith("error: --target cannot be combined with '--executor nice': ")
    unknown = run_forge(with_executor / "ws", "build", "--executor", "none", path=with_executor)
    assert unknown.returncode == 2
    assert "invalid choice: 'none' (choose from " in unknown.stderr
