"""zig as the C and C++ compiler for a target: it includes headers and libraries for all targets."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from forge.base.env_vars import own_cache
from forge.base.errors import HostError, Problem
from forge.base.files import write_if_changed
from forge.base.frozen import frozen
from forge.base.layout import OWN_CACHE_DIR, Layout
from forge.base.own_environment import extra_command
from forge.base.templating import render
from forge.plugins.cross.targets import Target
from forge.toolchain.programs import find_program
from forge.toolchain.resources import processors

_COMPILERS = frozenset({"cc", "c++"})
_VARIABLES = {"CC": "cc", "CXX": "c++", "AR": "ar", "RANLIB": "ranlib"}

_LIB_DIR = re.compile(r'"?\.?lib_dir"?\s*[:=]\s*"([^"]+)"')
_OTHER_PLATFORMS = re.compile(r"/(pstl|support/(win32|ibm))/")
_REPLACED = frozenset({"cxa_noexception.cpp", "libcxx/src/new.cpp"})
"""Sources for other configurations; those of libc++abi define operator new."""
_INCLUDED = ("libcxx/src", "libcxxabi/include", "libcxx/libc", "")
_FLAGS = (
    *("-std=c++23", "-O2", "-g0", "-w", "-fPIC", "-fexperimental-library", "-DNDEBUG"),
    *("-D_LIBCPP_BUILDING_LIBRARY", "-D_LIBCXXABI_BUILDING_LIBRARY", "-DLIBCXX_BUILDING_LIBCXXABI"),
    *("-DLIBCXXABI_USE_LLVM_UNWINDER", "-DHAVE___CXA_THREAD_ATEXIT_IMPL"),
)


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
        for tool in _VARIABLES.values():
            flags = self.flags if tool in _COMPILERS else ()
            text = render(
                "cross/templates/compiler.sh.j2",
                tool=tool,
                target=self.target.with_glibc,
                cache=shlex.quote(str(self.cache)),
                zig=shlex.quote(str(self.program)),
                flags=[shlex.quote(flag) for flag in flags],
                library=shlex.quote(str(self.library)) if tool == "c++" else "",
            )
            write_if_changed(folder / tool, text, mode=0o755)

    def compilers(self, folder: Path) -> dict[str, str]:
        return {variable: str(folder / tool) for variable, tool in _VARIABLES.items()}

    @property
    def library(self) -> Path:
        status = self.program.stat()
        key = f"{self.program.resolve()} {status.st_size} {status.st_mtime_ns} {' '.join(self.flags)}"
        return self.cache / "forge" / hashlib.sha256(key.encode()).hexdigest()[:16] / "libc++.a"

    def glibc_warnings(self) -> tuple[Problem, ...]:
        """Return zig's message about an unsupported version of glibc, which build tools hide."""
        if not self.target.glibc:
            return ()
        argv = (str(self.program), "cc", *self.flags, "-x", "c", "-", "-o", os.devnull)
        environment = {**os.environ, "ZIG_GLOBAL_CACHE_DIR": str(self.cache)}
        result = subprocess.run(
            argv, input=b"int main(void) { return 0; }\n", capture_output=True, env=environment, check=False
        )
        lines = result.stderr.decode(errors="replace").splitlines()
        messages = (line.partition("warning:")[2].strip() for line in lines if "glibc" in line)
        return tuple(Problem(f"zig: {text}") for text in dict.fromkeys(filter(None, messages)))

    def compile_library(self, folder: Path) -> tuple[Problem, ...]:
        """Compile the C++ library for the target unless that was done before; return a warning on failure."""
        if self.library.exists():
            return ()
        print(
            f"zig compiles its C++ library for {self.target.with_glibc}, once for this machine: "
            "this takes a few minutes",
            file=sys.stderr,
            flush=True,
        )
        failure = _compile_cxx_library(self.program, folder, self.library)
        if not failure:
            return ()
        message = (
            f"cannot compile the C++ library of this version of zig: {failure.strip().partition(chr(10))[0]}"
        )
        hint = (
            "exceptions of the standard library are not caught outside of the shared library that throws them"
        )
        return (Problem(message, hint=hint),)


def find_zig(target: Target, layout: Layout, variables: Mapping[str, str]) -> Zig:
    """Return zig from its wheel, else from PATH; raises HostError if there is none."""
    wheel = importlib.util.find_spec("ziglang")
    folders = (wheel and wheel.submodule_search_locations) or ()
    bundled = (Path(folder, "zig") for folder in folders)
    program = next((path for path in bundled if path.is_file()), None) or find_program("zig", variables)
    if program is None:
        hint = (
            f"install zig beside forge, `{extra_command('cross')}`, or describe a cross compiler in a "
            "'--toolchain-file'"
        )
        raise HostError(Problem(f"no compiler for '{target.triple}' found", hint=hint))
    return Zig(program, target, (own_cache(variables) or layout.build / OWN_CACHE_DIR) / "zig")


def _compile_cxx_library(zig: Path, compilers: Path, archive: Path) -> str:
    """Compile the library with the compilers in a folder; return '', or the output of the failed command.

    zig hides all symbols of the copy that it links into each library and program. Then an exception thrown by
    one of them has another type than the one that another catches, and each has its own `std::cout`. With
    visible symbols, the dynamic linker of the target uses one copy for all of them, as it does for GCC's
    library.
    """
    result = subprocess.run((zig, "env"), capture_output=True, text=True, check=False)
    match = _LIB_DIR.search(result.stdout)
    if match is None:
        return result.stdout + result.stderr
    home = Path(match[1])
    archive.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=archive.parent) as scratch:
        objects = [(source, Path(scratch, f"{number}.o")) for number, source in enumerate(_sources(home))]
        compiler = (str(compilers / "c++"), *_FLAGS, *(f"-I{home / folder}" for folder in _INCLUDED))
        commands = [(*compiler, "-c", str(source), "-o", str(output)) for source, output in objects]
        draft = Path(scratch, archive.name)
        packed = (str(compilers / "ar"), "qcs", str(draft), *(str(output) for _, output in objects))
        failure = _run_all(commands) or _run(packed)
        if not failure:
            draft.replace(archive)
    return failure


def _sources(home: Path) -> Iterator[Path]:
    for folder in ("libcxx/src", "libcxxabi/src"):
        for path in sorted(home.joinpath(folder).rglob("*.cpp")):
            name = path.relative_to(home).as_posix()
            if not (_OTHER_PLATFORMS.search(name) or path.name in _REPLACED or name in _REPLACED):
                yield path


def _run_all(commands: Sequence[tuple[str, ...]]) -> str:
    """Run the commands in parallel; return the output of the first that fails, '' if all succeed."""
    pool = ThreadPoolExecutor(processors())
    try:
        return next(filter(None, pool.map(_run, commands)), "")
    finally:
        pool.shutdown(cancel_futures=True)


def _run(argv: tuple[str, ...]) -> str:
    result = subprocess.run(argv, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    return "" if result.returncode == 0 else result.stderr or f"exit code {result.returncode}"
