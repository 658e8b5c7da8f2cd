"""Install a Python package into a prefix.

setuptools installs a package itself, with the commands that colcon runs. The plugin `pyproject` runs other
backends. Console scripts go to the folder in setup.cfg, commonly lib/<package>, where `ros2 run` finds them,
or to bin; modules go to the site-packages folder, data files to the paths in the package.
"""

from __future__ import annotations

import configparser
import contextlib
import os
import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.errors import Problem
from forge.base.extensions import BUILD_TYPES, find
from forge.base.files import listed_paths, read_file, read_text, replace_file
from forge.build.copies import has_same_content
from forge.build.inputs.fingerprints import source_files
from forge.build.wheels.backends import (
    TARGET_PYTHON,
    WheelInstall,
    find_pitfalls,
    run_setup_install,
    uses_setuptools,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

MANIFEST = "install_manifest.txt"
_LONGEST_FIRST_LINE = 127
"""The kernel ignores everything beyond this length."""
_STARTED_BY_SHELL = b"""#!/bin/sh
'''exec' "%s" "$0" "$@"
' '''
%s"""


def install_wheel(options: WheelInstall) -> tuple[Problem, ...]:
    """Build and install a package; return warnings. Raises ForgeError."""
    pitfalls = find_pitfalls()
    if pitfalls:
        pitfalls.refuse_what_no_backend_reads(options.source, Path(options.site_packages))
    if uses_setuptools(options.source):
        remove_links(options)
        installed, output = run_setup_install(options, _scripts_of_setup(options))
        _make_startable(installed, TARGET_PYTHON if options.target else options.python)
    else:
        backends = find(BUILD_TYPES, "python", "build type")
        installed, output = backends.install(options)
    if options.link:
        link_to_sources(options, output, installed)
    replace_file(options.build / MANIFEST, "".join(f"{path}\n" for path in sorted(installed)).encode())
    site = options.prefix / options.site_packages
    return tuple(pitfalls.wheel_warnings(options.source, site, installed)) if pitfalls else ()


def _make_startable(scripts: Sequence[Path], python: str) -> None:
    """Replace the first lines of scripts that the kernel cannot start: a path with blanks, or a long one."""
    usual = f"#!{python}".encode()
    if b" " not in usual and len(usual) < _LONGEST_FIRST_LINE:
        return
    for path in scripts:
        if os.access(path, os.X_OK) and not path.is_symlink():
            first, _, rest = read_file(path).partition(b"\n")
            if first in {usual, f'#!"{python}"'.encode(), f"#!{shlex.quote(python)}".encode()}:
                path.write_bytes(_STARTED_BY_SHELL % (python.encode(), rest))


def _scripts_of_setup(options: WheelInstall) -> str | None:
    """Return the script folder that colcon passes to setuptools, None for the default of setuptools.

    The default is `bin`, as for `ros2` itself, unless setup.py names another.
    """
    cfg = options.source / "setup.cfg"
    configured = setup_cfg_option(cfg, "develop", "script_dir") if options.link else ""
    configured = configured or setup_cfg_option(cfg, "install", "install_scripts")
    if configured or (options.source / "setup.py").is_file():
        return configured or None
    return f"$base/{options.scripts or f'lib/{options.package}'}"


def setup_cfg_option(path: Path, command: str, name: str) -> str:
    """Return an option of a setup.cfg, '' if it has none or is malformed."""
    parser = configparser.RawConfigParser()
    with contextlib.suppress(configparser.Error, OSError):
        parser.read_string(read_text(path))
    section = dict(parser[command]) if parser.has_section(command) else {}
    # After a parse error, values may still be lists of lines.
    return str(section.get(name) or section.get(name.replace("_", "-")) or "")


def remove_links(options: WheelInstall) -> None:
    """Remove the links of an earlier build, since writing through them would change the sources.

    The manifest of a copied build folder lists the files of the original workspace.
    """
    for path in map(Path, listed_paths(options.build / MANIFEST)):
        if path.is_relative_to(options.prefix) and path.is_symlink():
            path.unlink()


_COPYING = re.compile(r"^(?:hard linking|copying(?: and adjusting)?) (.+?) -> (.+)$", re.MULTILINE)
"""setuptools' messages about copies; the target is a folder, unless the file name changes."""
_MAX_COPY_CHAIN = 8
"""The maximum number of consecutive copies between a source and a file of the package."""


def link_to_sources(options: WheelInstall, output: str, installed: Iterable[Path]) -> None:
    """Replace each installed file by a symlink to the source file that it was copied from.

    If the backend does not report the source and several files match, the copy is kept.
    """
    sources: dict[str, list[Path]] = {}
    for path in map(Path, source_files(str(options.source))):
        sources.setdefault(path.name, []).append(path)
    origins: dict[str, str] = {}
    for source, target in _COPYING.findall(output):
        if " -> " not in target:
            origin = os.path.normpath(options.source / source)
            origins[os.path.normpath(options.source / target / os.path.basename(origin))] = origin  # noqa: PTH119
    start = f"{options.prefix}{os.sep}"
    copies = {Path(target): Path(_first(target, origins)) for target in origins if target.startswith(start)}
    for path in installed:
        if path.is_symlink():
            continue
        candidates = [
            source_file
            for source_file in sources.get(path.name, ())
            if source_file.is_file()
            # setuptools makes installed scripts executable even if their sources are not.
            and os.access(source_file, os.X_OK) >= os.access(path, os.X_OK)
            and has_same_content(source_file, path)
        ]
        original = _original(path, candidates, copies, options)
        if original is not None:
            path.unlink()
            path.symlink_to(original)


def _original(
    path: Path, candidates: list[Path], copies: Mapping[Path, Path], options: WheelInstall
) -> Path | None:
    """Return the source of a file among the `candidates` with the same name and content, or None."""
    if path in copies:
        return copies[path] if copies[path] in candidates else None
    site = options.prefix / options.site_packages
    if len(candidates) > 1 and path.is_relative_to(site):
        # A copy elsewhere, such as in build/lib, is a source as well.
        below = path.relative_to(site)
        usual = {options.source / below, options.source / "src" / below}
        candidates = [source_file for source_file in candidates if source_file in usual]
    is_metadata = path.parent.suffix in {".dist-info", ".egg-info"}
    return candidates[0] if len(candidates) == 1 and not is_metadata else None


def _first(path: str, made: Mapping[str, str]) -> str:
    for _ in range(_MAX_COPY_CHAIN):
        if path not in made:
            break
        path = made[path]
    return path
