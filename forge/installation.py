"""Writing into prefixes: package hooks and indexes, the workspace's scripts."""

from __future__ import annotations

import contextlib
import json
import os
from typing import TYPE_CHECKING

from forge import scripts
from forge.ament_index import INDEX
from forge.environment import Installed
from forge.files import read_file, replace_file, tree_below, write_if_changed
from forge.folders import listed_files
from forge.hooks import package_hooks
from forge.prefixes import PACKAGES
from forge.results import STATE, recorded_underlays
from forge.shells import SHELLS
from forge.sourcing import own_edits, package_edits, packages_in_order

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from forge.interpreter import Interpreter
    from forge.layout import Layout
    from forge.model import Package

_SETUP_EXTENSIONS = ("bash", "dsv", "sh", "zsh")


def install_package(
    package: Package,
    layout: Layout,
    run_dependencies: tuple[str, ...],
    python: Interpreter,
    installed: frozenset[Path] | None = None,
) -> None:
    """Finish a package's prefix after its own install step: implicit files, hooks, scripts, index.

    `installed` holds what this package alone installed, below the prefix; without it forge looks.
    """
    prefix = layout.prefix(package.name)
    files = frozenset(_own_files(package.name, layout) if installed is None else map(str, installed))
    if package.build_type == "ament_python":
        _write_implicit(package, prefix, symlink=layout.symlink)
    share = prefix / "share" / package.name
    hooks = package_hooks(package.name, package.build_type, files, python.site_packages)
    _remove_others(share / "hook", {f"{name}.dsv" for name in hooks})
    for name, line in hooks.items():
        write_if_changed(share / "hook" / f"{name}.dsv", scripts.dsv([line]))
    sources = [f"share/{package.name}/hook/{name}.dsv" for name in hooks]
    setups = (f"share/{package.name}/local_setup.{extension}" for extension in _SETUP_EXTENSIONS)
    sources += (path for path in (*setups, *package.hooks) if (prefix / path).is_file())
    # Always a new file: its stamp tells readers that any of the package's hooks may have changed.
    replace_file(share / "package.dsv", scripts.dsv([f"source;{path}" for path in sources]).encode())
    edits = own_edits(package.name, prefix, files) if layout.merged else package_edits(package.name, prefix)
    for shell in SHELLS:
        text = scripts.package_setup(shell, prefix, Installed(package.name, "", edits))
        write_if_changed(share / f"package.{shell}", text)
    write_if_changed(prefix / PACKAGES / package.name, os.pathsep.join(sorted(set(run_dependencies))))


def installed_files(package: Package, layout: Layout) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the absolute paths, sorted, of all files that a build has just installed, and empty folders.

    Folders have '/' at their end. In a prefix of its own that is all there is, since the build began without
    one; the lists of tools add what went elsewhere. In a shared one these lists are all that is known, and
    they name no folders.
    """
    prefix = layout.prefix(package.name)
    found = set(listed_files(layout.build_dir(package.name)))
    if not layout.merged:
        files, folders = tree_below(str(prefix))
        elsewhere = (path for path in found if not path.startswith(f"{prefix}/") and os.path.lexists(path))
        return tuple(sorted((*(path for path, _ in files), *elsewhere))), tuple(
            sorted(f"{path}/" for path in folders)
        )
    share = prefix / "share" / package.name
    own = [share / f"package.{extension}" for extension in ("dsv", *SHELLS)]
    own += [*(share / "hook").glob("*.dsv"), prefix / PACKAGES / package.name]
    if package.build_type == "ament_python":
        own += [prefix / INDEX / "packages" / package.name, share / "package.xml"]
    found.update(map(str, own))
    # What is listed may be gone: a package can remove by its own code what CMake had installed.
    return tuple(sorted(path for path in found if os.path.lexists(path))), ()


def markers(name: str, layout: Layout) -> tuple[str, ...]:
    """Return the files that make a package look installed, the one that readers begin with first."""
    prefix = layout.prefix(name)
    scripts_of_it = (f"{prefix}/share/{name}/package.{extension}" for extension in ("dsv", *SHELLS))
    return (*scripts_of_it, f"{prefix}/{PACKAGES}/{name}", f"{prefix}/{INDEX}/packages/{name}")


def uninstall_markers(name: str, layout: Layout) -> None:
    """Remove what makes a package look installed, before it is built anew and might fail."""
    for path in markers(name, layout):
        with contextlib.suppress(FileNotFoundError):
            os.unlink(path)  # noqa: PTH108  (seven of each package: no Path for each)


def finish_workspace(
    layout: Layout, underlays: tuple[Path, ...], python: Path, *, as_before: bool = False
) -> tuple[Path, ...]:
    """Write the scripts of the install root; return the underlays that they source, lowest first.

    An underlay of an earlier build stays, though it is not sourced this time: forgetting that must
    not change what the workspace is. `as_before` tells that all packages say to shells what they said
    when the scripts were written: these stay, unless underlays or interpreter are others.
    Raises WorkspaceError for a package's dsv file that is wrong.
    """
    root = layout.install
    chain = _joined_chain(recorded_underlays(root), underlays)
    state = {"version": 1, "python": str(python), "underlays": [str(path) for path in chain]}
    other = write_if_changed(root / STATE, json.dumps(state, indent=2) + "\n")
    if as_before and not other:
        return chain
    packages = packages_in_order(root)
    for shell in SHELLS:
        write_if_changed(root / f"local_setup.{shell}", scripts.local_setup(shell, root, packages))
        below = [_entry_script(underlay, shell) for underlay in chain]
        write_if_changed(root / f"setup.{shell}", scripts.setup(shell, root, below))
    return chain


def _own_files(name: str, layout: Layout) -> Iterator[str]:
    """Yield the files of a package relative to its prefix, once or more.

    A prefix of its own holds nothing else; in a shared one only the lists of CMake, of forge's wheels
    and of ament's links know.
    """
    prefix = layout.prefix(name)
    if not layout.merged:
        cut = len(f"{prefix}/")
        yield from (path[cut:] for path, _ in tree_below(str(prefix))[0])
        return
    listed = listed_files(layout.build_dir(name))
    yield from (path.removeprefix(f"{prefix}/") for path in listed if path.startswith(f"{prefix}/"))


def _write_implicit(package: Package, prefix: Path, *, symlink: bool) -> None:
    """Write what every ament_python package has, though its setup.py may not list it."""
    marker = prefix / INDEX / "packages" / package.name
    if not marker.exists():
        replace_file(marker, b"")
    manifest = prefix / "share" / package.name / "package.xml"
    if manifest.exists():
        return
    if symlink:
        manifest.parent.mkdir(parents=True, exist_ok=True)
        manifest.unlink(missing_ok=True)
        manifest.symlink_to(package.manifest.path.absolute())
    else:
        replace_file(manifest, read_file(package.manifest.path))


def _remove_others(folder: Path, names: set[str]) -> None:
    """Remove the hooks of earlier builds that this one does not call for."""
    if folder.is_dir():
        for entry in folder.iterdir():
            if entry.name not in names and entry.suffix in {
                ".dsv",
                *(f".{shell}" for shell in SHELLS),
            }:
                entry.unlink()


def _entry_script(underlay: Path, shell: str) -> Path:
    """Return the script that brings in an underlay: the shell's own, or the one for any, if that is all."""
    own, plain = underlay / f"local_setup.{shell}", underlay / "local_setup.sh"
    return plain if plain.exists() and not own.exists() else own


def _joined_chain(recorded: tuple[Path, ...], sourced: tuple[Path, ...]) -> tuple[Path, ...]:
    """Return the underlays of now over those of before, lowest first."""
    if set(recorded) <= set(sourced):
        return sourced
    return (*recorded, *(path for path in sourced if path not in recorded))
