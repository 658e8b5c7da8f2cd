"""Builds beside colcon's: nothing to do, one line changed, everything from nothing.

Each tool has a copy of each workspace, built once and shared by all scenarios. Packages of ament are built
by both on one and the same ament: the embedded one, which forge installs into an underlay beforehand, or
Debian's.
"""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from tests.bench import workspaces
from tests.bench.commands import COLCON, GENERATORS, colcon, forge_build
from tests.bench.figures import Case
from tests.bench.sitting import Sitting, printed, run
from tests.bench.starting import COLCON_COMMON
from tests.bench.timing import Variant
from tests.packages import manifest_text

COMPILERS = "compilers alone"
CCACHE = "ccache"
MANY = 100
"""Packages that colcon takes most of a minute to build."""

_LAUNCHER = "-DCMAKE_CXX_COMPILER_LAUNCHER=ccache"
_CHANGE = "echo 'int changed_'$(date +%s%N)';' >> {path}"
_CHANGE_BODY = 'sed -i "s/return a + [0-9]* \\* b/return a + $(date +1%N | cut -c1-9) * b/" {path}'
"""Other code in the same functions: what is linked with it is not compiled again."""
_COMPILE = "ls -d build/bench_* | xargs -n 1 -P {jobs} ninja -C"
_CLEAN = "for folder in build/bench_*; do ninja -C $folder clean; done"


def away(*folders: str) -> tuple[str, ...]:
    """Return what moves folders out of a workspace's sight before a turn.

    They are not deleted: for minutes ext4 passes over freed inodes one by one whenever a file is made, which
    then takes up to ten times as long, whoever makes it.
    """
    script = (
        'gone=$(mktemp -d gone.XXXXXX) && touch "$gone/COLCON_IGNORE" && for each in {}; do '
        '[ ! -e "$each" ] || mv "$each" "$gone" || exit; done'
    )
    return ("sh", "-c", script.replace("{}", " ".join(folders)))


ANEW = away("build", "install", "log")


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of workspace: how it is written, and what the environment of its builds says."""

    word: str
    write: Callable[[Path, int], Path]
    variables: Mapping[str, str] = field(default_factory=dict)
    arguments: tuple[str, ...] = ()
    """What all tools are given alike."""

    def tool(self, sitting: Sitting, name: str, argv: tuple[str, ...], size: int) -> Variant:
        """Return a tool in a workspace of its own, which nobody has built."""
        root = sitting.new_folder(f"{self.word}_{size}")
        self.write(root, size)
        return Variant(name, (*argv, *self.arguments), root, env=self.variables)

    def built(self, sitting: Sitting, name: str, argv: tuple[str, ...], size: int) -> Variant:
        """Return a tool in a workspace that it has built, for this scenario or an earlier one."""
        made = Variant(name, (*argv, *self.arguments), sitting.folder, env=self.variables)

        def make(root: Path) -> None:
            self.write(root, size)
            replace(made, cwd=root).run()

        word = "".join(letter if letter.isalnum() else "_" for letter in name)
        return replace(made, cwd=sitting.made(f"{self.word}_{size}_by_{word}", make))


def tools(sitting: Sitting, *generators: str) -> dict[str, tuple[str, ...]]:
    """Return the command line of each tool that builds."""
    found = {"forge": forge_build()}
    if sitting.wants(COLCON_COMMON):
        chosen = {name: words for name, words in GENERATORS.items() if name in (generators or GENERATORS)}
        found |= {name: (*colcon(sitting.peers, "build"), *words) for name, words in chosen.items()}
    return found


PLAIN = Kind("plain", workspaces.write_workspace)
PYTHON = Kind("python", workspaces.write_python_workspace)


def ament(sitting: Sitting) -> Kind:
    """Return packages of ament on the embedded one."""
    return Kind("ament", workspaces.write_ament_workspace, underlay(sitting, "ament_cmake"))


def linked(sitting: Sitting) -> Kind:
    """Return packages of ament of which all link the library of the first."""
    return Kind("linked", workspaces.write_linked_workspace, underlay(sitting, "ament_cmake"))


def debian_ament(sitting: Sitting) -> Kind:
    """Return packages of ament on Debian's."""
    arguments = ("--cmake-args", "-DPython3_EXECUTABLE=/usr/bin/python3")
    return Kind("debian_ament", workspaces.write_ament_workspace, debian(sitting), arguments)


def debian(sitting: Sitting) -> dict[str, str]:
    """Return the environment in which Debian's ament and rosidl are found."""
    prefix = sitting.peers.debian
    modules = os.pathsep.join(
        filter(None, (f"{prefix}/lib/python3/dist-packages", os.environ.get("PYTHONPATH")))
    )
    return {"AMENT_PREFIX_PATH": str(prefix), "CMAKE_PREFIX_PATH": str(prefix), "PYTHONPATH": modules}


def underlay(sitting: Sitting, *needs: str) -> dict[str, str]:
    """Let forge install what it embeds and return the environment of who sourced that."""

    def make(root: Path) -> None:
        package = root / "src" / "wants"
        package.mkdir(parents=True)
        depends = "".join(f"<depend>{need}</depend>" for need in needs)
        manifest = manifest_text("wants", depends, build_type="cmake")
        (package / "package.xml").write_text(manifest, encoding="utf-8")
        (package / "CMakeLists.txt").write_text(
            "cmake_minimum_required(VERSION 3.18)\nproject(wants NONE)\n", encoding="utf-8"
        )
        run(forge_build("--merge-install"), root)

    root = sitting.made(f"underlay_{'_'.join(needs)}", make)
    script = '. install/setup.sh && env -0 | grep -z "_PATH=\\|^PYTHONPATH=" | tr "\\0" "\\n"'
    said = printed(("sh", "-c", script), root, dict(os.environ))
    return dict(entry.split("=", 1) for entry in said.splitlines() if entry)


def _turns(size: int) -> int:
    """Return how many turns builds of so many packages get."""
    return 3 if size >= MANY else 5


def _affordable(sitting: Sitting, size: int) -> dict[str, tuple[str, ...]]:
    """Return the tools to measure: of many packages colcon with its default generator alone."""
    return tools(sitting, COLCON) if size >= MANY else tools(sitting)


def no_op(sitting: Sitting) -> Iterator[Case]:
    """Measure builds in which nothing changed."""
    for size in sitting.sizes(1, 10, 100):
        yield _nothing(sitting, PLAIN, "plain CMake", size, tools(sitting))
    if not sitting.quick:
        yield _nothing(sitting, PLAIN, "plain CMake", 1000, {"forge": forge_build("--merge-install")})
    for size in sitting.sizes(1, 10, 100):
        yield _nothing(sitting, ament(sitting), "ament_cmake, embedded", size, _affordable(sitting, size))
    if sitting.wants("ament"):
        size = sitting.size(100)
        yield _nothing(sitting, debian_ament(sitting), "ament_cmake, Debian's", size, tools(sitting, COLCON))
    for size in sitting.sizes(1, 5, 15):
        yield _nothing(sitting, PYTHON, "ament_python", size, tools(sitting, COLCON))


def _nothing(
    sitting: Sitting, kind: Kind, name: str, size: int, argvs: Mapping[str, tuple[str, ...]]
) -> Case:
    variants = [kind.built(sitting, tool, argv, size) for tool, argv in argvs.items()]
    return sitting.turns_of(name, variants, _turns(size), size=size)


def one_line(sitting: Sitting) -> Iterator[Case]:
    """Measure builds after a change of one .cpp: of a leaf, beside ninja alone; and what all others link."""
    kind = ament(sitting)
    for size in sitting.sizes(1, 10, 100):
        built = [kind.built(sitting, name, argv, size) for name, argv in _affordable(sitting, size).items()]
        alone = kind.built(sitting, "ninja alone", forge_build(), size)
        leaf = f"bench_{size - 1:04}"
        alone = replace(alone, argv=("ninja", "-C", f"build/{leaf}"))
        change = ("sh", "-c", _CHANGE.format(path=f"src/{leaf}/src/main.cpp"))
        variants = [replace(variant, before=change) for variant in (*built, alone)]
        yield sitting.turns_of("one .cpp of a leaf", variants, _turns(size), size=size)
    size = sitting.size(MANY)
    kind = linked(sitting)
    built = [kind.built(sitting, name, argv, size) for name, argv in tools(sitting, COLCON).items()]
    change = ("sh", "-c", _CHANGE_BODY.format(path="src/bench_0000/src/library.cpp"))
    variants = [replace(variant, before=change) for variant in built]
    yield sitting.turns_of("one .cpp of the library that all link", variants, _turns(size), size=size)


def cold(sitting: Sitting) -> Iterator[Case]:
    """Measure builds from nothing, and what of that the compilers take alone."""
    kind = ament(sitting)
    for size in sitting.sizes(1, 10, 100):
        variants = [
            replace(kind.tool(sitting, name, argv, size), before=ANEW)
            for name, argv in tools(sitting).items()
        ]
        built = kind.built(sitting, COMPILERS, forge_build(), size)
        jobs = len(os.sched_getaffinity(0))
        alone = replace(built, argv=("sh", "-c", _COMPILE.format(jobs=jobs)), before=("sh", "-c", _CLEAN))
        yield sitting.turns_of("ament_cmake", [*variants, alone], 2 if size >= MANY else 3, size=size)
    for size in sitting.sizes(1, 5, 10):
        yield _from_nothing(sitting, PYTHON, "ament_python", size, tools(sitting, COLCON))


def _from_nothing(
    sitting: Sitting, kind: Kind, name: str, size: int, argvs: Mapping[str, Sequence[str]]
) -> Case:
    variants = [
        replace(kind.tool(sitting, tool, tuple(argv), size), before=ANEW) for tool, argv in argvs.items()
    ]
    return sitting.turns_of(name, variants, 3, size=size)


def shapes(sitting: Sitting) -> Iterator[Case]:
    """Measure the same number of packages as a star, as a chain and as people's are."""
    size = sitting.size(20)
    for shape in workspaces.SHAPES:

        def write(root: Path, packages: int, shape: str = shape) -> Path:
            return workspaces.write_workspace(root, packages, shape=shape)

        kind = Kind(f"plain_{shape}", write)
        argvs = tools(sitting, COLCON)
        yield replace(_from_nothing(sitting, kind, f"{shape}, from nothing", size, argvs), size=size)
        yield _nothing(sitting, kind, f"{shape}, nothing changed", size, argvs)


def warm_ccache(sitting: Sitting) -> Iterator[Case]:
    """Measure builds from nothing whose objects a compiler cache has, beside forge's without it."""
    if not sitting.wants(CCACHE):
        return
    kind = ament(sitting)
    for size in sitting.sizes(3, 10, 20):
        argvs = {
            "forge": forge_build("--compiler-launcher", "ccache"),
            "forge, no ccache": forge_build(),
        }
        for name, argv in tools(sitting).items():
            if name != "forge":
                words = argv if "--cmake-args" in argv else (*argv, "--cmake-args")
                argvs[name] = (*words, _LAUNCHER)
        variants = []
        for name, argv in argvs.items():
            own = {**kind.variables, "CCACHE_DIR": str(sitting.new_folder("ccache"))}
            variant = replace(kind.tool(sitting, name, argv, size), before=ANEW, env=own)
            variant.run()  # fills the cache
            variants.append(variant)
        yield sitting.turns_of("ament_cmake, warm ccache", variants, 3, size=size)
