"""`forge bundle`: pack the install folder into an archive, without files that only builds need."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from forge.base.errors import Problem, print_warnings
from forge.base.frozen import frozen
from forge.base.options import flag, option
from forge.cli.options import install_base_option, profile_option, target_option
from forge.cli.preparation import check_bases
from forge.environment.install_state import recorded_underlays
from forge.plugins.bundle.archive import write_bundle
from forge.toolchain.targets import Target
from forge.workspace.selection import SearchPaths

_MEGABYTE = 1_000_000


@frozen
class Options:
    output: str | None = option("archive to write (default: WORKSPACE.tar.gz)", short="-o", metavar="FILE")
    target: Target | None = target_option(group="platform")
    with_build_files: bool = flag(
        "include headers, CMake files and static libraries, so that other workspaces can build on it"
    )
    install_base: str = install_base_option()
    profile: str | None = profile_option()


def run(options: Options) -> int:
    target = options.target
    base = Path(options.install_base).absolute()
    check_bases(Path.cwd(), SearchPaths(), {"--install-base": base})
    install = base / target.name if target else base
    name = f"{Path.cwd().name}-{target.name}" if target else Path.cwd().name
    output = Path(os.path.abspath(options.output or f"{name}.tar.gz"))  # noqa: PTH100  (no '..' in it)
    files, size = write_bundle(install, output, build_files=options.with_build_files, name=base.name)
    print(f"{output}: {files} files, {_shown(size)}")
    underlays = [str(path) for path in recorded_underlays(install)]
    if underlays:
        hint = "install them at the same path on the target machine, or bundle them, too"
        print_warnings(
            [Problem(f"underlays are not part of the archive: {', '.join(map(repr, underlays))}", hint=hint)]
        )
    sys.stdout.flush()
    return 0


def _shown(size: int) -> str:
    return f"{size / 1e6:.1f} MB" if size >= _MEGABYTE else f"{max(round(size / 1e3), 1)} KB"
