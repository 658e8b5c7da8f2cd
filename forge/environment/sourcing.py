"""Computes the environment of sourced packages and workspaces without a shell."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from functools import cache, lru_cache
from pathlib import Path

from forge.base.env_vars import without_secrets
from forge.base.errors import HostError, Problem, WorkspaceError
from forge.base.files import text_if_exists
from forge.base.layout import LAYOUT_MARKER
from forge.environment import scripts
from forge.environment.dsv import Edit, Hook, PackageEdits, Script, apply, order, read_hooks, resolve_hooks
from forge.environment.install_state import recorded_underlays
from forge.environment.prefixes import has_packages, installed_packages

_SET_BY_SHELL = frozenset({"_", "SHLVL", "PWD", "OLDPWD", "COLCON_CURRENT_PREFIX", "AMENT_CURRENT_PREFIX"})


def build_environment(packages: Iterable[tuple[str, Path]], variables: Mapping[str, str]) -> dict[str, str]:
    """Return `variables` after sourcing the packages (name, prefix), lowest first, without forge's secrets.

    Only hooks that are pure shell scripts are run, with sh. Raises WorkspaceError for an unreadable dsv file,
    HostError for a hook that exits.
    """
    edits = [(prefix, edit) for name, prefix in packages for edit in package_edits(name, prefix)]
    return _apply(edits, without_secrets(variables), first=True)


def workspace_environment(chain: Sequence[Path], variables: Mapping[str, str]) -> dict[str, str]:
    """Return `variables` after sourcing `local_setup` of the roots, lowest first; raises as above."""
    result = dict(variables)
    for root in chain:
        result = apply(
            result, [(str(root), Edit("prepend", "COLCON_PREFIX_PATH", "", below=True))], first=True
        )
        edits = [
            (root / package.folder, edit) for package in packages_in_order(root) for edit in package.edits
        ]
        result = _apply(edits, result, first=False)
    return result


def sourced_environment(install: Path, variables: Mapping[str, str]) -> dict[str, str]:
    """Return `variables` after sourcing `setup` of a folder; raises WorkspaceError if it is empty."""
    below = recorded_underlays(install)
    if not (below or has_packages(install)):
        hint = "run 'forge build' with the same '--profile', or choose another folder with '--install-base'"
        raise WorkspaceError(Problem(f"'{install}' contains no installed packages", hint=hint))
    result = dict(variables)
    for root in (*below, install):
        script = root / "local_setup.sh"
        if (root / LAYOUT_MARKER).is_file():
            result = workspace_environment([root], result)
        elif script.is_file():  # setup scripts of distributions may do anything
            result = _source(script, root, result)
    return result


def packages_in_order(root: Path) -> tuple[PackageEdits, ...]:
    """Return the packages of an install tree with their edits, lowest first."""
    installed = {package.name: package for package in installed_packages(root)}
    packages = (installed[name] for name in order({name: p.needs for name, p in installed.items()}))
    return tuple(
        PackageEdits(p.name, "" if p.prefix == root else p.prefix.name, package_edits(p.name, p.prefix))
        for p in packages
    )


def package_edits(name: str, prefix: Path) -> tuple[Edit | Script, ...]:
    """Return the edits of an installed package; empty without dsv files."""
    try:
        stamp = os.stat(f"{prefix}/share/{name}/package.dsv")  # called for each dependency of each package
    except (FileNotFoundError, NotADirectoryError):
        return ()
    return _read_edits(name, prefix, (stamp.st_ino, stamp.st_ctime_ns, stamp.st_size))


def own_edits(name: str, prefix: Path, files: Iterable[str]) -> tuple[Edit | Script, ...]:
    """Return the edits of a package in a merged prefix, whatever other packages have installed there."""
    own = {"", "."}
    for file in files:
        path = file
        while path not in own:
            own.add(path)
            path = path.rpartition("/")[0]
    return resolve_hooks(
        _read_hooks(name, prefix),
        lambda path: os.path.exists(path) if path.startswith("/") else os.path.normpath(path) in own,
    )


def clear_edit_cache() -> None:
    _read_edits.cache_clear()


@lru_cache(maxsize=4096)
def _read_edits(name: str, prefix: Path, _stamp: tuple[int, int, int]) -> tuple[Edit | Script, ...]:
    # The stamp of package.dsv changes with each installation.
    # Unlike Path.exists, os.path.exists returns False for invalid names.
    return resolve_hooks(_read_hooks(name, prefix), lambda path: os.path.exists(prefix / path))


def _read_hooks(name: str, prefix: Path) -> Iterable[Hook]:
    return read_hooks(name, cache(lambda path: text_if_exists(os.path.join(prefix, path))))


def _apply(
    edits: Iterable[tuple[Path, Edit | Script]], variables: Mapping[str, str], *, first: bool
) -> dict[str, str]:
    """Apply edits in batches separated by scripts."""
    result = dict(variables)
    run: list[tuple[str, Edit]] = []
    for prefix, edit in edits:
        if isinstance(edit, Edit):
            run.append((str(prefix), edit))
        elif path := edit.path("sh"):
            result = _source(prefix / path, prefix, apply(result, run, first=first))
            run.clear()
    return apply(result, run, first=first)


def _source(hook: Path, prefix: Path, variables: Mapping[str, str]) -> dict[str, str]:
    if not hook.is_file():
        return dict(variables)
    before = dict(variables) | {"COLCON_CURRENT_PREFIX": str(prefix), "AMENT_CURRENT_PREFIX": str(prefix)}
    with tempfile.NamedTemporaryFile("w", suffix=".sh", encoding="utf-8") as script:
        script.write(scripts.hook_runner())
        script.flush()
        done = subprocess.run(
            ["/bin/sh", script.name, str(hook)], env=before, capture_output=True, check=False
        )
    _, _, after = done.stdout.partition(b"\0\0")
    if not after:
        reason = done.stderr.decode(errors="replace").strip() or f"exit code {done.returncode}"
        raise HostError(Problem(f"the environment hook '{hook}' failed: {reason}"))
    pairs = (item.decode(errors="surrogateescape").partition("=") for item in after.split(b"\0") if item)
    changed_variables = {name: value for name, _, value in pairs if name not in _SET_BY_SHELL}
    return changed_variables | {name: value for name, value in variables.items() if name in _SET_BY_SHELL}
