"""zig as the C and C++ compiler for a target: it brings headers and libraries for all of them."""

from __future__ import annotations

import hashlib
import importlib.util
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.env_vars import own_cache
from forge.base.errors import EnvironmentFault, Problem
from forge.base.files import replace_file, write_if_changed
from forge.base.frozen import frozen
from forge.base.layout import OWN_CACHE_DIR
from forge.base.templating import render
from forge.toolchain.programs import find_program

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.base.layout import Layout
    from forge.toolchain.cross.targets import Target

_TOOLS = {"cc": "cc", "c++": "c++", "ar": "ar", "ranlib": "ranlib"}
_COMPILERS = frozenset({"cc", "c++"})
_VARIABLES = {"CC": "cc", "CXX": "c++", "AR": "ar", "RANLIB": "ranlib"}

# What a first program needs: the C library, zig's own runtime, and the C++ library.
_PROGRAM = "#include <iostream>\nint main() { std::cout << 1; }\n"


@frozen
class Zig:
    """The program, its target, and the cache of the libraries that it has compiled."""

    program: Path
    target: Target
    cache: Path

    @property
    def flags(self) -> tuple[str, ...]:
        """Return the flags of both compilers.

        Without an optimization level, zig adds checks for undefined behavior that end the program; no other
        compiler does.
        """
        return ("-target", self.target.with_glibc, "-fno-sanitize=undefined")

    def write_compilers(self, folder: Path) -> None:
        """Write a script for each program that build tools call by a path."""
        for name, tool in _TOOLS.items():
            flags = self.flags if tool in _COMPILERS else ()
            text = render(
                "cross/compiler.sh.j2",
                tool=tool,
                target=self.target.with_glibc,
                cache=shlex.quote(str(self.cache)),
                zig=shlex.quote(str(self.program)),
                flags=[shlex.quote(flag) for flag in flags],
            )
            write_if_changed(folder / name, text, mode=0o755)

    def compilers(self, folder: Path) -> dict[str, str]:
        """Return the variables that name the compilers."""
        return {variable: str(folder / name) for variable, name in _VARIABLES.items()}

    def compile_libraries(self, folder: Path) -> None:
        """Let zig compile its C++ library for the target, unless it has done so: it takes minutes."""
        status = self.program.stat()
        key = f"{self.program.resolve()} {status.st_size} {status.st_mtime_ns} {self.target.with_glibc}"
        done = self.cache / f"forge_{hashlib.sha256(key.encode()).hexdigest()[:16]}"
        if done.exists():
            return
        print(  # noqa: T201  (the reader wonders why nothing happens)
            f"zig compiles its C++ library for {self.target.with_glibc}, once for this machine: "
            "this takes a few minutes",
            file=sys.stderr,
            flush=True,
        )
        with tempfile.TemporaryDirectory() as scratch:
            source = Path(scratch, "program.cpp")
            source.write_text(_PROGRAM, encoding="utf-8")
            argv = (str(folder / "c++"), str(source), "-o", str(Path(scratch, "program")))
            compiled = subprocess.run(argv, capture_output=True, text=True, check=False)
        # Packages report errors better: they fail with the same one, in a step that can be repeated.
        if compiled.returncode == 0:
            replace_file(done, b"")


def find_zig(target: Target, layout: Layout, variables: Mapping[str, str]) -> Zig:
    """Return zig from its wheel, else from PATH; raises EnvironmentFault if there is none."""
    wheel = importlib.util.find_spec("ziglang")
    folders = (wheel and wheel.submodule_search_locations) or ()
    beside = (Path(folder, "zig") for folder in folders)
    program = next((path for path in beside if path.is_file()), None) or find_program("zig", variables)
    if program is None:
        hint = (
            "install zig with forge, `pip install 'ros-forge[cross]'`, or describe a cross compiler in a "
            "'--toolchain-file'"
        )
        raise EnvironmentFault(Problem(f"no compiler for '{target.triple}' found", hint=hint))
    return Zig(program, target, (own_cache(variables) or layout.build / OWN_CACHE_DIR) / "zig")
