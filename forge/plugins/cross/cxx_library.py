"""Compiles zig's C++ library so that the libraries and programs of a process share it.

zig hides all symbols of the copy that it links into each library and program. An exception that one of them
throws then has another type than the one that another catches, and each has its own `std::cout`. With visible
symbols, the dynamic linker of the target uses one copy for all of them, as it does for GCC's library.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

from forge.toolchain.resources import processors

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

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


def compile_cxx_library(zig: Path, compilers: Path, archive: Path) -> str:
    """Compile the library with the compilers in a folder; return '', or the output of what failed."""
    answer = subprocess.run((zig, "env"), capture_output=True, text=True, check=False)
    found = _LIB_DIR.search(answer.stdout)
    if found is None:
        return answer.stdout + answer.stderr
    home = Path(found[1])
    archive.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=archive.parent) as scratch:
        objects = [(source, Path(scratch, f"{number}.o")) for number, source in enumerate(_sources(home))]
        commands = [_command(compilers / "c++", home, source, output) for source, output in objects]
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


def _command(compiler: Path, home: Path, source: Path, output: Path) -> tuple[str, ...]:
    folders = (f"-I{home / folder}" for folder in _INCLUDED)
    return (str(compiler), *_FLAGS, *folders, "-c", str(source), "-o", str(output))


def _run_all(commands: Sequence[tuple[str, ...]]) -> str:
    """Run the commands in parallel; return the output of the first that fails, '' if none does."""
    pool = ThreadPoolExecutor(processors())
    try:
        return next(filter(None, pool.map(_run, commands)), "")
    finally:
        pool.shutdown(cancel_futures=True)


def _run(argv: tuple[str, ...]) -> str:
    done = subprocess.run(argv, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    return "" if done.returncode == 0 else done.stderr or f"exit code {done.returncode}"
