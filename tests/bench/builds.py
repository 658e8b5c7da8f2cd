"""Builds beside colcon's: nothing to do, one file changed, everything from nothing.

Each tool has a copy of the workspace of its own. Packages of ament are built by both on the embedded
ament, which forge installs into an underlay beforehand.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from tests.bench.timing import Variant
from tests.bench.workspaces import write_ament_workspace, write_workspace
from tests.packages import manifest_text

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from tests.bench.scenarios import Peers

_QUIET = ("--log-base", "/dev/null")
_CHANGE = "echo 'int changed_'$(date +%s%N)';' >> {path}"
_COMPILE = "ls -d build/bench_* | xargs -n 1 -P {jobs} ninja -C"
_CLEAN = "for folder in build/bench_*; do ninja -C $folder clean; done"


def forge() -> tuple[str, ...]:
    """Return the argv of the forge command beside this interpreter, else of its module."""
    script = Path(sys.executable).with_name("forge")
    return (str(script),) if script.is_file() else (sys.executable, "-m", "forge")


def nothing_on_plain(folder: Path, peers: Peers) -> tuple[Variant, ...]:
    """Measure a build of 100 plain CMake packages in which nothing changed."""
    return _nothing(folder, peers, lambda root: write_workspace(root, 100), {})


def nothing_on_ament(folder: Path, peers: Peers) -> tuple[Variant, ...]:
    """Measure a build of 100 small ament_cmake packages in which nothing changed."""
    return _nothing(folder, peers, lambda root: write_ament_workspace(root, 100), _underlay(folder))


def nothing_on_1000(folder: Path, peers: Peers) -> tuple[Variant, ...]:
    """Measure a build of 1,000 packages in which nothing changed; colcon would take most of a minute."""
    del peers
    root = write_workspace(folder, 1000, files=2)
    return (_built(Variant("forge build", (*forge(), *_QUIET, "build", "--merge-install"), root)),)


def one_changed(folder: Path, peers: Peers) -> tuple[Variant, ...]:
    """Measure a build after a change of one .cpp that nobody needs, beside ninja in that folder alone."""
    del peers
    variables = _underlay(folder)
    variants = []
    for name in ("forge", "ninja"):
        root = write_ament_workspace(folder / name, 100)
        built = _built(Variant(f"{name} build", (*forge(), *_QUIET, "build"), root, env=variables))
        leaf = max(path.name for path in (root / "src").iterdir())
        change = ("sh", "-c", _CHANGE.format(path=root / "src" / leaf / "src" / "main.cpp"))
        argv = built.argv if name == "forge" else ("ninja", "-C", str(root / "build" / leaf))
        variants.append(replace(built, name=name, argv=argv, before=change))
    return tuple(variants)


def from_nothing(folder: Path, peers: Peers) -> tuple[Variant, ...]:
    """Measure a clean build of 100 small ament_cmake packages, and what of that the compilers take alone."""
    variables = _underlay(folder)
    remove = ("rm", "-rf", "build", "install", "log")
    tools = [_tool(name, argv, folder, variables) for name, argv in _tools(peers).items()]
    variants = []
    for tool in tools:
        write_ament_workspace(tool.cwd, 100)
        variants.append(replace(tool, before=remove))
    alone = _built(_tool("ninja", _tools(peers)["forge"], folder, variables, write_ament_workspace))
    jobs = len(os.sched_getaffinity(0))
    compilers = ("sh", "-c", _COMPILE.format(jobs=jobs))
    return (*variants, replace(alone, name="compilers alone", argv=compilers, before=("sh", "-c", _CLEAN)))


def list_1000(folder: Path, peers: Peers) -> tuple[Variant, ...]:
    """Measure the listing of 1,000 packages."""
    root = write_workspace(folder, 1000, files=2)
    variants = [Variant("forge list", (*forge(), "list"), root)]
    if peers.colcon:
        variants.append(Variant("colcon list", (peers.colcon, *_QUIET, "list"), root))
    return tuple(variants)


SCENARIOS: Mapping[str, Callable[[Path, Peers], tuple[Variant, ...]]] = {
    "nothing-100-plain": nothing_on_plain,
    "nothing-100-ament": nothing_on_ament,
    "nothing-1000": nothing_on_1000,
    "one-changed": one_changed,
    "from-nothing-100-ament": from_nothing,
    "list-1000": list_1000,
}


def _tools(peers: Peers) -> dict[str, tuple[str, ...]]:
    tools = {"forge": (*forge(), *_QUIET, "build")}
    if peers.colcon:
        tools["colcon"] = (peers.colcon, *_QUIET, "build")
    return tools


def _tool(
    name: str,
    argv: tuple[str, ...],
    folder: Path,
    variables: Mapping[str, str],
    write: Callable[[Path, int], Path] | None = None,
) -> Variant:
    """Return a tool with a folder of its own, which `write` fills."""
    root = folder / name
    if write:
        write(root, 100)
    return Variant(f"{name} build", argv, root, env=variables)


def _nothing(
    folder: Path, peers: Peers, write: Callable[[Path], Path], variables: Mapping[str, str]
) -> tuple[Variant, ...]:
    variants = []
    for name, argv in _tools(peers).items():
        tool = _tool(name, argv, folder, variables)
        write(tool.cwd)
        variants.append(_built(tool))
    return tuple(variants)


def _built(variant: Variant) -> Variant:
    """Run a variant once, so that it finds everything done, and return it."""
    variant.run()
    return variant


def _underlay(folder: Path) -> dict[str, str]:
    """Install the embedded ament and return the environment of who sourced it."""
    root = folder / "underlay"
    package = root / "src" / "wants_ament"
    package.mkdir(parents=True)
    manifest = manifest_text("wants_ament", "<depend>ament_cmake</depend>", build_type="cmake")
    (package / "package.xml").write_text(manifest, encoding="utf-8")
    (package / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.18)\nproject(wants_ament NONE)\n", encoding="utf-8"
    )
    subprocess.run((*forge(), *_QUIET, "build", "--merge-install"), cwd=root, check=True, capture_output=True)
    script = '. install/setup.sh && env -0 | grep -z "_PATH=\\|^PYTHONPATH="'
    printed = subprocess.run(["sh", "-c", script], cwd=root, check=True, capture_output=True, text=True)
    return dict(entry.split("=", 1) for entry in printed.stdout.split("\0") if entry)
