"""Profiles build in folders of their own, which all commands find."""

import json
import shutil
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text
from tests.testable import built_once, cmake_package, restored, run_forge, save

PYTHON = """
[project]
name = "nav"
version = "1.0"
optional-dependencies = {test = ["pytest"]}
scripts = {steer = "nav:main"}

[tool.setuptools]
py-modules = ["nav"]
"""
SETTINGS = """
[build]
cmake-args = ["-DWITH_CAMERA=OFF"]

[profiles.fast.build]
mixin = ["release"]
symlink-install = true

[profiles.board.build]
build-base = "out/b"
install-base = "out/i"
"""


FILES = {
    "src/nav/pyproject.toml": PYTHON,
    "src/nav/nav.py": "import sys\n\ndef main():\n    print(__file__)\n",
    "forge.toml": SETTINGS,
}


@pytest.fixture
def root(tree: Tree) -> Path:
    """Return a workspace with a Python package, in a folder with a space."""
    return tree({f"a team/{name}": text for name, text in FILES.items()}) / "a team"


@pytest.fixture(scope="module")
def built_twice(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = built_once(tmp_path_factory.mktemp("profiles") / "a team", FILES)
    run_forge(root, "build", "--profile", "fast")
    save(root, "built twice")
    return root


@pytest.fixture
def both(built_twice: Path) -> Path:
    """Return the workspace after a build without a profile and one with the profile 'fast'."""
    return restored(built_twice, "built twice")


def folders(root: Path) -> set[str]:
    return {path.name for path in root.iterdir() if path.is_dir()} - {"src"}


def test_switching_profiles_rebuilds_nothing(forge: Forge, root: Path) -> None:
    assert "1 package finished" in forge("build", cwd=root).out
    assert "1 package finished" in forge("build", "--profile", "fast", cwd=root).out
    assert folders(root) == {"build", "install", "log", "build-fast", "install-fast", "log-fast"}
    assert "0 packages finished, 1 package unchanged" in forge("build", cwd=root).out
    assert "1 package unchanged" in forge("build", cwd=root, env={"FORGE_PROFILE": "fast"}).out
    assert forge("list", "-n", cwd=root).out == "nav\n"


def test_an_install_folder_of_another_profile_is_not_an_underlay(forge: Forge, both: Path) -> None:
    """Sourcing the workspace before a build of a profile, or the other way round, makes no difference."""
    for profile, sourced in ((("--profile", "fast"), "install"), ((), "install-fast")):
        env = json.loads(forge("env", "--format", "json", "--install-base", sourced, cwd=both).out)
        ran = forge("build", *profile, cwd=both, env=env)
        assert (ran.code, ran.err) == (0, "")
        assert "1 package unchanged" in ran.out
    # The install folder of 'board' is not beside the others.
    env = json.loads(forge("env", "--format", "json", cwd=both).out)
    forge("build", "--profile", "board", cwd=both, env=env)
    assert json.loads((both / "out/i/.forge.json").read_text())["underlays"] == []
    env = json.loads(forge("env", "--format", "json", "--profile", "board", cwd=both).out)
    assert "1 package unchanged" in forge("build", cwd=both, env=env).out
    states = [json.loads((both / name / ".forge.json").read_text()) for name in ("install", "install-fast")]
    assert [state["underlays"] for state in states] == [[], []]


def test_all_commands_use_the_folders_of_the_profile(forge: Forge, root: Path) -> None:
    (root / "src/nav/test").mkdir()
    (root / "src/nav/test/test_nav.py").write_text("def test_fails():\n    assert False\n")
    forge("build", "--profile", "fast", cwd=root)
    assert "1 failure" in forge("test", "--profile", "fast", cwd=root).out
    assert forge("test-result", "--profile", "fast", cwd=root).code == 1
    told = forge("test", "--profile", "asan", cwd=root).err
    assert told.endswith("\nhint: forge build --packages-up-to nav --profile asan\n")
    assert "the folder 'build' does not exist" in forge("test-result", cwd=root).err
    selected = forge("list", "-n", "--packages-select-test-failures", "--profile", "fast", cwd=root)
    assert selected.out == "nav\n"
    assert f"{root}/install-fast/nav/bin" in forge("env", "--profile", "fast", "PATH", cwd=root).out
    assert forge("bundle", "--profile", "fast", "-o", "x.tar.gz", cwd=root).code == 0
    assert forge("info", "--profile", "fast", cwd=root).code == 0
    ran = forge("run", "--profile", "fast", "nav", "steer", cwd=root / "src")
    assert f"{root}/install-fast/" in ran.out
    ran = forge("run", "nav", "steer", cwd=root / "src", env={"FORGE_PROFILE": "fast"})
    assert f"{root}/install-fast/" in ran.out
    ran = forge("run", "--profile", "debug", "nav", "steer", cwd=root)
    assert ran.err == "error: nothing was built with the profile 'debug'\nhint: forge build --profile debug\n"
    ran = forge("clean", "workspace", "--yes", "--profile", "fast", cwd=root)
    assert (ran.code, folders(root)) == (0, set())


def test_commands_that_read_the_install_folder_support_profiles(forge: Forge, root: Path, tree: Tree) -> None:
    manifest = manifest_text("shapes", build_type="cmake")
    tree({"a team/src/shapes/package.xml": manifest, "a team/src/shapes/msg/Box.msg": "uint8 size\n"})
    assert forge("build", "--profile", "board", "--packages-select", "nav", cwd=root).code == 0
    ran = forge("run", "--profile", "board", "nav", "steer", cwd=root)
    assert (ran.code, f"{root}/out/i/nav/" in ran.out) == (0, True), ran.err
    ran = forge("pkg", "prefix", "shapes", "--profile", "board", cwd=root / "src")
    assert ran.err.endswith("hint: build it: forge build --packages-select shapes --profile board\n")
    assert forge("interface", "package", "std_msgs", "--profile", "board", cwd=root).code == 0
    for words in (("pkg", "list"), ("pkg", "executables"), ("interface", "show", "std_msgs/msg/Header")):
        assert "unknown profile 'bord'" in forge(*words, "--profile", "bord", cwd=root).err


def test_hints_name_the_profile(forge: Forge, root: Path) -> None:
    forge("build", "--profile", "fast", cwd=root)
    assert "  forge clean stale --profile fast  " in forge("clean", "--profile", "fast", cwd=root).out
    shutil.rmtree(root / "src/nav")
    (root / "src/other").mkdir()
    (root / "src/other/pyproject.toml").write_text("[project]\nname = 'other'\nversion = '1'\n")
    ran = forge("build", "--profile", "fast", cwd=root)
    assert "hint: remove them: forge clean stale --profile fast\n" in ran.err


def test_run_prefers_the_profile_to_a_sourced_workspace(forge: Forge, both: Path) -> None:
    env = json.loads(forge("env", "--format", "json", cwd=both).out)
    assert f"{both}/install/" in forge("run", "nav", "steer", cwd=both, env=env).out
    ran = forge("run", "--profile", "fast", "nav", "steer", cwd=both, env=env)
    assert f"{both}/install-fast/" in ran.out


def test_clean_lists_the_profile_folders_that_it_keeps(forge: Forge, both: Path) -> None:
    assert "  forge clean workspace --profile fast\n" in forge("clean", cwd=both).out
    forge("clean", "workspace", "-y", cwd=both)
    assert folders(both) == {"build-fast", "install-fast", "log-fast"}
    assert "Profiles have folders" not in forge("clean", "--profile", "fast", cwd=both).out


def test_the_root_is_found_if_only_a_profile_was_built(forge: Forge, root: Path) -> None:
    (root / "forge.toml").unlink()
    (root / "src").rename(root / "code")
    forge("build", "--profile", "release", cwd=root)
    ran = forge("build", "--profile", "release", cwd=root / "code/nav")
    assert "1 package unchanged" in ran.out


def test_a_profile_can_set_its_own_folders(forge: Forge, root: Path) -> None:
    """The folders of its [build] table are those of all commands; the command line comes first."""
    assert forge("build", "--profile", "board", cwd=root).code == 0
    assert folders(root) == {"out", "log-board"}
    assert f"{root}/out/i/nav" in forge("env", "PATH", "--profile", "board", cwd=root).out
    forge("build", "--profile", "board", "--build-base", "own", "--log-base", "/dev/null", cwd=root)
    assert folders(root) == {"out", "log-board", "own"}


def test_folders_from_option_files_get_the_profile_as_suffix(forge: Forge, root: Path) -> None:
    (root / "colcon_defaults.yaml").write_text("build: {build-base: out/b/, log-base: /dev/null}\n")
    env = {"FORGE_LOG_PATH": str(root / "logs")}
    assert forge("build", "--profile", "release", cwd=root, env=env).code == 0
    assert folders(root) == {"out", "install-release"}
    assert (root / "out/b-release/.built_by").is_file()
    (root / "colcon_defaults.yaml").unlink()
    forge("build", "--profile", "release", cwd=root, env=env)
    assert folders(root) == {"out", "install-release", "build-release", "logs"}


def test_an_option_outside_of_a_command_is_an_error(forge: Forge, root: Path) -> None:
    (root / "forge.toml").write_text("[profiles.debug]\nmixin = ['debug']\n")
    ran = forge("build", "--profile", "debug", cwd=root)
    assert ran.code == 2
    assert "forge.toml: error: 'mixin' of the profile 'debug' belongs to no command\n" in ran.err
    assert "hint: write it below [profiles.debug.build], or below another command\n" in ran.err


@pytest.mark.parametrize("table", ["build", "profiles.debug.build"])
def test_an_invalid_folder_does_not_lead_to_other_builds(forge: Forge, root: Path, table: str) -> None:
    (root / "forge.toml").write_text(f"[{table}]\nbuild-base = 3\ninstall-base = ['x']\n")
    ran = forge("build", "--profile", "debug", cwd=root)
    assert (ran.code, "warning: option 'build-base' of 'forge build' expects a string, not 3" in ran.err) == (
        0,
        True,
    )
    assert folders(root) == {"build-debug", "install-debug", "log-debug"}
    assert forge("test", "--profile", "debug", cwd=root).code == 0


@pytest.mark.parametrize(
    ("text", "message", "hint"),
    [
        (
            "[profiles]\ndebug = 3",
            "the profile 'debug' is not a table",
            "write tables of options, such as [profiles.debug.build]",
        ),
        (
            "[profiles.debug]\nbuild = 3",
            "'build' of the profile 'debug' is not a table of options",
            "write a table [profiles.debug.build] of 'option = value'",
        ),
    ],
)
def test_a_profile_consists_of_tables(forge: Forge, root: Path, text: str, message: str, hint: str) -> None:
    (root / "forge.toml").write_text(f"{text}\n")
    ran = forge("build", "--profile", "debug", cwd=root)
    assert (ran.code, ran.err) == (2, f"{root}/forge.toml: error: {message}\nhint: {hint}\n")


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("gr\u00fcn", 'write a table [profiles."gr\u00fcn".build] with the options'),
        ("v1.2", 'write a table [profiles."v1.2".build] with the options'),
        ("debgu", "did you mean 'debug'?"),
        ("fats", "did you mean 'fast'?"),
        ("zzz", "write a table [profiles.zzz.build] with the options of its builds into forge.toml"),
        ("a/b", "use letters, digits, '.', '_', '+' and '-'"),
    ],
)
def test_an_unknown_profile_is_an_error(forge: Forge, root: Path, name: str, hint: str) -> None:
    for words in (("build",), ("env",), ("run", "--profile", name, "nav")):
        ran = forge(*words, *(() if words[0] == "run" else ("--profile", name)), cwd=root)
        assert ran.code == 2
        assert hint in ran.err


@pytest.mark.needs("cmake", "ninja")
@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (("--profile", "debug"), {"CMAKE_BUILD_TYPE": "Debug", "WITH_CAMERA": "OFF"}),
        (("--profile", "debug", "--cmake-args", "-DX=1"), {"CMAKE_BUILD_TYPE": "Debug", "X": "1"}),
        (
            ("--profile", "debug", "--mixin", "lto"),
            {
                "CMAKE_BUILD_TYPE": "Debug",
                "WITH_CAMERA": "OFF",
                "CMAKE_INTERPROCEDURAL_OPTIMIZATION": "ON",
            },
        ),
        (("--profile", "fast"), {"CMAKE_BUILD_TYPE": "Release", "WITH_CAMERA": "OFF"}),
    ],
    ids=" ".join,
)
def test_profile_options_extend_those_of_the_workspace(
    forge: Forge, root: Path, tree: Tree, options: tuple[str, ...], expected: dict[str, str]
) -> None:
    tree({f"a team/{name}": text for name, text in cmake_package("a").items()})
    shutil.rmtree(root / "src/nav")
    out = forge("build", "--dry-run", *options, cwd=root).out
    assert {f"-D{name}={value}" for name, value in expected.items()} <= set(out.split())


def test_a_profile_in_forge_toml_replaces_the_built_in_one(forge: Forge, root: Path, tree: Tree) -> None:
    tree({f"a team/{name}": text for name, text in cmake_package("a").items()})
    (root / "forge.toml").write_text("[profiles.debug.build]\ncmake-args = ['-DCMAKE_BUILD_TYPE=Special']\n")
    out = forge("build", "--dry-run", "--profile", "debug", cwd=root).out
    assert "-DCMAKE_BUILD_TYPE=Special" in out
    assert "Debug" not in out
