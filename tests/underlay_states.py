"""An underlay with two states, and workspaces above it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from tests.evolving import Evolving
from tests.snippets import shell


@dataclass(frozen=True, slots=True)
class Below:
    """What a workspace is built above: the environment that has it, and two states that it may be in."""

    low: Mapping[str, str]
    variables: Mapping[str, str]
    states: tuple[Path, Path]

    def evolving(self, root: Path, *, merged: bool, symlink: bool = False) -> Evolving:
        """Return a workspace above it."""
        workspace = Evolving(root, merged, symlink, low=self.low, underlays=self.states)
        workspace.variables.update(self.variables)
        return workspace


def below(root: Path, low: Mapping[str, str], under: Path, prefix: Path | None = None) -> Below:
    """Build a package twice, with two different texts, into the prefix `under`; move both below `root`."""
    states = (root / "0", root / "1")
    variables: dict[str, str] = {}
    for number, state in enumerate(states):
        for name, text in low.items():
            path = root / "src" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            said = text.format(number) if path.suffix in {".h", ".msg"} else text
            path.write_text(said, encoding="utf-8")
        first = f". {prefix}/setup.sh && " if prefix else ""
        shell(f"{first}forge build --merge-install --install-base {under}", root)
        printed = shell(f". {under}/setup.sh && env -0", root)
        variables = dict(entry.split("=", 1) for entry in printed.split("\0") if "=" in entry)
        under.rename(state)
    found = {n: v for n, v in variables.items() if n == "PYTHONPATH" or n.endswith("PREFIX_PATH")}
    return Below(low, found, states)
