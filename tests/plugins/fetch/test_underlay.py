"""The build of locked packages inside of `forge build`: what it prints, ends, repeats and shares."""

import fcntl
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from forge.plugins.fetch.underlay import lock_path
from forge.toolchain.interpreter import own_command
from tests.conftest import Forge
from tests.e2e.test_live import build as on_terminal
from tests.packages import manifest_text, write_files
from tests.plugins.fetch.ros import CMAKE, Ros, depends

pytestmark = pytest.mark.needs("cmake", "git")

LIBRARY = """\
enable_language(C)
file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/code.c "const char *where(void) { return __FILE__; }")
add_library(rclmini SHARED lib.c ${CMAKE_CURRENT_BINARY_DIR}/code.c)
install(TARGETS rclmini DESTINATION lib)"""


@pytest.fixture
def ros(ros: Ros) -> Ros:
    """Let the client library need one package only."""
    ros.release("rclmini", *depends("lib_vendor"))
    return ros


def new_workspace(root: Path, needs: str = "rclmini") -> Path:
    """Write a workspace with one package that needs another."""
    manifest = manifest_text("hello", *depends(needs), build_type="cmake")
    text = CMAKE.format(name="hello", version="1", lines=f"find_package({needs} REQUIRED)")
    return write_files(root, {"src/hello/package.xml": manifest, "src/hello/CMakeLists.txt": text})


def underlay(tmp_path: Path) -> Path:
    (folder,) = (tmp_path / "ros/user cache/forge/ros/underlays").glob("humble-*")
    return folder


def built(tmp_path: Path) -> set[str]:
    return set(json.loads((underlay(tmp_path) / "built.json").read_text())["packages"])


@pytest.mark.parametrize("words", [("--json",), ("--event-handlers", "console_start_end-")])
def test_building_the_underlay_prints_two_lines(
    ros: Ros, forge: Forge, tmp_path: Path, words: tuple[str, ...]
) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", cwd=workspace, env=env).code == 0
    ran = forge("build", *words, cwd=workspace, env=env)
    assert ran.code == 0
    lines = ran.err.splitlines()
    if "--event-handlers" in words:
        assert lines == []
    else:
        where = underlay(tmp_path)
        assert lines[0] == f"building 2 packages of ROS humble in '{where}', once for all workspaces"
        assert lines[1].startswith("built 2 packages of ROS humble [")
        assert len(lines) == 2
    assert "rclmini" not in ran.out
    if "--json" in words:
        assert {json.loads(line).get("package", "hello") for line in ran.out.splitlines()} == {"hello"}
    (log,) = underlay(tmp_path).glob("log/build_*")
    assert (log / "rclmini/stdout_stderr.log").is_file()


def test_only_packages_that_are_built_are_counted(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    env = ros.variables()
    for name, packages in (("rclmini", "2 packages"), ("turtle", "1 package")):
        workspace = new_workspace(tmp_path / name, name)
        assert forge("fetch", cwd=workspace, env=env).code == 0
        head, end = forge("build", cwd=workspace, env=env).err.splitlines()
        assert head.startswith(f"building {packages} of ROS humble in ")
        assert end.startswith(f"built {packages} of ROS humble [")


def test_a_workspace_does_not_wait_for_packages_of_another_one(
    ros: Ros, forge: Forge, tmp_path: Path
) -> None:
    go, env = tmp_path / "go", ros.variables()
    waits = f'execute_process(COMMAND sh -c "until [ -e {go} ]; do sleep 0.1; done")'
    ros.release("slow", *depends("rclmini"), cmake=waits)
    env = ros.variables()
    for name in ("slow", "rclmini"):
        assert forge("fetch", cwd=new_workspace(tmp_path / name, name), env=env).code == 0
    command, variables = own_command("build"), {**os.environ, **env}
    with subprocess.Popen(command, cwd=tmp_path / "slow", env=variables, stderr=subprocess.DEVNULL) as other:
        try:
            ran = forge("build", cwd=tmp_path / "rclmini", env=env)
            assert ran.code == 0, ran.err
            assert other.poll() is None
        finally:
            go.touch()
    assert other.returncode == 0


def test_a_package_that_only_another_workspace_needs_may_be_broken(
    ros: Ros, forge: Forge, tmp_path: Path
) -> None:
    ros.release("broken", *depends("rclmini"), cmake='message(FATAL_ERROR "broken on purpose")')
    env = ros.variables()
    for name, code in (("broken", 2), ("rclmini", 0)):
        workspace = new_workspace(tmp_path / name, name)
        assert forge("fetch", cwd=workspace, env=env).code == 0
        assert forge("build", cwd=workspace, env=env).code == code
    # After a change of the system, all packages are checked.
    (underlay(tmp_path) / "built.json").unlink()
    ran = forge("build", cwd=tmp_path / "rclmini", env=env)
    assert (ran.code, ran.err) == (0, "")


def test_the_progress_of_the_underlay_is_shown_in_one_line(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    ros.release("rclmini", *depends("lib_vendor"), cmake="execute_process(COMMAND sleep 0.5)")
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", cwd=workspace, env=env).code == 0
    terminal = on_terminal(workspace, size=(250, 24), variables=env)
    assert terminal.end() == 0
    assert any(frame.endswith("[1/2] rclmini") for frame in terminal.frames)
    head, end, *rest = terminal.frames[-1].splitlines()
    assert head.startswith("building 2 packages of ROS humble in ")
    assert end.startswith("built 2 packages of ROS humble [")
    assert not any("rclmini" in line for line in rest)


def test_failures_in_the_underlay_are_shown_in_full(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    ros.release("rclmini", *depends("lib_vendor"), cmake='message(FATAL_ERROR "broken on purpose")')
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", cwd=workspace, env=env).code == 0
    ran = forge("build", "--json", cwd=workspace, env=env)
    assert (ran.code, ran.out) == (2, "")
    lines = ran.err.splitlines()
    assert lines[1].startswith("Failed   <<< rclmini [")
    assert "exited with code 1" in lines[1]
    assert any("broken on purpose" in line for line in lines)
    (log,) = (line.removeprefix("  log: ") for line in lines if line.startswith("  log: "))
    assert "broken on purpose" in Path(log).read_text()
    assert "error: 'rclmini' of 'forge.lock' could not be built" in lines
    assert built(tmp_path) == {"lib_vendor"}


def test_cmake_4_builds_projects_for_cmake_2(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    write = """\
file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/least.txt "$ENV{CMAKE_POLICY_VERSION_MINIMUM}")
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/least.txt DESTINATION share)"""
    ros.release("rclmini", cmake=write)
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", cwd=workspace, env=env).code == 0
    assert forge("build", cwd=workspace, env=env).code == 0
    assert (underlay(tmp_path) / "install/share/least.txt").read_text() == "3.5"


def test_a_failed_extension_of_the_underlay_leaves_no_package_marked_as_built(
    ros: Ros, forge: Forge, tmp_path: Path
) -> None:
    both = (
        "find_package(rmw_fastrtps_cpp QUIET)\nif(rmw_fastrtps_cpp_FOUND)\nmessage(FATAL_ERROR both)\nendif()"
    )
    ros.release("rmw_implementation", *depends("rmw_cyclonedds_cpp", "rmw_fastrtps_cpp"), cmake=both)
    ros.release("rclmini", *depends("rmw_implementation", "lib_vendor"))
    env = ros.variables()
    first, second = new_workspace(tmp_path / "first"), new_workspace(tmp_path / "second")
    assert forge("fetch", cwd=first, env=env).code == 0
    assert forge("build", cwd=first, env=env).code == 0
    assert forge("fetch", "rmw_fastrtps_cpp", cwd=second, env=env).code == 0
    ran = forge("build", cwd=second, env=env)
    assert ran.code == 2
    assert "Failed   <<< rmw_implementation" in ran.err
    assert built(tmp_path) == {"lib_vendor", "rmw_cyclonedds_cpp", "rmw_fastrtps_cpp", "fastdds"}
    ran = forge("build", cwd=first, env=env)
    assert ran.code == 2, "its underlay is broken, which a build has to say"


def test_packages_without_python_modules_need_neither_uv_nor_an_environment(
    ros: Ros, forge: Forge, tmp_path: Path
) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    folders = os.environ["PATH"].split(os.pathsep)
    env["PATH"] = os.pathsep.join(each for each in folders if not Path(each, "uv").exists())
    ran = forge("fetch", cwd=workspace, env=env)
    assert (ran.code, ran.err) == (0, "")
    assert not (workspace / ".venv").exists()


def test_programs_of_fetched_packages_run_from_an_empty_workspace(
    ros: Ros, forge: Forge, tmp_path: Path
) -> None:
    script = 'file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/swim "#!/bin/sh\\necho it swims\\n")'
    program = "install(PROGRAMS ${CMAKE_CURRENT_BINARY_DIR}/swim DESTINATION lib/turtle)"
    index = "install(FILES package.xml DESTINATION share/ament_index/resource_index/packages RENAME turtle)"
    ros.release("turtle", *depends("rclmini"), cmake=f"{script}\n{program}\n{index}")
    workspace, env = tmp_path / "ws", ros.variables()
    (workspace / "src").mkdir(parents=True)
    assert forge("fetch", "turtle", cwd=workspace, env=env).code == 0
    assert forge("build", cwd=workspace, env=env).code == 0
    ran = forge("run", "turtle", "swim", cwd=workspace, env=env)
    assert (ran.code, ran.out) == (0, "it swims\n"), ran.err
    script = ". install/setup.sh; echo $CMAKE_PREFIX_PATH"
    sourced = subprocess.run(["sh", "-c", script], cwd=workspace, capture_output=True, text=True, check=True)
    assert f"{underlay(tmp_path)}/install" in sourced.stdout


def test_an_interrupted_underlay_is_checked_instead_of_rebuilt(
    ros: Ros, forge: Forge, tmp_path: Path
) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", cwd=workspace, env=env).code == 0
    assert forge("build", cwd=workspace, env=env).code == 0
    before = built(tmp_path)
    (underlay(tmp_path) / "built.json").unlink()
    ran = forge("build", cwd=workspace, env=env)
    assert (ran.code, ran.err) == (0, "")
    assert built(tmp_path) == before
    assert len([*underlay(tmp_path).glob("log/build_*")]) == 1
    # Or not at all, while another process does so.
    (underlay(tmp_path) / "built.json").unlink()
    with lock_path(underlay(tmp_path)).open("a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        ran = forge("build", "--no-wait", cwd=workspace, env=env)
    assert ran.code == 2
    assert f"error: another process is building in '{underlay(tmp_path)}'" in ran.err
    # What is wrong with its folder is shown.
    write_files(underlay(tmp_path), {"src/more/package.xml": manifest_text("rclmini", build_type="cmake")})
    ran = forge("build", cwd=workspace, env=env)
    assert ran.code == 2
    assert "src/more" in ran.err
    assert "error: the packages of 'forge.lock' could not be built" in ran.err


@pytest.mark.needs("gcc")
def test_a_compiler_upgrade_rebuilds_compiled_packages(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    ros.release("rclmini", *depends("lib_vendor"), cmake=LIBRARY)
    ros.commit("rclmini-release", {"lib.c": "int f(void) { return 1; }\n"}, "release/humble/rclmini/1.0.0-1")
    compiler = tmp_path / "compiler"
    write_files(tmp_path, {"compiler": '#!/bin/sh\nexec gcc "$@"\n'})
    workspace, env = new_workspace(tmp_path / "ws"), {**ros.variables(), "CC": str(compiler)}
    assert forge("fetch", cwd=workspace, env=env).code == 0
    assert forge("build", cwd=workspace, env=env).code == 0
    compiler.write_text('#!/bin/sh\n# upgraded\nexec gcc "$@"\n')
    ran = forge("build", cwd=workspace, env=env)
    assert "built 2 packages of ROS" in ran.err
    assert forge("build", cwd=workspace, env=env).err == ""


def test_up_to_date_builds_read_no_manifests_of_a_sourced_ros(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    foreign, env = tmp_path / "opt/ros", ros.variables()
    write_files(foreign, {"share/ament_index/resource_index/packages/fastdds": ""})
    env |= {"AMENT_PREFIX_PATH": str(foreign), "CMAKE_PREFIX_PATH": str(foreign)}
    workspace = new_workspace(tmp_path / "ws")
    assert forge("fetch", cwd=workspace, env=env).code == 0
    assert forge("build", cwd=workspace, env=env).code == 0
    # No build that reads a manifest could do without these.
    shutil.rmtree(tmp_path / "ros/user cache/forge/ros/sources")
    shutil.rmtree(tmp_path / "ros/repositories")
    ran = forge("build", cwd=workspace, env=env)
    assert (ran.code, ran.err) == (0, "")
    assert "1 package unchanged" in ran.out


def test_the_plugin_is_not_loaded_without_a_lock(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", cwd=workspace, env=env).code == 0
    (workspace / "forge.lock").unlink()
    write_files(workspace, {"src/hello/package.xml": manifest_text("hello", build_type="cmake")})
    write_files(workspace, {"src/hello/CMakeLists.txt": CMAKE.format(name="hello", version="1", lines="")})
    script = """\
import sys
seen = []
seen_events = ("open", "os.", "subprocess.")
sys.addaudithook(lambda name, words: name.startswith(seen_events) and seen.append(f"{name} {words}"))
from forge.cli.main import main
code = main(["build"])
print([name for name in sys.modules if "fetch" in name or name in ("rosdistro", "tomllib")])
print([each for each in seen if "forge.lock" in each or "/forge/ros" in each or "'git'" in each])
sys.exit(code)
"""
    ran = subprocess.run(
        [sys.executable, "-c", script],
        cwd=workspace,
        env={**os.environ, **env},
        capture_output=True,
        text=True,
        check=True,
    )
    assert ran.stdout.endswith("[]\n[]\n")


def test_an_interrupt_ends_the_underlay_build_once(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    started = tmp_path / "started"
    slow = f"file(TOUCH {started})\nexecute_process(COMMAND sleep 600.25)"
    ros.release("rclmini", *depends("lib_vendor"), cmake=slow)
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", cwd=workspace, env=env).code == 0
    process = subprocess.Popen(
        own_command("build"),
        cwd=workspace,
        env={**os.environ, **env},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 120
    while not started.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 130
    assert out == ""
    assert err.splitlines()[1:] == []
    assert built(tmp_path) == {"lib_vendor"}
    commands = [path.read_bytes() for path in Path("/proc").glob("[0-9]*/cmdline") if path.exists()]
    assert b"sleep\x00600.25\x00" not in commands


def test_the_underlay_build_joins_a_parent_jobserver(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    asked = "add_custom_target(ask ALL COMMAND printenv MAKEFLAGS > ${CMAKE_INSTALL_PREFIX}/flags)"
    ros.release("rclmini", *depends("lib_vendor"), cmake=asked)
    workspace, env = new_workspace(tmp_path / "ws"), ros.variables()
    assert forge("fetch", cwd=workspace, env=env).code == 0
    write_files(
        workspace, {"Makefile": f"all:\n\t+@{' '.join(own_command('build'))}\n\t@echo $(MAKEFLAGS)\n"}
    )
    variables = {**os.environ, **env, "CMAKE_GENERATOR": "Unix Makefiles"}
    ran = subprocess.run(
        ["make", "-j3"], cwd=workspace, env=variables, capture_output=True, text=True, check=False
    )
    assert (ran.returncode, "warning" in ran.stderr) == (0, False)
    auth = next(word for word in ran.stdout.split() if word.startswith("--jobserver-auth="))
    (flags,) = underlay(tmp_path).rglob("flags")
    assert auth in flags.read_text().split()


def test_job_limits_apply_to_the_underlay_build(ros: Ros, forge: Forge, tmp_path: Path) -> None:
    asked = "add_custom_target(ask ALL COMMAND printenv MAKEFLAGS > ${CMAKE_INSTALL_PREFIX}/flags)"
    ros.release("rclmini", *depends("lib_vendor"), cmake=asked)
    workspace, env = new_workspace(tmp_path / "ws"), {**ros.variables(), "CMAKE_GENERATOR": "Unix Makefiles"}
    assert forge("fetch", cwd=workspace, env=env).code == 0
    ran = forge("build", "--jobs", "5", "--memory-limit", "75%", "--load-limit", "90", cwd=workspace, env=env)
    assert ran.code == 0, ran.err
    (flags,) = underlay(tmp_path).rglob("flags")
    assert "-j5" in flags.read_text()
