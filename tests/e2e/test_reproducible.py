"""The same sources make the same wheel and the same sdist, byte by byte, wherever and whenever."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
PARTS = (
    *("forge", "templates", "docs", "_ros_forge.py", "hatch_build.py"),
    *("README.md", "CHANGELOG.md", "LICENSE", "Makefile", "pyproject.toml"),
)


def build(folder: Path, umask: int, seconds: int) -> dict[str, bytes]:
    """Build both in a copy of the sources whose files have rights and times of their own."""
    folder.mkdir(parents=True)
    before = os.umask(umask)
    try:
        for part in PARTS:
            if (ROOT / part).is_dir():
                litter = shutil.ignore_patterns("__pycache__", "*.pyc", "_templates")
                shutil.copytree(ROOT / part, folder / part, ignore=litter, copy_function=shutil.copyfile)
            else:
                shutil.copyfile(ROOT / part, folder / part)
        for path in folder.rglob("*"):
            os.utime(path, (seconds, seconds))
        variables = {name: value for name, value in os.environ.items() if name != "SOURCE_DATE_EPOCH"}
        argv = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-t", "sdist", "-d", "made"]
        subprocess.run(argv, cwd=folder, env=variables, check=True, capture_output=True)
    finally:
        os.umask(before)
    return {path.name: path.read_bytes() for path in (folder / "made").iterdir()}


def test_wheel_and_sdist_depend_only_on_the_sources(tmp_path: Path) -> None:
    first = build(tmp_path / "a", 0o022, 1_000_000_000)
    second = build(tmp_path / "another" / "place", 0o077, 1_500_000_000)
    assert len(first) == 2
    assert first == second
