"""The names of platforms to build for, such as 'aarch64-linux-gnu.2.35'."""

from __future__ import annotations

import os
import re

from forge.base.frozen import frozen
from forge.base.names import nearest

_NAME = re.compile(r"(\w[\w-]*?)(?:\.(\d+\.\d+))?")

TRIPLES = {
    "aarch64": "aarch64-linux-gnu",
    "arm": "arm-linux-gnueabihf",
    "riscv64": "riscv64-linux-gnu",
    "x86_64": "x86_64-linux-gnu",
}
"""The platforms for which forge knows compilers, by processor, with Debian's architecture names."""

_PROCESSORS = {"arm64": "aarch64", "armhf": "arm", "armv7": "arm", "armv7l": "arm", "amd64": "x86_64"}
"""Other names of processors, as in Debian, Docker and `uname -m`."""

_BY_CMAKE = {"arm": "armv7l"}
"""Values of CMAKE_SYSTEM_PROCESSOR, which are those of `uname -m`, if they are not the processor's name."""


@frozen
class Target:
    """A platform; `glibc` is the oldest version of the C library to support, '' for the compiler's own."""

    triple: str
    glibc: str = ""

    @property
    def is_known(self) -> bool:
        """Return whether forge knows compilers for it."""
        return self.triple in TRIPLES.values()

    @property
    def cpu(self) -> str:
        """Return the processor by the name in zig and qemu."""
        return _cpu(self.triple)

    @property
    def cmake_processor(self) -> str:
        return _BY_CMAKE.get(self.cpu, self.cpu)

    @property
    def with_glibc(self) -> str:
        return f"{self.triple}.{self.glibc}" if self.glibc else self.triple

    @property
    def is_host(self) -> bool:
        """Return whether this machine runs its programs without an emulator."""
        return self.cpu == _PROCESSORS.get(os.uname().machine, os.uname().machine)


def parse_target(word: str) -> Target:
    """Return the platform with a name as in Debian, Rust or Docker; raises ValueError for an invalid one.

    An unknown name is kept: a toolchain file may describe it.
    """
    match = _NAME.fullmatch(word)
    if match is None:
        name, dot, version = word.partition(".")
        message = f"'{word}' is not the name of a platform, such as 'aarch64-linux-gnu' or 'arm64'"
        if dot and _NAME.fullmatch(name):
            message = f"'{version}' is not a version of glibc, such as 2.35"
        raise ValueError(message)
    name, glibc = match[1].replace("-unknown-", "-"), match[2] or ""
    triple = TRIPLES.get(_cpu(name))
    is_known = triple is not None and (name == triple or "-" not in name)
    return Target(triple if triple and is_known else name, glibc)


def similar_target(target: Target) -> str | None:
    """Return the known platform that was probably meant by an unknown name, or None."""
    near = nearest(target.cpu, {*TRIPLES, *_PROCESSORS})
    return near and (TRIPLES[_cpu(near)] if "-" in target.triple else near)


def _cpu(name: str) -> str:
    first = name.partition("-")[0]
    return _PROCESSORS.get(first, first)
