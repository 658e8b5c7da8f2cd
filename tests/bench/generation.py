"""The interface compiler on one processor, and beside Debian's rosidl on the same definitions.

forge's turns begin with a folder that does not exist, then nothing changes, then one file does; each with the
start of the interpreter. Of these nothing is deleted before all is measured, for the reason in builds.away().
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from tests.bench.commands import forge
from tests.bench.definitions import write_definitions
from tests.bench.figures import Case, Series
from tests.bench.sitting import Sitting
from tests.bench.timing import Taken, Variant

KINDS = ("from nothing", "nothing changed", "one file changed")
ROSIDL = "rosidl"
ROSIDL_PROGRAM = Path(__file__).parent / "programs" / "rosidl.py"
DEBIAN_PYTHON = "/usr/bin/python3"
"""The Python that Debian's packages are for."""

_PACKAGE = "bench_msgs"
_RUNS = {250: 5, 1000: 3, 5000: 2}
_MANY = 100
"""More messages than this take rosidl most of a minute."""


def generation(sitting: Sitting) -> Iterator[Case]:
    """Measure the compiler to Python and C++, then to C and C++ beside rosidl."""
    with one_processor():
        for size in sitting.sizes(50, 250, 1000, 5000):
            yield from _alone(sitting, size)
        if sitting.wants(ROSIDL):
            for size in sitting.sizes(10, 50, 250):
                yield _beside_rosidl(sitting, size)


def _alone(sitting: Sitting, size: int) -> Iterator[Case]:
    source = write_definitions(sitting.new_folder("definitions") / _PACKAGE, size)
    package = Package(source, ("python", "cpp"))
    runs = sitting.runs(_RUNS.get(size, 5))
    for number in range(runs + (runs > 1)):
        package.turn(number, look=number == 0)
    for kind in KINDS:
        taken = package.taken[kind][-runs:]  # the first turn is to warm up, if it is not the only one
        counts = {"files written": package.touched} if kind == KINDS[-1] else {}
        series = Series(
            tuple(1000 * each.seconds for each in taken),
            tuple(1000 * each.worked for each in taken),
            package.taken[kind][0].peak_mb,
        )
        yield Case(f"Python and C++, {kind}", {"forge": series}, size, counts=counts)


def _beside_rosidl(sitting: Sitting, size: int) -> Case:
    """Compare with rosidl, whose three programs run as its CMake code runs them."""
    folder = sitting.new_folder("rosidl")
    source = write_definitions(folder / _PACKAGE, size, others=False)
    prefix = sitting.peers.debian
    words = ("interface", "generate", "--package", _PACKAGE, "--lang", "c", "--lang", "cpp")
    remove = ("rm", "-rf", "out")
    variants = (
        Variant("forge", forge(*words, "--output", "out", str(source)), _made(folder / "forge"), remove),
        Variant(
            ROSIDL,
            (DEBIAN_PYTHON, str(ROSIDL_PROGRAM), str(prefix), str(folder), "out", _PACKAGE),
            _made(folder / "rosidl"),
            remove,
            rosidl_variables(prefix),
        ),
    )
    return sitting.turns_of("C and C++, from nothing", variants, 1 if size > _MANY else 2, size=size)


def rosidl_variables(prefix: Path) -> dict[str, str]:
    """Return the environment in which rosidl's modules and templates are found."""
    return {"PYTHONPATH": f"{prefix}/lib/python3/dist-packages", "AMENT_PREFIX_PATH": str(prefix)}


def _made(folder: Path) -> Path:
    folder.mkdir()
    return folder


@contextmanager
def one_processor() -> Iterator[None]:
    """Keep this process and what it starts on one processor."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


@dataclass(slots=True)
class Package:
    """A generated package, and what its runs took."""

    source: Path
    languages: tuple[str, ...]
    output: Path = field(default_factory=Path)
    taken: dict[str, list[Taken]] = field(default_factory=lambda: {kind: [] for kind in KINDS})
    touched: int = 0
    """How many files the last change wrote."""

    def turn(self, number: int, *, look: bool = False) -> None:
        """Run all three kinds once, into a new folder."""
        self.output = self.source.with_name(f"{self.source.name}-out-{number}")
        first, unchanged, one_changed = KINDS
        self._run(first, look=look)
        self._run(unchanged, look=look)
        changed = max(self.source.glob("msg/*.msg"))
        with changed.open("a", encoding="utf-8") as stream:
            stream.write(f"int32 added_{number}\n")
        before = self._marks()
        self._run(one_changed, look=look)
        after = self._marks()
        self.touched = sum(after[path] != before.get(path) for path in after)

    def _run(self, kind: str, *, look: bool) -> None:
        languages = (word for language in self.languages for word in ("--lang", language))
        words = ("interface", "generate", "--package", _PACKAGE, *languages, "--output", str(self.output))
        variant = Variant(kind, forge(*words, str(self.source)), self.source)
        self.taken[kind].append(variant.run(look=look))

    def _marks(self) -> dict[str, int]:
        """Return the time of each output's last change."""
        paths = (path for path in self.output.rglob("*") if path.is_file() and ".forge" not in path.parts)
        return {path.relative_to(self.output).as_posix(): path.stat().st_mtime_ns for path in paths}
