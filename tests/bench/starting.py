"""What answers at once: the start, the list of packages, the completion of a command line."""

from collections.abc import Iterator
from pathlib import Path

from tests.bench.commands import COLCON, colcon, forge, python
from tests.bench.figures import Case
from tests.bench.sitting import Sitting, printed
from tests.bench.timing import Variant
from tests.bench.workspaces import write_workspace

COLCON_COMMON = "colcon-common-extensions"
_PLAIN = "a bare Python"
_RUNS = 21
_PRESS = """\
COMP_WORDS=(forge build --packages-select bench_0) COMP_CWORD=3; _forge; [ ${#COMPREPLY[@]} -gt 0 ]"""


def start_up(sitting: Sitting) -> Iterator[Case]:
    """Measure how long a tool takes to say what it can do, beside a bare interpreter."""
    folder = sitting.new_folder("start")
    variants = [Variant("forge", forge("--help"), folder), _bare(folder)]
    if sitting.wants(COLCON_COMMON):
        variants.append(Variant(COLCON, (sitting.peers.colcon, "--help"), folder))
    yield sitting.turns_of("--help", variants, _RUNS)


def listing(sitting: Sitting) -> Iterator[Case]:
    """Measure the listing of packages of 20 files each."""
    for size in sitting.sizes(10, 100, 1000):
        root = plain_sources(sitting, size)
        variants = [Variant("forge", forge("list"), root), _bare(root)]
        if sitting.wants(COLCON_COMMON):
            variants.append(Variant(COLCON, colcon(sitting.peers, "list"), root))
        yield sitting.turns_of("list", variants, 11, size=size)


def completion(sitting: Sitting) -> Iterator[Case]:
    """Measure a press of the key for a package's name in bash.

    The script is sourced beforehand in life, and here in the variant to compare with.
    """
    for size in sitting.sizes(10, 100, 300, 1000):
        root = plain_sources(sitting, size)
        folder = sitting.new_folder("completion")
        script = folder / "completion.bash"
        script.write_text(printed(forge("completion", "bash"), root), encoding="utf-8")
        cache = {"XDG_CACHE_HOME": str(folder / "cache")}
        shell = ("bash", "--norc", "-c")
        variants = (
            Variant("forge", (*shell, f". {script}; {_PRESS}"), root, env=cache),
            Variant("the script alone", (*shell, f". {script}"), root, env=cache),
        )
        yield sitting.turns_of("a package's name", variants, 11, size=size)


def plain_sources(sitting: Sitting, size: int) -> Path:
    """Return a workspace of plain packages of 20 files each that is never built."""
    return sitting.made(f"plain_sources_{size}", lambda root: _written(root, size))


def _written(root: Path, size: int) -> None:
    write_workspace(root, size)


def _bare(folder: Path) -> Variant:
    return Variant(_PLAIN, python("pass"), folder)
