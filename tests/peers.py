"""The tools that forge is compared with: colcon, kept in a virtual environment of its own."""

import json
import os
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from tests.conftest import Forge, Ran
from tests.packages import manifest_text

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


ROS = {"ROS_VERSION": "2", "ROS_DISTRO": "humble", "ROS_PYTHON_VERSION": "3"}
CMAKE = """cmake_minimum_required(VERSION 3.16)
project({name} NONE)
{more}
install(FILES package.xml DESTINATION share/{name})
"""


@contextmanager
def colcon_in(home: Path, **variables: str) -> Iterator[Colcon]:
    """Run colcon far from the user's own settings."""
    running = Colcon({**ROS, "HOME": str(home), "COLCON_HOME": str(home), **variables})
    yield running
    running.end()


class Twins:
    """Two copies of a workspace, one for each tool."""

    def __init__(
        self, home: Path, forge: Forge, colcon: Colcon | None = None, variables: Mapping[str, str] = ROS
    ) -> None:
        """Begin with two empty folders; without a colcon, one is started when it is needed."""
        self.roots = self.ours, self.theirs = home / "ours", home / "theirs"
        self.variables = dict(variables)
        self._home = home
        self._forge = forge
        self._colcon = colcon

    def write(self, name: str, text: str = "") -> None:
        """Write a file into both."""
        for root in self.roots:
            path = root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)

    def package(self, name: str, *lines: str, more: str = "", folder: str = "") -> None:
        """Write a plain CMake package into both."""
        home = f"src/{folder or name}"
        self.write(f"{home}/package.xml", manifest_text(name, *lines, build_type="cmake"))
        self.write(f"{home}/CMakeLists.txt", CMAKE.format(name=name, more=more))

    def run(self, *argv: str) -> tuple[Ran, Ran]:
        """Run the same words with both."""
        if self._colcon is None:
            home = str(self._home / "home")
            self._colcon = Colcon({**self.variables, "HOME": home, "COLCON_HOME": home})
        ours = self._forge(*argv, cwd=self.ours, env={**dict.fromkeys(ROS), **self.variables})
        return ours, self._colcon(*argv, cwd=self.theirs)

    def agree(self, *argv: str) -> tuple[Ran, Ran]:
        """Run the same words with both, which end with a code of zero in both or in none."""
        ours, theirs = self.run(*argv)
        assert (ours.code == 0) == (theirs.code == 0), f"{argv}\n{ours}\n{theirs}"
        return ours, theirs

    def end(self) -> None:
        """End colcon."""
        if self._colcon:
            self._colcon.end()
