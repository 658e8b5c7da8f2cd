"""What forge's cache of packages brings back, beside building it and beside copying it."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from tests.bench.builds import ament, away
from tests.bench.commands import forge_build
from tests.bench.figures import Case
from tests.bench.sitting import Sitting, run
from tests.bench.timing import Variant
from tests.packages import manifest_text

BUILDING = "building"
COPYING = "cp -r"
START = "a tree of one file"
_CMAKE = """cmake_minimum_required(VERSION 3.22)
project({name} NONE)
install(CODE [[
  foreach(number RANGE 1 {files})
    math(EXPR folder "${{number}} % 100")
    file(WRITE "${{CMAKE_INSTALL_PREFIX}}/share/{name}/${{folder}}/${{number}}.txt" "${{number}} of many")
  endforeach()
]])
"""


def restoring(sitting: Sitting) -> Iterator[Case]:
    """Measure restoring beside building, then beside copying."""
    kind = ament(sitting)
    start = _cached(sitting, START, 1)
    for size in sitting.sizes(10, 30, 100):
        argv = forge_build("--cache", str(sitting.new_folder("cache")))
        cached = replace(kind.tool(sitting, "forge", argv, size), before=away("build", "install"))
        run(cached.argv, cached.cwd, dict(cached.env))
        building = replace(kind.built(sitting, BUILDING, forge_build(), size), before=cached.before)
        yield sitting.turns_of("compiled packages", (cached, building, start), 5, size=size)
    for size in sitting.sizes(1000, 5000, 20_000):
        cached = _cached(sitting, "forge", size)
        copying = Variant(COPYING, ("cp", "-r", "install", "copied"), _built(sitting, size), away("copied"))
        (copying.cwd / "copied").mkdir()
        yield sitting.turns_of("files of one package", (cached, copying, start), 7, size=size)


def _cached(sitting: Sitting, name: str, files: int) -> Variant:
    """Return what restores a package of so many files."""
    root = sitting.new_folder("restored")
    _write(root, files)
    argv = forge_build("--cache", str(sitting.new_folder("cache")))
    run(argv, root)
    return Variant(name, argv, root, away("build", "install"))


def _built(sitting: Sitting, files: int) -> Path:
    root = sitting.new_folder("copied")
    _write(root, files)
    run(forge_build(), root)
    return root


def _write(root: Path, files: int) -> None:
    """Write a package that installs many files and has few."""
    folder = root / "src" / "many"
    folder.mkdir(parents=True)
    (folder / "package.xml").write_text(manifest_text("many", build_type="cmake"), encoding="utf-8")
    text = _CMAKE.format(name="many", files=files)
    (folder / "CMakeLists.txt").write_text(text, encoding="utf-8")
