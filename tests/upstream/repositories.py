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
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tests.upstream.figures import DISTRIBUTIONS, Repository, as_text, read, with_repository
from tests.upstream.scope import batches, checkouts, choose

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from tests.upstream.scope import Chosen

ROOT = Path(__file__).parents[2]
FLAGS = ("-std=c++17", "-fsyntax-only", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Werror")
KINDS = ("msg", "srv", "action")
FOREIGN = ("AMENT_", "CMAKE_", "COLCON_", "FORGE_", "ROS_", "PYTHONPATH", "LD_LIBRARY_PATH")


def main(argv: Sequence[str] | None = None) -> int:
    """Measure the repositories in each distribution; write the file after every batch."""
    options = _parser().parse_args(argv)
    sources = options.sources.resolve()
    with tempfile.TemporaryDirectory(prefix="forge-upstream-") as scratch:
        work = (options.work or Path(scratch)).resolve()
        for distribution in options.distribution or DISTRIBUTIONS:
            found = checkouts(sources, distribution)
            names = [name for name in options.only or sorted(found) if name in found]
            chosen = {name: choose(found[name], found, distribution) for name in names}
            chosen = {name: each for name, each in chosen.items() if each.measured}
            for batch in batches(chosen, distribution, options.batch):
                repositories = {name: chosen[name] for name in batch}
                headers = distribution in options.headers
                result = _measure(work, distribution, repositories, headers=headers)
                _record(options, sources, distribution, repositories, result)
    return 0


@dataclass(frozen=True, slots=True)
class Result:
    """What became of the packages of a batch."""

    faults: Mapping[str, Sequence[str]]
    """What is wrong with a package; no entry if nothing is."""
    types: Mapping[str, int]
    """How many types each package has that was built."""


def _record(
    options: argparse.Namespace,
    sources: Path,
    distribution: str,
    chosen: Mapping[str, Chosen],
    result: Result,
) -> None:
    """Add a distribution to the rows of repositories, and tell each shortfall."""
    found = read(options.output)
    for name, each in chosen.items():
        passed = [package for package in each.measured if package not in result.faults]
        types = sum(result.types.get(package, 0) for package in each.measured)
        count = (len(passed), len(each.measured))
        _tell(f"{name} in {distribution}: {count[0]} of {count[1]} packages, {types} types")
        for package in each.measured:
            for fault in result.faults.get(package, ()):
                _tell(f"  {package}: {fault}")
        row = Repository(name.replace("+", "/"), _commits(name, sources), {distribution: count}, types)
        found = with_repository(found, row)
    found = replace(found, commit=options.commit or found.commit)
    options.output.write_text(as_text(found), encoding="utf-8")


def _measure(work: Path, distribution: str, chosen: Mapping[str, Chosen], *, headers: bool) -> Result:
    """Build the packages of repositories in one workspace and check what was built."""
    workspace = _workspace(work / distribution / next(iter(chosen)), chosen.values())
    packages = [package for each in chosen.values() for package in each.measured]
    output = _build(workspace, work / "cache", distribution, packages)
    built = [name for name in packages if (workspace / "install" / name / "share" / name).is_dir()]
    if len(built) < len(packages):
        _tell(output)
    report = _types(workspace, built)
    faults = {name: ["not built"] for name in packages if name not in built}
    for name, fault in report["faults"].items():
        faults.setdefault(name.partition("/")[0], []).append(f"{name}: {fault}")
    for name, why in report["unread"].items():
        _tell(f"rosbags cannot read {name}: {why}")
    for name in built if headers else ():
        faults.setdefault(name, []).extend(header_faults(workspace, name))
    return Result({name: found for name, found in faults.items() if found}, report["types"])


def _workspace(folder: Path, chosen: Iterable[Chosen]) -> Path:
    """Make a workspace of links to the packages; returns its folder."""
    source = folder / "src"
    source.mkdir(parents=True, exist_ok=True)
    packages = {name: path for each in chosen for name, path in {**each.others, **each.measured}.items()}
    for name, path in packages.items():
        if not (source / name).is_symlink():
            (source / name).symlink_to(path)
    return folder


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
        return {"types": {}, "faults": {}, "unread": {}}
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
    parser.add_argument(
        "--batch",
        type=int,
        default=10,
        metavar="NUMBER",
        help="how many repositories one workspace has at most (default: 10)",
    )
    parser.add_argument("--work", type=Path, metavar="FOLDER", help="keep the workspaces in this folder")
    return parser


if __name__ == "__main__":
    sys.exit(main())
