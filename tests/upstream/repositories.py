"""`python -m tests.upstream.repositories`: count the interface packages of public repositories that pass.

They are in workspaces that were built with `forge build --rosdistro NAME --continue-on-error`, without ROS. A
package counts if it was built, each of its types can be imported and has the bytes that rosbags gives it, and
its C++ headers compile without a warning.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from tests.upstream.figures import DISTRIBUTIONS, Repository, as_text, by_distribution, read, with_repository
from tests.upstream.scope import interface_packages

ROOT = Path(__file__).parents[2]
FLAGS = ("-std=c++17", "-fsyntax-only", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Werror")
KINDS = ("msg", "srv", "action")
FOREIGN = ("AMENT_", "CMAKE_", "COLCON_", "FORGE_", "ROS_", "PYTHONPATH", "LD_LIBRARY_PATH")


def main(argv: Sequence[str] | None = None) -> int:
    """Measure the workspaces, merge the counts into the file, and list what did not pass."""
    options = _parser().parse_args(argv)
    found = replace(read(options.output), commit=options.commit)
    commits: dict[str, dict[str, None]] = {}
    for distribution, folder in sorted(options.workspace, key=lambda pair: DISTRIBUTIONS.index(pair[0])):
        workspace = Path(folder).resolve()
        repositories = interface_packages(workspace, distribution)
        packages = [name for names in repositories.values() for name in names]
        faults, types = measure(workspace, packages, headers=distribution in options.headers)
        for checkout, names in repositories.items():
            repository = checkout.name.replace("+", "/")
            commits.setdefault(repository, {})[_commit(checkout)] = None
            passed = [name for name in names if not faults.get(name)]
            count = {distribution: (len(passed), len(names))}
            number = sum(types.get(name, 0) for name in names)
            row = Repository(repository, ", ".join(commits[repository]), count, number)
            found = with_repository(found, row)
            for name in names:
                for fault in faults.get(name, ()):
                    print(f"{distribution}: {repository}: {name}: {fault}")
    options.output.write_text(as_text(found), encoding="utf-8")
    return 0


def measure(
    workspace: Path, packages: Sequence[str], *, headers: bool
) -> tuple[Mapping[str, Sequence[str]], Mapping[str, int]]:
    """Check what was built; returns what is wrong with a package, and how many types each has."""
    built = [name for name in packages if (workspace / "install" / name / "share" / name).is_dir()]
    report = _types(workspace, built)
    faults = {name: ["not built"] if name not in built else [] for name in packages}
    for name, fault in report["faults"].items():
        faults[name.partition("/")[0]].append(f"{name}: {fault}")
    for name, why in report["unread"].items():
        print(f"rosbags cannot read {name}: {why}")
    for name in built if headers else ():
        faults[name].extend(header_faults(workspace, name))
    return faults, report["types"]


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
    """Return the variables of the checks: without a sourced ROS, with the interpreter that runs this."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(FOREIGN)}
    programs = os.pathsep.join((str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)))
    return {**kept, "VIRTUAL_ENV": sys.prefix, "PATH": programs}


def _commit(checkout: Path) -> str:
    command = ["git", "rev-parse", "--short=7", "HEAD"]
    done = subprocess.run(command, cwd=checkout, check=True, capture_output=True, text=True)
    return done.stdout.strip()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m tests.upstream.repositories",
        description="Count the interface packages of public repositories that pass in built workspaces.",
    )
    parser.add_argument(
        "--workspace",
        action="append",
        default=[],
        type=by_distribution,
        metavar="DISTRO=FOLDER",
        help="a built workspace with checkouts OWNER+NAME, or links to them, in src; may be repeated",
    )
    parser.add_argument("--output", type=Path, required=True, metavar="FILE", help="the file to update")
    parser.add_argument("--commit", required=True, help="the commit of forge that built the workspaces")
    parser.add_argument(
        "--headers",
        nargs="*",
        default=DISTRIBUTIONS,
        choices=DISTRIBUTIONS,
        help="distributions whose C++ headers are compiled (default: all)",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
