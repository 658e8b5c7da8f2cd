"""Packages of interfaces: built from nothing, and after a change of one message."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from tests.bench import workspaces
from tests.bench.builds import ANEW, Kind, debian, tools, underlay
from tests.bench.commands import COLCON, colcon, forge_build
from tests.bench.figures import Case
from tests.bench.generation import ROSIDL
from tests.bench.sitting import Sitting
from tests.bench.starting import COLCON_COMMON
from tests.bench.timing import Variant

FROM_NOTHING = "forge from nothing"
_CHANGE = "for f in src/bench_0000/msg/*.msg; do echo int32 changed_$(date +%s%N) >> $f; break; done"
_COMMENT = 'for f in src/bench_0000/msg/*.msg; do sed -i "1i # $(date +%s%N)" $f; break; done'
_NEEDS = ("rosidl_default_generators", "ament_cmake", "std_msgs", "geometry_msgs", "builtin_interfaces")


def one_interface(sitting: Sitting) -> Iterator[Case]:
    """Measure builds after a change of one message that nobody needs."""
    kind = _embedded(sitting)
    for size in sitting.sizes(1, 5, 20):
        argvs = tools(sitting, COLCON)
        built = [kind.built(sitting, name, argv, size) for name, argv in argvs.items()]
        yield sitting.turns_of("one .msg, forge's generators", _changing(built), 5, size=size)
    if sitting.wants(ROSIDL) and sitting.wants(COLCON_COMMON):
        built = _beside_rosidl(sitting, built=True)
        yield sitting.turns_of("one .msg of 20, rosidl's", _changing(built), 5)


def large_interfaces(sitting: Sitting) -> Iterator[Case]:
    """Measure builds of one large package after a change of one message, and from nothing."""
    variables = underlay(sitting, *_NEEDS)
    for messages in sitting.sizes(300, 600, 1200):

        def write(root: Path, packages: int, messages: int = messages) -> Path:
            return workspaces.write_interface_workspace(root, packages, messages)

        kind = Kind(f"{messages}_interfaces", write, variables)
        again = kind.built(sitting, "forge", forge_build(), 1)
        anew = replace(kind.tool(sitting, FROM_NOTHING, forge_build(), 1), before=ANEW)
        for name, change in (("one comment", _COMMENT), ("one field", _CHANGE)):
            changing = replace(again, before=("sh", "-c", change))
            yield sitting.turns_of(name, [changing, anew], 3, size=messages)


def cold_interfaces(sitting: Sitting) -> Iterator[Case]:
    """Measure builds of packages of interfaces from nothing."""
    kind = _embedded(sitting)
    for size in sitting.sizes(1, 5, 20):
        variants = [kind.tool(sitting, name, argv, size) for name, argv in tools(sitting, COLCON).items()]
        removing = [replace(each, before=ANEW) for each in variants]
        yield sitting.turns_of("packages of 5 messages", removing, 2, size=size)
    if sitting.wants(ROSIDL) and sitting.wants(COLCON_COMMON):
        removing = [replace(each, before=ANEW) for each in _beside_rosidl(sitting, built=False)]
        yield sitting.turns_of("a package of 20 messages, rosidl's", removing, 3)


def _embedded(sitting: Sitting) -> Kind:
    """Return packages for which both tools start forge's generators, installed beforehand."""
    return Kind("interfaces", workspaces.write_interface_workspace, underlay(sitting, *_NEEDS))


def _beside_rosidl(sitting: Sitting, *, built: bool) -> list[Variant]:
    """Return forge with its own generators, and both tools with Debian's rosidl, on the same definitions."""
    found = []
    for name, argv, real in (
        ("forge", forge_build(), False),
        ("forge with rosidl", forge_build(), True),
        ("colcon with rosidl", colcon(sitting.peers, "build"), True),
    ):
        # forge tells CMake which interpreter it has chosen; for colcon CMake finds another one.
        arguments = () if argv == forge_build() else ("--cmake-args", "-DPython3_EXECUTABLE=/usr/bin/python3")
        kind = _of_20(sitting, arguments, real=real)
        make = kind.built if built else kind.tool
        found.append(make(sitting, name, argv, 1))
    return found


def _of_20(sitting: Sitting, arguments: tuple[str, ...], *, real: bool) -> Kind:
    generators = workspaces.DEBIANS_GENERATORS if real else workspaces.EVERY_GENERATOR
    messages = sitting.size(20)

    def write(root: Path, packages: int) -> Path:
        return workspaces.write_interface_workspace(
            root, packages, messages, generators=generators, referring=False
        )

    if real:
        return Kind("interfaces_by_rosidl", write, debian(sitting), arguments)
    return Kind("interfaces_of_20", write, underlay(sitting, *_NEEDS))


def _changing(variants: list[Variant]) -> list[Variant]:
    return [replace(variant, before=("sh", "-c", _CHANGE)) for variant in variants]
