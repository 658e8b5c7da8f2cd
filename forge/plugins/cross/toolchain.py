"""The toolchain of `--target`: a CMake toolchain file and variables, with zig or compilers of the user."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path

from forge.base.cmake_syntax import quoted
from forge.base.errors import HostError, Problem, raise_if_any
from forge.base.files import text_or_nothing, write_if_changed
from forge.base.layout import TOOLCHAIN_DIR, Layout
from forge.base.templating import render
from forge.environment.prefixes import find_underlays
from forge.plugins.cross.targets import TRIPLES, Target, parse_target, similar_target
from forge.plugins.cross.zig import Zig, find_zig
from forge.toolchain.targets import CrossBuild, CrossOptions
from forge.workspace.cmake_text import any_enables_cxx
from forge.workspace.model import Package

_FILE = "toolchain.cmake"
_EMULATOR = "CMAKE_CROSSCOMPILING_EMULATOR"
_HERE = "${CMAKE_CURRENT_LIST_DIR}"
_INCLUDE = re.compile(r'\binclude\s*\(\s*"?([^")]+)')
_VERSIONED = re.compile(r"python(\d+)\.(\d+)")


def platform(word: str) -> tuple[str, bool]:
    """Return a platform's name without a version, and whether compilers for it are known.

    Raises ValueError for an invalid name.
    """
    target = parse_target(word)
    return target.triple, target.is_known


def prepare(word: str, layout: Layout, variables: Mapping[str, str], options: CrossOptions) -> CrossBuild:
    """Write the toolchain file, and scripts for zig's compilers unless the user has a toolchain file.

    Raises HostError without compilers, and for paths that do not exist.
    """
    target, toolchain_file, sysroot = parse_target(word), options.toolchain_file, options.sysroot
    raise_if_any(_problems(target, toolchain_file, sysroot), HostError)
    folder = layout.build / TOOLCHAIN_DIR
    zig = None if toolchain_file else find_zig(target, layout, variables)
    if zig:
        zig.write_compilers(folder)
    command = emulator(target, sysroot, variables)
    version = options.target_python or _python_of(sysroot)
    # Workspaces built for the target that are sourced.
    underlays = [
        root for root in find_underlays(variables, layout.install).chain if root.name == target.triple
    ]
    base = quoted(str(toolchain_file)) if toolchain_file else ""
    if toolchain_file and toolchain_file.is_relative_to(layout.of_host.build.parent):
        # A relative path is valid in other clones of the workspace, too.
        base = f'"{_HERE}/{quoted(os.path.relpath(toolchain_file, folder))[1:]}'
    is_multiarch = sysroot is not None and (sysroot / "usr/lib" / target.triple).is_dir()
    text = render(
        "cross/templates/toolchain.cmake.j2",
        target=target.with_glibc,
        base=base,
        processor=target.cmake_processor,
        sysroot=quoted(str(sysroot)) if sysroot else "",
        architecture=target.triple if is_multiarch else "",
        install=os.path.relpath(layout.install, folder),
        underlays=[quoted(str(root)) for root in underlays],
        emulator=quoted(*command) if command else "",
        # Python's binary interface as Debian and Ubuntu name it (PEP 3149).
        soabi=f"cpython-{version[0]}{version[1]}-{target.triple}" if version else "",
    )
    write_if_changed(folder / _FILE, text)
    return CrossBuild(
        cmake_args=(f"-DCMAKE_TOOLCHAIN_FILE={folder / _FILE}",),
        variables={**_pkg_config(target, sysroot), **(zig.compilers(folder) if zig else {})},
        python_version=version,
        prepare_compilers=partial(_prepare_compilers, zig, folder),
    )


def _prepare_compilers(zig: Zig | None, folder: Path, packages: Iterable[Package]) -> tuple[Problem, ...]:
    """Compile the C++ library of the compilers if one of the packages needs it; return warnings."""
    if not zig:
        return ()
    warnings = zig.glibc_warnings()
    if any_enables_cxx(package for package in packages if not package.embedded):
        warnings += zig.compile_library(folder)
    return warnings


def emulator(target: Target, sysroot: Path | None, variables: Mapping[str, str]) -> tuple[str, ...]:
    """Return the command that runs programs of the target on this machine, () if there is none."""
    if target.is_host:
        return ("/usr/bin/env",)
    qemu = shutil.which(f"qemu-{target.cpu}", path=variables.get("PATH"))
    libraries = sysroot or Path("/usr", target.triple)
    if qemu is None:
        return ()
    return (qemu, "-L", str(libraries)) if libraries.is_dir() else (qemu,)


def has_emulator(layout: Layout) -> bool:
    """Return whether the last build for a target had an emulator, or used files that may name one."""
    own = text_or_nothing(layout.build / TOOLCHAIN_DIR / _FILE)
    match = _INCLUDE.search(own)
    text = text_or_nothing(match[1].replace(_HERE, str(layout.build / TOOLCHAIN_DIR))) if match else ""
    return _EMULATOR in own + text or _INCLUDE.search(text) is not None


def _problems(target: Target, toolchain_file: Path | None, sysroot: Path | None) -> Iterator[Problem]:
    if toolchain_file is None and not target.is_known:
        near = similar_target(target)
        question = f"did you mean '{near}'? otherwise " if near else ""
        triples = ", ".join(TRIPLES.values())
        hint = f"{question}use one of {triples}, or describe the compilers in a '--toolchain-file'"
        yield Problem(f"unknown target '{target.triple}'", hint=hint)
    if toolchain_file and target.glibc:
        hint = f"pass '--target {target.triple}'"
        yield Problem("'--toolchain-file' decides which version of glibc is used", hint=hint)
    if toolchain_file and not toolchain_file.is_file():
        yield Problem(f"--toolchain-file: '{toolchain_file}' does not exist")
    if sysroot and not toolchain_file:
        message = (
            "--sysroot needs --toolchain-file: C++ libraries of distributions are incompatible with zig's"
        )
        hint = "name a GCC for the target in it, for example from Debian's package g++-aarch64-linux-gnu"
        yield Problem(message, hint=hint)
    if sysroot and not sysroot.is_dir():
        yield Problem(f"--sysroot: '{sysroot}' is not a folder")


def _pkg_config(target: Target, sysroot: Path | None) -> dict[str, str]:
    """Return the variables that keep pkg-config from finding libraries of this machine."""
    if sysroot is None:
        return {"PKG_CONFIG_LIBDIR": os.devnull}
    folders = (f"{sysroot}/usr/{name}/pkgconfig" for name in (f"lib/{target.triple}", "lib", "share"))
    return {"PKG_CONFIG_LIBDIR": os.pathsep.join(folders), "PKG_CONFIG_SYSROOT_DIR": str(sysroot)}


def _python_of(sysroot: Path | None) -> tuple[int, int] | None:
    if sysroot is None:
        return None
    names = [os.path.basename(os.path.realpath(sysroot / "usr/bin/python3"))]  # noqa: PTH119
    names += sorted(path.parent.name for path in sysroot.glob("usr/lib/python3.*/os.py"))
    versions = [(int(match[1]), int(match[2])) for match in map(_VERSIONED.fullmatch, names) if match]
    return versions[0] if versions else None
