"""The tools that forge is compared with: colcon, kept in a virtual environment of its own."""

import json
import os
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

from tests.conftest import Ran

DRIVER = Path(__file__).parent / "data" / "colcon_driver.py"


class Colcon:
    """colcon, started once and asked often: its own start takes half a second."""

    def __init__(self, variables: Mapping[str, str]) -> None:
        """Start it with exactly these variables and the PATH of ours."""
        script = Path(shutil.which("colcon") or "colcon")
        with script.open(encoding="utf-8", errors="replace") as stream:
            self.python = stream.readline().removeprefix("#!").strip()
        self._process = subprocess.Popen(
            [self.python, str(DRIVER)],
            env={"PATH": os.environ["PATH"], **variables},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __call__(self, *argv: str, cwd: Path) -> Ran:
        """Run a command line; returns its exit code and what it printed."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps({"argv": argv, "cwd": str(cwd)}) + "\n")
        self._process.stdin.flush()
        return Ran(**json.loads(self._process.stdout.readline()))

    def end(self) -> None:
        """Let it go, once all has been asked."""
        self._process.communicate()
