"""`forge run`: the program replaces forge and gets all arguments."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text

MARK = "share/ament_index/resource_index/packages/walker"
BROKEN = (
    "cannot run '{}/lib/walker/broken': no such file or directory\n"
    "hint: scripts need a line such as '#!/usr/bin/env python3' at the beginning"
)
PLAIN = (
    "no executable found\nhint: the file exists, but is not executable: use install(PROGRAMS ...), "
    "or chmod +x {}/lib/walker/plain"
)
SAY = "#!/bin/sh\nfor word; do printf '[%s]' \"$word\"; done\n"


def run(forge: Forge, root: Path, *argv: str) -> tuple[int, str, str]:
    ran = forge("run", *argv, env={"AMENT_PREFIX_PATH": str(root), "SHELL": "/bin/sh"}, cwd=root)
    return ran.code, ran.out, ran.err


@pytest.mark.parametrize(
    "argv",
    [
        (),
        ("--ros-args", "-p", "rcl_log_level:=10"),
        ("--help", "--version", "-h"),
        ("--log", "--prefix", "x", "--log-level=debug"),
        ("a", "--", "b", "", "c d", "-1"),
        ("--",),
        ("build", "run", "@file"),
    ],
)
def test_the_program_gets_its_arguments_unchanged(argv: tuple[str, ...], forge: Forge, tree: Tree) -> None:
    root = tree({MARK: "", "lib/walker/say": SAY})
    assert run(forge, root, "walker", "say", *argv) == (0, "".join(f"[{word}]" for word in argv), "")


def test_two_dashes_end_the_options_of_forge(forge: Forge, tree: Tree) -> None:
    assert run(forge, tree({MARK: "", "lib/walker/say": SAY}), "--", "walker", "say", "a")[1] == "[a]"


def test_the_prefix_command_comes_first(forge: Forge, tree: Tree) -> None:
    root = tree({MARK: "", "lib/walker/say": SAY, "wrap": '#!/bin/sh\nprintf "$1:"; shift; exec "$@"\n'})
    code, out, _ = run(forge, root, "--prefix", f"'{root}/wrap' 'a b'", "walker", "say", "--prefix", "c")
    assert (code, out) == (0, "a b:[--prefix][c]")


def test_the_program_runs_in_the_current_folder(forge: Forge, tree: Tree) -> None:
    root = tree({MARK: "", "lib/walker/where": "#!/bin/sh\npwd -P\n"})
    assert run(forge, root, "walker", "where")[1] == f"{root.resolve()}\n"


@pytest.mark.parametrize(
    ("script", "code", "told"),
    [
        ("exit 3", 3, "[ros2run]: Process exited with failure 3\n"),
        ("kill -TERM $$", -signal.SIGTERM, f"[ros2run]: {signal.strsignal(signal.SIGTERM)}\n"),
        ("kill -KILL $$", -signal.SIGKILL, f"[ros2run]: {signal.strsignal(signal.SIGKILL)}\n"),
    ],
)
def test_the_exit_code_is_that_of_the_program(
    script: str, code: int, told: str, forge: Forge, tree: Tree
) -> None:
    root = tree({MARK: "", "lib/walker/end": f"#!/bin/sh\n{script}\n"})
    assert run(forge, root, "walker", "end") == (code, "", told)


def test_ctrl_c_goes_to_the_program_and_other_signals_are_forwarded(tree: Tree) -> None:
    script = (
        "#!/bin/sh\ntrap 'echo interrupted' INT\ntrap 'echo asked to end; exit 5' TERM\n"
        "echo ready\nwhile :; do sleep 0.02; done\n"
    )
    root = tree({MARK: "", "lib/walker/wait": script})
    argv = [sys.executable, "-m", "forge", "run", "walker", "wait"]
    env = {**os.environ, "AMENT_PREFIX_PATH": str(root), "PYTHONPATH": str(Path(__file__).parents[2])}
    with subprocess.Popen(
        argv, env=env, stdout=subprocess.PIPE, start_new_session=True, text=True
    ) as started:
        assert started.stdout is not None
        assert started.stdout.readline() == "ready\n"
        os.killpg(started.pid, signal.SIGINT)
        assert started.stdout.readline() == "interrupted\n"
        time.sleep(0.05)
        assert started.poll() is None
        started.send_signal(signal.SIGTERM)
        assert started.stdout.readline() == "asked to end\n"
        assert started.wait(10) == 5


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (("crawler", "say"), "package 'crawler' not found\nhint: did you mean 'walker'?"),
        (("walker", "sya"), "no executable found\nhint: did you mean 'say'?"),
        (
            ("walker", "zzz"),
            "no executable found\nhint: 'forge pkg executables walker' lists all executables",
        ),
        (("walker", "plain"), PLAIN),
        (
            ("walker", "twin"),
            "multiple executables found:\n- {}/lib/walker/a/twin\n- {}/lib/walker/twin",
        ),
        (
            ("walker", "broken"),
            BROKEN,
        ),
        (("--prefix", "'gdb", "walker", "say"), "cannot parse --prefix: no closing quotation"),
    ],
)
def test_programs_that_cannot_run_give_one_error(
    argv: tuple[str, ...], message: str, forge: Forge, tree: Tree
) -> None:
    root = tree(
        {
            MARK: "",
            "lib/walker/say": SAY,
            "lib/walker/plain": "echo\n",
            "lib/walker/twin": SAY,
            "lib/walker/a/twin": SAY,
            "lib/walker/broken": "#!/no/such/interpreter\n",
        }
    )
    assert run(forge, root, *argv) == (2, "", f"error: {message}\n".replace("{}", str(root)))


MANY = "'a', 'b', 'c', 'd', 'e', 'f', 'g', 'h', 'i', 'j'; 'forge pkg executables walker' lists all 11"


@pytest.mark.parametrize(
    ("argv", "programs", "told"),
    [
        ((), "", "missing arguments PACKAGE and EXECUTABLE\nhint: list them with 'forge pkg executables'"),
        (("walker",), "ba", "missing argument EXECUTABLE\nhint: 'walker' has 'a', 'b'"),
        (("--prefix", "gdb", "walker"), "a", "missing argument EXECUTABLE\nhint: 'walker' has 'a'"),
        (("walker",), "abcdefghijk", f"missing argument EXECUTABLE\nhint: 'walker' has {MANY}"),
        (
            ("walker",),
            "",
            "no executable found\nhint: package 'walker' has no executables in '{}/lib/walker'",
        ),
        (("wolker",), "a", "package 'wolker' not found\nhint: did you mean 'walker'?"),
    ],
)
def test_run_requires_package_and_program(
    argv: tuple[str, ...], programs: str, told: str, forge: Forge, tree: Tree
) -> None:
    root = tree({MARK: "", **{f"lib/walker/{name}": SAY for name in programs}})
    assert run(forge, root, *argv) == (2, "", f"error: {told}\n".replace("{}", str(root)))


def package_xml(build_type: str) -> dict[str, str]:
    """Return an installed package of a build type, as far as anybody asks."""
    return {MARK: "", "share/walker/package.xml": f"<build_type>{build_type}</build_type>"}


NOTHING = "has no executables in '{}/lib/walker': "
BIN = "it is in '{}/bin' instead of lib/walker: start it with 'forge shell -- say', or "
OTHER = "it is in '{}/lib/wlaker' instead of lib/walker: "


@pytest.mark.parametrize(
    ("files", "where", "hint"),
    [
        (
            package_xml("ament_python"),
            NOTHING,
            "add it to 'console_scripts' in its setup.py, and build again",
        ),
        (
            package_xml("ament_cmake"),
            NOTHING,
            "add install(TARGETS say DESTINATION lib/${PROJECT_NAME}) to its CMakeLists.txt, and build again",
        ),
        (
            {**package_xml("ament_python"), "bin/say": SAY},
            BIN,
            "write install_scripts=$base/lib/walker below [install] in its setup.cfg",
        ),
        (
            {**package_xml("ament_cmake"), "lib/wlaker/say": SAY},
            OTHER,
            "write DESTINATION lib/${PROJECT_NAME} in install() in its CMakeLists.txt",
        ),
    ],
)
def test_a_program_in_the_wrong_folder_is_reported(
    files: dict[str, str], where: str, hint: str, forge: Forge, tree: Tree
) -> None:
    root = tree(files)
    code, _, err = run(forge, root, "walker", "say")
    assert code == 2
    assert f"{where.format(root)}{hint}" in err


@pytest.mark.parametrize("name", ["launch/walk.xml", "walk.launch.py"])
def test_a_launch_file_is_not_a_program(name: str, forge: Forge, tree: Tree) -> None:
    root = tree({MARK: "", "lib/walker/say": SAY, f"share/walker/{name}": ""})
    name = name.rpartition("/")[2]
    told = f"error: no executable found\nhint: to launch it: forge shell -- ros2 launch walker {name}\n"
    assert run(forge, root, "walker", name) == (2, "", told)


def test_a_script_with_windows_line_ends_is_reported(forge: Forge, tree: Tree) -> None:
    """The system would report a missing 'python3' followed by an invisible character."""
    root = tree({MARK: "", "lib/walker/say": SAY.replace("\n", "\r\n")})
    code, _, err = run(forge, root, "walker", "say")
    assert code == 2
    assert "Windows line endings" in err
    assert "hint: fix the source: sed -i 's/\\r$//' say, and build again" in err


def test_a_program_for_another_platform_is_reported(forge: Forge, tree: Tree) -> None:
    root = tree({MARK: "", "lib/walker/say": ""})
    (root / "lib/walker/say").write_bytes(b"\x7fELF\x02\x01\x01" + bytes(57))
    (root / "lib/walker/say").chmod(0o755)
    code, _, err = run(forge, root, "walker", "say")
    assert (code, err.splitlines()[0]) == (2, f"error: cannot run '{root}/lib/walker/say': exec format error")
    assert "hint: it was compiled for another platform" in err
    assert "--prefix 'qemu-aarch64 -L /usr/aarch64-linux-gnu'" in err


def test_errors_about_unbuilt_packages_do_not_suggest_sourcing(forge: Forge, tree: Tree) -> None:
    files = {"install/.colcon_install_layout": "isolated\n", "install/half/lib/half/x": ""}
    manifest = {"src/zzz/package.xml": manifest_text("zzz")}
    root = tree({**files, **manifest, f"install/walker/{MARK}": ""})
    told = {
        name: forge("run", name, "say", cwd=root, env={"AMENT_PREFIX_PATH": None}).err
        for name in ("wlaker", "half", "zzz", "nope")
    }
    assert (
        told["wlaker"]
        == "error: package 'wlaker' is not installed in 'install'\nhint: did you mean 'walker'?\n"
    )
    assert "call ament_package() at the end of its CMakeLists.txt" in told["half"]
    assert "hint: build it: forge build --packages-select zzz" in told["zzz"]
    assert told["nope"] == "error: package 'nope' is not installed in 'install'\n"
    sourced = forge("run", "half", "say", cwd=root, env={"AMENT_PREFIX_PATH": str(root / "install/walker")})
    assert "call ament_package() at the end of its CMakeLists.txt" in sourced.err


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("bin/say", ("CMakeLists.txt", "project(walker)\n")),
        ("lib/walker/say", ("CMakeLists.txt", "project(walker)\n")),
        ("lib/walker/say", ("Cargo.toml", '[package]\nname = "walker"\nversion = "1.0.0"\n')),
    ],
)
def test_programs_of_plain_packages_run_without_an_index_entry(
    path: str, source: tuple[str, str], forge: Forge, tree: Tree
) -> None:
    script = '#!/bin/sh\necho "$WALKS:$1"\n'
    root = tree(
        {
            "install/.colcon_install_layout": "isolated\n",
            "install/walker/share/walker/package.dsv": "set;WALKS;yes\n",
            "install/walker/share/colcon-core/packages/walker": "",
            f"install/walker/{path}": script,
            f"src/walker/{source[0]}": source[1],
        }
    )
    env = {"AMENT_PREFIX_PATH": None}
    assert forge("run", "walker", "say", "a", cwd=root, env=env).out == "yes:a\n"
    assert "hint: did you mean 'say'?" in forge("run", "walker", "sya", cwd=root, env=env).err
    refused = forge("pkg", "executables", "walker", cwd=root, env=env).err
    assert refused == (
        "error: 'walker' is a package without ament, which ament's index does not contain\n"
        f"hint: it is installed in '{root}/install/walker', and 'forge run walker' runs its programs\n"
    )


def test_programs_of_an_underlay_run_without_sourcing(forge: Forge, tree: Tree) -> None:
    script = '#!/bin/sh\necho "$AMENT_PREFIX_PATH:$1"\n'
    marker = {"install/.colcon_install_layout": "merged\n", "src/notes": ""}
    root = tree({**marker, f"under/{MARK}": "", "under/lib/walker/say": script})
    (root / "under/local_setup.sh").write_text(f'export AMENT_PREFIX_PATH="{root}/under"\n')
    state = json.dumps({"python": "python3", "underlays": [str(root / "under")]})
    (root / "install/.forge.json").write_text(state)
    ran = forge("run", "walker", "say", "a", cwd=root / "src", env={"AMENT_PREFIX_PATH": None})
    assert (ran.code, ran.out, ran.err) == (0, f"{root}/under:a\n", "")
