"""What every scenario is given: a folder, the peers, how thorough to be, workspaces built once."""

import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.bench.figures import Case
from tests.bench.peers import Peers
from tests.bench.timing import Variant, compare

QUICK_SIZE = 2


@dataclass(slots=True)
class Sitting:
    """One run of the bench. Quick: one turn each and one tiny size, to see that everything runs."""

    folder: Path
    peers: Peers
    quick: bool = False
    turns: int | None = None
    """What the command line says; each case has its own number otherwise."""
    missing: list[str] = field(default_factory=list)
    """What the scenario at hand wanted and did not find."""
    _made: dict[str, Path] = field(default_factory=dict)
    _folders: int = 0

    def sizes(self, *sizes: int) -> tuple[int, ...]:
        """Return the sizes to measure."""
        return (QUICK_SIZE,) if self.quick else sizes

    def size(self, size: int) -> int:
        """Return the one size to measure."""
        return QUICK_SIZE if self.quick else size

    def runs(self, runs: int) -> int:
        """Return how many turns a case gets."""
        return 1 if self.quick else self.turns or runs

    def new_folder(self, word: str) -> Path:
        """Return a folder that nobody else has."""
        self._folders += 1
        folder = self.folder / f"{self._folders:03}_{word}"
        folder.mkdir(parents=True)
        return folder

    def made(self, key: str, make: Callable[[Path], None]) -> Path:
        """Return a folder that `make` filled, now or for an earlier scenario."""
        if key not in self._made:
            folder = self.new_folder(key)
            make(folder)
            self._made[key] = folder
        return self._made[key]

    def wants(self, peer: str) -> bool:
        """Tell if a peer is there; what is not is told in the results."""
        if self.peers.has(peer):
            return True
        if peer not in self.missing:
            self.missing.append(peer)
        return False

    def turns_of(self, name: str, variants: Sequence[Variant], runs: int, *, size: int | None = None) -> Case:
        """Let variants take turns and return the case."""
        return Case(name, compare(variants, self.runs(runs)), size)


def run(argv: Sequence[str], cwd: Path, env: dict[str, str] | None = None) -> None:
    """Run what prepares a measurement; raises CalledProcessError with its output when it fails."""
    Variant("", tuple(argv), cwd, env=env or {}).run()


def printed(argv: Sequence[str], cwd: Path, env: dict[str, str] | None = None) -> str:
    """Return what a program prints."""
    return subprocess.run(argv, cwd=cwd, env=env, check=True, capture_output=True, text=True).stdout
