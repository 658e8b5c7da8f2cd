"""What sourcing takes: 500 packages, each in its own prefix, beside an empty shell and colcon's script."""

from __future__ import annotations

import shutil
import subprocess
from typing import TYPE_CHECKING

from tests.bench.timing import Variant
from tests.installs import Made, make_install

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tests.bench.scenarios import Peers

SHELLS = {"bash": ("bash", "--norc"), "sh": ("dash",), "zsh": ("zsh", "-f"), "fish": ("fish", "--no-config")}
SITE = "lib/python3.11/site-packages"


def source_500(folder: Path, peers: Peers) -> tuple[Variant, ...]:
    """Measure the sourcing of 500 packages."""
    return source(folder, peers, 500)


def source(folder: Path, peers: Peers, packages: int) -> tuple[Variant, ...]:
    """Measure each shell that there is, alone and sourcing; colcon's script reads the same packages."""
    layout = make_install(folder / "forge", list(_packages(packages)))
    roots = {"forge": layout.install}
    if peers.colcon:
        roots["colcon"] = _written_by_colcon(layout.install, folder / "colcon", peers.colcon)
    variants = []
    for shell, argv in SHELLS.items():
        if shutil.which(argv[0]) is None:
            continue
        variants.append(Variant(f"{shell} alone", (*argv, "-c", "true"), folder))
        for tool, root in roots.items():
            script = root / f"setup.{shell}"
            if script.is_file():
                word = "source" if shell == "fish" else "."
                variants.append(Variant(f"{shell} with {tool}", (*argv, "-c", f"{word} {script}"), folder))
    return tuple(variants)


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


def _written_by_colcon(install: Path, folder: Path, colcon: str) -> Path:
    """Return a copy of the tree with colcon's own scripts at its root."""
    copy = folder / "install"
    shutil.copytree(install, copy, ignore=shutil.ignore_patterns("setup.*", "local_setup.[!d]*"))
    (folder / "src").mkdir()
    subprocess.run([colcon, "--log-base", "/dev/null", "build"], cwd=folder, check=True, capture_output=True)
    return copy


SCENARIOS = {"source-500": source_500}
