"""`python -m tests.upstream.repositories`: build the interface packages of public repositories without ROS.

A package counts if it builds, each of its types can be imported and has the bytes that rosbags gives it, and
its C++ headers compile without a warning. Nothing is downloaded: see `--help` for the sources.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tests.upstream.figures import DISTRIBUTIONS, Repository, as_text, read, with_repository
from tests.upstream.scope import checkouts, choose

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from tests.upstream.figures import Count
    from tests.upstream.scope import Chosen

ROOT = Path(__file__).parents[2]
FLAGS = ("-std=c++17", "-fsyntax-only", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Werror")
KINDS = ("msg", "srv", "action")
FOREIGN = ("AMENT_", "CMAKE_", "COLCON_", "FORGE_", "ROS_", "PYTHONPATH", "LD_LIBRARY_PATH")


def main(argv: Sequence[str] | None = None) -> int:
    """Measure each repository in each distribution; write the file after every one."""
    options = _parser().parse_args(argv)
    sources = options.sources.resolve()
    names = sorted({name for each in DISTRIBUTIONS for name in checkouts(sources, each)})
    with tempfile.TemporaryDirectory(prefix="forge-upstream-") as scratch:
        work = (options.work or Path(scratch)).resolve()
        for name in options.only or names:
            row = _measure(name, sources, work, options)
            if row is not None:
                found = with_repository(read(options.output), row, options.distribution or DISTRIBUTIONS)
                found = replace(found, commit=options.commit or found.commit)
                options.output.write_text(as_text(found), encoding="utf-8")
    return 0


def _measure(name: str, sources: Path, work: Path, options: argparse.Namespace) -> Repository | None:
    """Return the row of a repository; None if it has no interface package. Tells each shortfall."""
    counts: dict[str, Count] = {}
    types = 0
    for distribution in options.distribution or DISTRIBUTIONS:
        all_checkouts = checkouts(sources, distribution)
        if name not in all_checkouts:
            continue
        chosen = choose(all_checkouts[name], all_checkouts, distribution)
        if not chosen.measured:
            continue
        workspace = _workspace(work / distribution / name, chosen)
        headers = distribution in options.headers
        checked, faults = _check(workspace, chosen, work / "cache", distribution, headers=headers)
        for fault in faults:
            _tell(f"{name} in {distribution}: {fault}")
        passed = set(chosen.measured) - {fault.split(maxsplit=1)[0] for fault in faults}
        counts[distribution] = (len(passed), len(chosen.measured))
        types = max(types, checked)
        _tell(f"{name} in {distribution}: {len(passed)} of {len(chosen.measured)}, {checked} types")
    return Repository(name.replace("+", "/"), _commits(name, sources), counts, types) if counts else None


def _workspace(folder: Path, chosen: Chosen) -> Path:
    """Make a workspace of links to the packages; returns its folder."""
    source = folder / "src"
    source.mkdir(parents=True, exist_ok=True)
    for name, path in {**chosen.others, **chosen.measured}.items():
        link = source / name
        if not link.is_symlink():
            link.symlink_to(path)
    return folder


def _check(
    workspace: Path, chosen: Chosen, cache: Path, distribution: str, *, headers: bool
) -> tuple[int, list[str]]:
    """Build the packages; returns how many types they have and 'PACKAGE what is wrong' for each fault."""
    output = _build(workspace, cache, distribution, list(chosen.measured))
    built = [name for name in chosen.measured if (workspace / "install" / name / "share" / name).is_dir()]
    faults = [f"{name} is not built" for name in chosen.measured if name not in built]
    if faults:
        faults.append(f"(output of the build)\n{output}")
    report = _types(workspace, built)
    faults += [f"{name.partition('/')[0]} {name}: {fault}" for name, fault in report["faults"].items()]
    if headers:
        faults += [f"{name} {fault}" for name in built for fault in header_faults(workspace, name)]
    return sum(report["types"].values()), faults


def _build(workspace: Path, cache: Path, distribution: str, packages: Sequence[str]) -> str:
    """Build packages with what they depend on; returns the output. The cache has what others built."""
    command = [sys.executable, "-m", "forge", "build", "--rosdistro", distribution, "--continue-on-error"]
    command += ["--cache", str(cache), "--packages-up-to", *packages, "--cmake-args", "-DBUILD_TESTING=OFF"]
    done = subprocess.run(
        command,
        cwd=workspace,
        env=_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        check=False,
    )
    return done.stdout.decode(errors="replace")


def _types(workspace: Path, packages: Sequence[str]) -> dict[str, Any]:
    """Check the types of packages in the environment of their workspace."""
    if not packages:
        return {"types": {}, "faults": {}}
    script = 'source install/setup.bash && PYTHONPATH="$0:$PYTHONPATH" exec "$@"'
    command = [sys.executable, "-m", "tests.upstream.types_check", *packages]
    done = subprocess.run(
        ["bash", "-c", script, str(ROOT), *command],
        cwd=workspace,
        env=_environment(),
        stdout=subprocess.PIPE,
        check=True,
    )
    report: dict[str, Any] = json.loads(done.stdout)
    return report


def header_faults(workspace: Path, package: str) -> Iterator[str]:
    """Compile all generated headers of a package in one unit; yields the first errors."""
    folders = sorted(path for path in (workspace / "install").glob("*/include/*") if path.is_dir())
    base = workspace / "install" / package / "include" / package
    found = [path for kind in KINDS for path in sorted((base / package / kind).rglob("*.hpp"))]
    headers = [path.relative_to(base) for path in found]
    text = "".join(f'#include "{header}"\n' for header in headers)
    done = subprocess.run(
        ["g++", *FLAGS, *(f"-I{folder}" for folder in folders), "-x", "c++", "-"],
        input=text.encode(),
        stderr=subprocess.PIPE,
        check=False,
    )
    if done.returncode:
        errors = [line for line in done.stderr.decode(errors="replace").splitlines() if "error" in line]
        yield "headers: " + "; ".join(errors[:3])


def _environment() -> dict[str, str]:
    """Return the variables of the build: without a sourced ROS, with the interpreter that runs this."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(FOREIGN)}
    programs = os.pathsep.join((str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)))
    return {**kept, "VIRTUAL_ENV": sys.prefix, "PATH": programs}


def _commits(name: str, sources: Path) -> str:
    """Return the commits of a repository in the order of the distributions, equal ones once."""
    found = (checkouts(sources, distribution).get(name) for distribution in DISTRIBUTIONS)
    return ", ".join(dict.fromkeys(_commit(checkout) for checkout in found if checkout is not None))


def _commit(checkout: Path) -> str:
    command = ["git", "rev-parse", "--short=7", "HEAD"]
    done = subprocess.run(command, cwd=checkout, check=True, capture_output=True, text=True)
    return done.stdout.strip()


def _tell(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m tests.upstream.repositories",
        description="Build the interface packages of public repositories without ROS; write their counts.",
    )
    parser.add_argument(
        "--sources",
        type=Path,
        required=True,
        metavar="FOLDER",
        help="checkouts OWNER+NAME, those for one distribution in a folder of its name",
    )
    parser.add_argument("--output", type=Path, required=True, metavar="FILE", help="the file to update")
    parser.add_argument("--commit", help="the commit of forge that is measured")
    parser.add_argument("--only", action="append", metavar="OWNER+NAME", help="a repository; may be repeated")
    parser.add_argument(
        "--distribution", action="append", choices=DISTRIBUTIONS, help="a distribution; may be repeated"
    )
    parser.add_argument(
        "--headers",
        nargs="*",
        default=["jazzy"],
        choices=DISTRIBUTIONS,
        help="distributions whose C++ headers are compiled (default: jazzy)",
    )
    parser.add_argument("--work", type=Path, metavar="FOLDER", help="keep the workspaces in this folder")
    return parser


if __name__ == "__main__":
    sys.exit(main())
