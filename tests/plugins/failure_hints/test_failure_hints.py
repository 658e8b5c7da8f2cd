"""Hints for failures that tests cannot provoke, and no hints for others."""

import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.base.layout import PACKAGE, Layout
from forge.output.hints import Failure
from forge.plugins.failure_hints.hints import (
    FailureContext,
    failure_context,
    hint,
    hint_in,
    used_by_tests_only,
)
from forge.plugins.failure_hints.missing import whereabouts
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import Package
from tests.conftest import Tree
from tests.packages import manifest_text, package

SCENE = FailureContext(
    package("mine", "shapes"),
    {name: package(name) for name in ("mine", "shapes")},
    python="/venv/bin/python3",
    files=("CMakeCache.txt", "launch/robot/go.launch.py", "msg/Other.msg"),
    targets=("drive",),
    flags=frozenset({"--jobs", "-j", "--watch"}),
)


def hint_of(said: str, scene: FailureContext) -> str:
    return hint_in(replace(scene, output=said))


NOT_EXPORTED = 'The link interface of target "{}" contains:\n\n    {}\n\n  but the target was not found.'


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ("c++: fatal error: Killed signal terminated program cc1plus", "out of memory"),
        (
            "CMake Error: Unknown argument --jobs\n",
            "if '--jobs' is meant for forge, put it before '--cmake-args'",
        ),
        ("__main__.py: error: unrecognized arguments: --watch -x\n", "if '--watch' is meant for forge"),
        ("ninja: error: write: No space left on device", "the disk is full"),
        (
            "AttributeError: module 'em' has no attribute 'BUFFERED_OPT'",
            "/venv/bin/python3 -m pip install 'empy<4'",
        ),
        (
            'Imported target "shapes::py" includes\n  non-existent path\n\n    "/a/numpy/_core/include"',
            "/venv/bin/python3 -m pip install numpy",
        ),
        ("ModuleNotFoundError: No module named 'yaml.x'", "/venv/bin/python3 -m pip install PyYAML"),
        ("ModuleNotFoundError: No module named 'ament_x.y'", "a ROS installation that contains 'ament_x'"),
        (
            "  Failed to clone repository: 'https://x.org/y.git'",
            "downloads https://x.org/y.git during the build",
        ),
        ("a.cpp:1:10: fatal error: 'foo/bar.h' file not found", "apt-file search foo/bar.h"),
        (
            "b.cpp:(.text+0x0): multiple definition of `main'; a.o: first defined here",
            "separate add_executable",
        ),
        ("Scrt1.o: in function `_start':\n(.text+0x17): undefined reference to `main'", "no main()"),
        (
            "a.cpp:(.text+0x5): undefined reference to `shapes::area(int)'",
            "find_package(shapes REQUIRED) and ament_target_dependencies(YOUR_TARGET shapes)",
        ),
        (
            'Imported target "shapes::shapes" includes non-existent path',
            "'shapes' does not install its headers: add install(DIRECTORY include/",
        ),
        (
            "ament_target_dependencies(): 'a' uses the package 'shaps', which was\n  not found (is",
            "did you mean 'shapes'?",
        ),
        (
            "ament_target_dependencies(): 'a' uses the package 'shapes', which was not found",
            "add find_package(shapes REQUIRED) before it",
        ),
        (
            NOT_EXPORTED.format("shapes::shapes", "points::points"),
            "add ament_export_dependencies(points) to the CMakeLists.txt of 'shapes'",
        ),
        ("ament_target_dependencies() was given 'drvie', which is not a target", "did you mean 'drive'?"),
        (
            "was given '/w/src/mine/msg/Status.msg', which does not exist",
            "the package has no 'msg/Status.msg'",
        ),
        ('Cannot specify link libraries for target "x" which is not built by', "defines 'x'"),
        ("can't copy 'launch/go.launch.py': doesn't exist", "did you mean 'launch/robot/go.launch.py'?"),
        ("can't copy 'go.launch.py': doesn't exist", "did you mean 'launch/robot/go.launch.py'?"),
        ("was given\n  '/w/src/mine/msg/Oter.msg', which does\n  not exist", "did you mean 'msg/Other.msg'?"),
        (
            "Could not find the compiler specified in the environment variable CXX:\n  gxx.",
            "unset CXX, or set it to an installed compiler",
        ),
        (
            "CMake Error: Error: generator : Ninja\nDoes not match the generator used previously: Unix",
            "'cmake .' was run in src/mine: rm -r src/mine/CMakeCache.txt",
        ),
        (
            'file INSTALL cannot copy file "a" to "/w/install/a": Permission denied.',
            "sudo chown -R",
        ),
        ("PermissionError: [Errno 13] Permission denied: '/w/install/x'", "sudo chown -R"),
        ("qemu-aarch64: Could not open '/lib/ld-linux-aarch64.so.1': No such", "'ld-linux-aarch64.so.1'"),
        ("/bin/sh: 1: make_it: not found\n/bin/sh: 1: drive: not found", "compiled for another platform"),
        ("sh: line 1: drive: command not found", "compiled for another platform: install qemu-user"),
        ("/bin/sh: 1: ./maker: Exec format error", "pass the target itself to add_custom_command"),
        (
            "/usr/bin/ld: /my ws/liba.so: error adding symbols: file in wrong format",
            "'liba.so' was built for another platform",
        ),
        (
            "ld.lld: error: /my ws/liba.so is incompatible with aarch64linux",
            "'liba.so' was built for another",
        ),
        ('unable to provide libc for target "aarch64-linux.5.10...7.2-gnu.2.10"', "zig has no glibc 2.10"),
        ('unable to provide libc for target "arm-linux.5.10...7.2-gnueabihf.2.10"', "zig has no glibc 2.10"),
    ],
)
def test_known_failures_get_a_hint(said: str, expected: str) -> None:
    hint = hint_of(said, SCENE)
    assert expected in hint


def test_a_dependency_spelled_like_a_ros_package_gets_no_system_package_hint() -> None:
    said = 'asked CMake to find a package configuration file provided by "{}", but'
    scene = FailureContext(package("mine", "odd_collector"), {"mine": package("mine")})
    assert "source a ROS installation" in hint_of(said.format("odd_collector"), scene)
    # find_package's own names are spelled in every way: only the manifest tells.
    assert "apt-file search" in hint_of(said.format("nlohmann_json"), scene)


def test_misspelled_packages_get_a_suggestion_before_system_packages() -> None:
    said = 'asked CMake to find a package configuration file provided by "{}", but'
    scene = FailureContext(package("mine"), {name: package(name) for name in ("mine", "my_msgs", "rclcpp")})
    hint = hint_of(said.format("my_mgs"), scene)
    assert hint.startswith("did you mean 'my_msgs'? otherwise install the system package that contains my_m")
    ros = hint_of(said.format("rclccp"), scene)
    assert ros.startswith("did you mean 'rclcpp'? otherwise source a ROS installation")
    assert "did you mean" not in hint_of(said.format("mine2"), scene)


@pytest.mark.parametrize(
    "said",
    [
        "a.cpp:1:1: error: expected ';'",
        'asked CMake to find a package configuration file provided by "shapes", but',
        "ModuleNotFoundError: No module named 'shapes'",
        "/bin/sh: 1: ./generate.sh: Permission denied",
        "ament_target_dependencies(): 'a' uses the package 'shaders', which was not found",
        NOT_EXPORTED.format("far::far", "points::points"),
        NOT_EXPORTED.format("shapes::shapes", "shapes::core"),
        NOT_EXPORTED.format("shapes::shapes", "PkgConfig::ZLIB"),
        'Unknown CMake command "frobnicate".',
        "/bin/sh: 1: bison: not found",
        "drive: not found",
    ],
)
def test_unknown_failures_get_no_hint(said: str) -> None:
    """A package that is declared and built, but not found, has an unknown cause."""
    assert hint_of(said, SCENE) == ""


@given(st.text())
def test_any_output_can_be_analysed(said: str) -> None:
    hint_of(said, SCENE)


def test_missing_headers_are_found_in_installed_packages(tree: Tree) -> None:
    root = tree(
        dict.fromkeys(("include/shapes/shapes/circle.hpp", "include/shapes/README", "include/x/yes.h"), "")
    )
    scene = replace(SCENE, found=frozenset({"shapes", "rclcpp"}), prefix_of=lambda _: root)
    said = "a.cpp:1:10: fatal error: {}: No such file or directory"
    assert hint_of(said.format("shapes/cirlce.hpp"), scene) == "did you mean 'shapes/circle.hpp'?"
    assert hint_of(said.format("shapes/cube.hpp"), scene) == "the package 'shapes' has no such header"
    assert hint_of(said.format("x/yess.h"), scene) == "did you mean 'x/yes.h'?"
    # The manifest and find_package() are as they should be, so it is the target.
    assert hint_of(said.format("shapes/circle.hpp"), scene).endswith(
        "the package 'shapes'; add ament_target_dependencies(YOUR_TARGET shapes)"
    )
    # Not installed, hence not known.
    bare = replace(SCENE, prefix_of=lambda _: None)
    assert "find_package(shapes REQUIRED) and ament" in hint_of(said.format("shapes/circle.hpp"), bare)
    assert hint_of(said.format("Othr.msg"), bare) == "did you mean 'Other.msg'?"


@pytest.mark.parametrize(
    ("command", "found", "expected"),
    [
        ("ament_packag", (), "did you mean 'ament_package'?"),
        ("ament_packag", ("ament_cmake",), "did you mean 'ament_package'?"),
        ("add_executabel", (), "did you mean 'add_executable'?"),
        ("ament_package", (), "add find_package(ament_cmake REQUIRED) before it in CMakeLists.txt"),
        ("ament_package", ("ament_cmake",), ""),
        ("ament_special", ("ament_cmake",), ""),
        ("draw_al", (), "did you mean 'draw_all'?"),
    ],
)
def test_an_unknown_cmake_command_is_misspelled_or_lacks_find_package(
    tree: Tree, command: str, found: tuple[str, ...], expected: str
) -> None:
    root = tree({"cmake/draw.cmake": "function(draw_all)\nendfunction()\n"})
    mine = replace(SCENE.package, path=root)
    scene = replace(SCENE, package=mine, files=("cmake/draw.cmake",), found=frozenset(found))
    assert hint_of(f'Unknown CMake command "{command}".', scene) == expected


def test_interface_headers_are_lowercase() -> None:
    text = manifest_text("own_msgs", "<member_of_group>rosidl_interface_packages</member_of_group>")
    path = Path("src/own_msgs")
    msgs = Package(path, parse_manifest(text.encode(), path / "package.xml", {}))
    scene = FailureContext(package("mine", "own_msgs"), {"own_msgs": msgs})
    said = "a.cpp:1:10: fatal error: own_msgs/msg/BigStatus.hpp: No such file or directory"
    assert hint_of(said, scene) == "headers of interfaces are lower case: 'own_msgs/msg/big_status.hpp'"


def test_plain_cmake_packages_need_find_dependency_in_their_config() -> None:
    scene = FailureContext(package("mine"), {"plain": package("plain", build_type="cmake")})
    hint = hint_of(NOT_EXPORTED.format("plain::plain", "Threads::Threads"), scene)
    assert hint.endswith("add find_dependency(Threads) to the CMake config that 'plain' installs")


def test_unknown_targets_reported_by_embedded_cmake_commands_have_a_hint() -> None:
    texts = [path.read_text(encoding="utf-8") for path in (PACKAGE / "embedded").rglob("*.cmake")]
    messages = [found for text in texts for found in re.findall(r'"([^"]*was given \'\$[^"]*target)"', text)]
    assert len(messages) > 1
    for message in messages:
        assert "did you mean 'drive'?" in hint_of(re.sub(r"\$\{\w+\}", "drvie", message), SCENE), message


NO_CONFIG = 'asked CMake to find a package configuration file provided by "{}", but'


def scene_in(root: Path, text: str = "", *depends: str) -> FailureContext:
    """Return the context of the package 'mine' in src/mine of a workspace on disk."""
    made = replace(package("mine", *depends), path=root / "src/mine")
    made.path.mkdir(parents=True, exist_ok=True)
    (made.path / "CMakeLists.txt").write_text(text)
    layout = Layout(root / "build", root / "install", None)
    packages = {"mine": made, "shapes": package("shapes")}
    place_of = partial(whereabouts, root, layout)
    prefix_of = (root / "install").joinpath
    return failure_context(Failure(made, packages, prefix_of=prefix_of, whereabouts=place_of))


def test_a_package_of_an_earlier_build_gets_no_system_package_hint(tree: Tree) -> None:
    root = tree({"ws/install/gone/share/gone/package.sh": ""}) / "ws"
    hint = hint_of(NO_CONFIG.format("gone"), scene_in(root))
    assert hint.startswith("'gone' was in the workspace in an earlier build")
    assert "forge clean stale" in hint


def test_a_package_excluded_by_options_is_reported(tree: Tree) -> None:
    files = {"ws/install/gone/share/gone/package.sh": "", "ws/src/gone/package.xml": manifest_text("gone")}
    hint = hint_of(NO_CONFIG.format("gone"), scene_in(tree(files) / "ws"))
    assert hint.startswith("'gone' is in 'src/gone', but left out by '--paths', ")


def test_a_missing_submodule_is_reported(tree: Tree) -> None:
    modules = '[submodule "up"]\n\tpath = src/up\n\turl = https://x.org/up\n[submodule "b"]\n\tpath = src/b\n'
    root = tree({"ws/.gitmodules": modules, "ws/src/b/README": "", "ws/src/up/.keep": ""}) / "ws"
    (root / "src/up/.keep").unlink()
    expected = "the submodule 'src/up' is not checked out: git submodule update --init src/up"
    assert hint_of(NO_CONFIG.format("pk"), scene_in(root)) == expected
    (root / "src/up/file").touch()
    assert "apt-file" in hint_of(NO_CONFIG.format("pk"), scene_in(root))


def test_a_missing_submodule_in_a_package_is_reported(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    root = tree({"src/mine/.gitmodules": '[submodule "x"]\n path = extern/x\n', "src/mine/extern/x/f": ""})
    (root / "src/mine/extern/x/f").unlink()
    monkeypatch.chdir(root)
    said = 'add_subdirectory given source "extern/x" which is not an\n  existing directory.'
    assert "git submodule update --init src/mine/extern/x" in hint_of(said, scene_in(root))


def test_a_package_of_a_neighbouring_workspace_suggests_sourcing_it(tree: Tree) -> None:
    root = tree({"other/install/my_msgs/share/my_msgs/package.sh": "", "ws/src/x": ""}) / "ws"
    hint = hint_of(NO_CONFIG.format("my_msgs"), scene_in(root))
    assert hint == f"source the workspace that contains it: . {root.parent}/other/install/setup.sh"


@pytest.mark.parametrize(
    "said",
    [
        "error: can't copy 'launch/sub': doesn't exist or not a regular file",
        'install FILES given directory "launch/sub" to install.',
    ],
)
def test_a_folder_in_place_of_files_gets_a_hint(tree: Tree, said: str) -> None:
    scene = scene_in(tree({"src/mine/launch/sub/a.py": ""}))
    assert hint_of(said, scene).startswith("'launch/sub' is a folder, where files are expected")


def test_hints_do_not_suggest_existing_lines(tree: Tree) -> None:
    """Neither an existing find_package() nor an existing dependency."""
    text = "find_package(shapes REQUIRED)\nament_target_dependencies(x shapes)\n"
    scene = scene_in(tree({}), text, "shapes")
    undefined = "a.cpp:(.text+0x5): undefined reference to `shapes::area(int)'"
    assert hint_of(undefined, scene) == "'shapes' exports no library that defines 'shapes::area(int)'"
    not_found = "ament_target_dependencies(): 'a' uses the package 'shapes', which was not found"
    assert "add find_package" not in hint_of(not_found, scene)


def test_an_unknown_target_lists_the_exported_targets(tree: Tree) -> None:
    said = 'Target "n" links to:\n\n    shapes::shapes\n\n  but the target was not found.'
    root = tree(
        {
            "install/shapes/share/shapes/cmake/export_shapesExport.cmake": "#[[ add_library(no IMPORTED) ]]\n"
            "add_library(shapes::round STATIC IMPORTED)\nadd_library(shapes::all ALIAS shapes::round)\n"
        }
    )
    hint = hint_of(said, scene_in(root, "find_package(shapes REQUIRED)"))
    assert hint == "'shapes' has no target 'shapes::shapes'; it exports 'shapes::round', 'shapes::all'"
    bare = hint_of(said, scene_in(tree({"x": ""}), "find_package(shapes REQUIRED)"))
    assert "add find_package" not in str(bare)
    assert "add find_package(shapes REQUIRED)" in hint_of(said, scene_in(root))


@pytest.mark.parametrize(
    "said",
    [
        "Failed to clone repository: 'https://x.org/y'",
        "error: downloading 'https://x.org/y' failed\n  status_code: 6",
        "fatal: unable to access 'https://x.org/y/': Could not resolve host: x.org",
    ],
)
def test_a_system_package_is_suggested_only_for_optional_dependencies(tree: Tree, said: str) -> None:
    wanting = hint_of(said, scene_in(tree({}), "find_package(nowhere_y QUIET)\nfind_package(a REQUIRED)"))
    assert wanting == (
        "the package downloads https://x.org/y during the build: provide network access, or install "
        "the system package that contains 'nowhere_y'"
    )
    assert "system package" not in hint_of(said, scene_in(tree({}), "# find_package(y)"))


def test_an_unknown_header_is_not_attributed_to_this_package(tree: Tree) -> None:
    said = "a.cpp:1:10: fatal error: {}: No such file or directory"
    scene = scene_in(tree({"src/mine/inc/own.h": ""}))
    assert hint_of(said.format("own.h"), scene) == (
        "for a header of this package: target_include_directories(YOUR_TARGET PRIVATE inc)"
    )
    assert "apt-file search /yaml.h" in hint_of(said.format("yaml.h"), scene)


def test_failures_in_embedded_packages_get_no_hints() -> None:
    failure = Failure(package("mine"), {}, NO_CONFIG.format("nowhere"))
    assert "apt-file" in hint(failure)
    assert hint(replace(failure, package=replace(failure.package, embedded=True))) == ""


@pytest.mark.parametrize("word", ["--no-such-option", "-x", "--job", "-jail"])
def test_only_forge_options_get_an_unrecognized_argument_hint(word: str) -> None:
    hint = hint_of(f"error: unrecognized arguments: {word}\n", SCENE)
    assert bool(hint) == word.startswith("-j")


def test_packages_used_only_by_tests_are_recognized() -> None:
    text = "find_package(a)\nif(BUILD_TESTING)\nfind_package(a)\nfind_package(b REQUIRED)\nendif()"
    assert used_by_tests_only(text) == {"b"}
