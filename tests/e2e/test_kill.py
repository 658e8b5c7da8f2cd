"""A build that is interrupted or killed at any moment leaves nothing that misleads the next one."""

import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.evolving import EDITS, LOW, PLAIN, PYTHON, Evolving, differences, look
from tests.packages import manifest_text
from tests.underlay_states import below

pytestmark = pytest.mark.needs("cmake", "ninja", "g++")

KILLS = int(os.environ.get("FORGE_TEST_KILLS", "1"))
"""How often each test kills; `make soak` asks for many."""
SEED = int(os.environ.get("FORGE_TEST_SEED", "1"))

_SLOW = """cmake_minimum_required(VERSION 3.18)
project(slow NONE)
add_custom_command(OUTPUT made.txt DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/what.txt
  COMMAND printf half > made.txt && sleep 0.2 && cp ${CMAKE_CURRENT_SOURCE_DIR}/what.txt made.txt)
add_custom_target(all_of_it ALL DEPENDS made.txt)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/made.txt DESTINATION share/slow)
install(CODE "execute_process(COMMAND sleep 0.1)")
install(FILES what.txt DESTINATION share/slow)
"""
SLOW = {
    "src/slow/package.xml": manifest_text("slow", build_type="cmake"),
    "src/slow/CMakeLists.txt": _SLOW,
    "src/slow/what.txt": "whole\n",
}
SAFE_EDITS = [name for name in sorted(EDITS) if name not in {"break", "garble", "lose"}]
"""A package that is broken would hide what we look for; a journal that is lost is another test's matter."""


def forge(workspace: Evolving, *words: str) -> subprocess.Popen[bytes]:
    """Start a build, or another command, as a shell would."""
    command = words or ("build", *workspace.options())
    argv = [sys.executable, "-m", "forge", "--log-base", "/dev/null", *command]
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith(("CMAKE_", "CXX"))
    }
    environment.update(workspace.variables)
    return subprocess.Popen(
        argv, cwd=workspace.home, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )


def build(workspace: Evolving, *words: str) -> float:
    """Build to the end, or run another command; return how long it took."""
    begun = time.monotonic()
    process = forge(workspace, *words)
    said, _ = process.communicate()
    assert process.returncode == 0, said.decode()
    return time.monotonic() - begun


def clean_build(workspace: Evolving) -> dict[str, tuple[str, ...]]:
    """Build the current sources from scratch in the same folder; return the installed files."""
    parked = workspace.root / "parked"
    workspace.home.rename(parked)
    shutil.copytree(parked / "src", workspace.home / "src", symlinks=True)
    build(workspace)
    found = look(workspace.home / "install")
    shutil.rmtree(workspace.home)
    parked.rename(workspace.home)
    return found


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
@pytest.mark.parametrize("merged", [False, True], ids=["isolated", "merged"])
def test_the_build_after_an_interruption_matches_a_clean_build(
    tmp_path: Path, number: signal.Signals, *, merged: bool
) -> None:
    chance = random.Random(f"{SEED} {number} {merged}")
    root = tmp_path / "all"
    root.mkdir()
    workspace = below(tmp_path / "low", LOW, root / "under").evolving(root, merged=merged)
    workspace.write({**PLAIN, **PYTHON, **SLOW})
    lasts = build(workspace)
    for kill in range(KILLS):
        packages = workspace.packages
        edits = [(chance.choice(SAFE_EDITS), chance.randrange(100)) for _ in range(chance.randrange(4))]
        edits.append(("variable", kill))  # so that everything is built
        for name, among in edits:
            EDITS[name](workspace, among)
        for _ in range(chance.choice((1, 1, 2))):
            process = forge(workspace)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.communicate(timeout=chance.uniform(0.05, lasts))
            process.send_signal(number)
            process.communicate()
        build(workspace)
        if not {*packages} <= {*workspace.packages}:
            # What is left of a package that is gone is the user's to remove; forge warns of it.
            build(workspace, "clean", "--yes", "stale")
        wrong = differences(look(workspace.home / "install"), clean_build(workspace))
        assert not wrong, f"kill {kill} after {edits}: {wrong}"
