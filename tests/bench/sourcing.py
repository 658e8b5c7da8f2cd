"""What sourcing takes: packages, each in its own prefix, beside an empty shell and colcon's script."""

import shutil
from collections.abc import Iterator
from pathlib import Path

from tests.bench.commands import COLCON, colcon
from tests.bench.figures import Case
from tests.bench.sitting import Sitting, run
from tests.bench.starting import COLCON_COMMON
from tests.bench.timing import Variant
from tests.installs import Made, make_install

SHELLS = {"bash": ("bash", "--norc"), "sh": ("dash",), "zsh": ("zsh", "-f"), "fish": ("fish", "--no-config")}
EMPTY = "an empty shell"
SITE = "lib/python3.11/site-packages"


def sourcing(sitting: Sitting) -> Iterator[Case]:
    """Measure each shell that there is; colcon's script reads the same packages, and it has none for fish."""
    for size in sitting.sizes(10, 100, 500):
        folder = sitting.new_folder("sourced")
        roots = {"forge": make_install(folder / "forge", list(_packages(size))).install}
        if sitting.wants(COLCON_COMMON):
            roots[COLCON] = _written_by_colcon(sitting, roots["forge"], folder / "colcon")
        for shell, argv in SHELLS.items():
            if shutil.which(argv[0]):
                yield _case(sitting, shell, roots, size)


def _case(sitting: Sitting, shell: str, roots: dict[str, Path], size: int) -> Case:
    argv, word = (*SHELLS[shell], "-c"), "source" if shell == "fish" else "."
    scripts = {tool: root / f"setup.{shell}" for tool, root in roots.items()}
    variants = [
        Variant(tool, (*argv, f"{word} {script}"), script.parent)
        for tool, script in scripts.items()
        if script.is_file()
    ]
    empty = Variant(EMPTY, (*argv, "true"), sitting.folder)
    return sitting.turns_of(shell, [*variants, empty], 11, size=size)


def _packages(count: int) -> Iterator[Made]:
    """Yield packages of two kinds, with programs, libraries and modules, each needing the one before."""
    for number in range(count):
        name = f"bench_{number:03}"
        kind = "ament_python" if number % 3 == 0 else "ament_cmake"
        needs = (f"bench_{number - 1:03}",) if number % 7 else ()
        files = {
            f"bin/{name}": "",
            f"lib/lib{name}.so": "",
            f"{SITE}/{name}.py": "",
            f"share/{name}/cmake/{name}Config.cmake": "",
            f"share/{name}/local_setup.dsv": "prepend-non-duplicate;AMENT_PREFIX_PATH;\n",
        }
        yield Made(name, needs, kind, files)


def _written_by_colcon(sitting: Sitting, install: Path, folder: Path) -> Path:
    """Return a copy of the tree with colcon's own scripts at its root."""
    copy = folder / "install"
    shutil.copytree(install, copy, ignore=shutil.ignore_patterns("setup.*", "local_setup.[!d]*"))
    (folder / "src").mkdir()
    run(colcon(sitting.peers, "build"), folder)
    return copy
