"""Sourcing without a shell: the environment that installed packages and workspaces make."""

from __future__ import annotations

import errno
import os
import subprocess
import tempfile
from functools import cache, lru_cache
from typing import TYPE_CHECKING

from forge import scripts
from forge.environment import Edit, Installed, Script, apply, order, read_hooks, settle
from forge.errors import EnvironmentFault, Problem, WorkspaceError
from forge.prefixes import LAYOUT_MARKER, installed_packages
from forge.results import recorded_underlays
from forge.settings import without_secrets

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from pathlib import Path

    from forge.environment import Hook

_NOT_THERE = frozenset({errno.ENOENT, errno.ENOTDIR, errno.ENAMETOOLONG})
_SHELL_S_OWN = frozenset({"_", "SHLVL", "PWD", "OLDPWD", "COLCON_CURRENT_PREFIX", "AMENT_CURRENT_PREFIX"})


def build_environment(
    packages: Iterable[tuple[str, Path]],
    variables: Mapping[str, str],
    edits_of: Callable[[str, Path], tuple[Edit | Script, ...]] | None = None,
) -> dict[str, str]:
    """Return `variables` after sourcing the packages (name, prefix), lowest first, each in front of all.

    It is for code of packages, and forge's passwords are not in it.
    Computed from the dsv files, or from what `edits_of` knows of them; only hooks that are nothing but a
    shell script run, in sh.
    Raises WorkspaceError for a dsv file that cannot be read, EnvironmentFault for a hook that exits.
    """
    known = edits_of or package_edits
    edits = [(prefix, edit) for name, prefix in packages for edit in known(name, prefix)]
    return _apply(edits, without_secrets(variables), first=True)


def workspace_environment(chain: Sequence[Path], variables: Mapping[str, str]) -> dict[str, str]:
    """Return `variables` after sourcing the `local_setup` scripts of the roots, lowest first.

    Raises as `build_environment` does.
    """
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
    """Return `variables` after sourcing the `setup` script of an install folder; lost underlays add nothing.

    Raises WorkspaceError where nothing was built, or as `build_environment` does.
    """
    if not (install / LAYOUT_MARKER).is_file():
        hint = "run 'forge build', or name another folder with '--install-base'"
        raise WorkspaceError(Problem(f"nothing was built into '{install}'", hint=hint))
    result = dict(variables)
    for root in (*recorded_underlays(install), install):
        script = root / "local_setup.sh"
        if (root / LAYOUT_MARKER).is_file():
            result = workspace_environment([root], result)
        elif script.is_file():  # a distribution: what its own script does is not for us to guess
            result = _source(script, root, result)
    return result


def packages_in_order(root: Path) -> tuple[Installed, ...]:
    """Return the packages of an install tree with what they do to the environment, lowest first."""
    installed = {package.name: package for package in installed_packages(root)}
    found = (installed[name] for name in order({name: p.needs for name, p in installed.items()}))
    return tuple(
        Installed(p.name, "" if p.prefix == root else p.prefix.name, package_edits(p.name, p.prefix))
        for p in found
    )


def package_edits(name: str, prefix: Path) -> tuple[Edit | Script, ...]:
    """Return what an installed package does to the environment; nothing, when no dsv file says it."""
    try:
        stamp = (prefix / "share" / name / "package.dsv").stat()
    except (FileNotFoundError, NotADirectoryError):
        return ()
    return _read_edits(name, prefix, (stamp.st_ino, stamp.st_ctime_ns, stamp.st_size))


def own_edits(name: str, prefix: Path, files: Iterable[str]) -> tuple[Edit | Script, ...]:
    """Return what an installed package does to the environment by its own files, relative to a shared prefix.

    What others have installed there by now, and what they have not yet, makes no difference.
    """
    own = {"", "."}
    for file in files:
        path = file
        while path not in own:
            own.add(path)
            path = path.rpartition("/")[0]
    return settle(
        _read_hooks(name, prefix),
        lambda path: os.path.exists(path) if path.startswith("/") else os.path.normpath(path) in own,  # noqa: PTH110
    )


def forget_edits() -> None:
    """Read what packages do to the environment anew, whatever their stamps say."""
    _read_edits.cache_clear()


@lru_cache(maxsize=4096)
def _read_edits(name: str, prefix: Path, _stamp: tuple[int, int, int]) -> tuple[Edit | Script, ...]:
    """Read the dsv files of a package; its package.dsv is written anew whenever it is installed."""
    # Unlike Path.exists, os.path.exists says no to a name that no file can have.
    return settle(_read_hooks(name, prefix), lambda path: os.path.exists(prefix / path))  # noqa: PTH110


def _read_hooks(name: str, prefix: Path) -> Iterable[Hook]:
    """Read the dsv files of a package."""

    @cache
    def read(path: str) -> str | None:
        try:
            with open(os.path.join(prefix, path), encoding="utf-8", errors="surrogateescape") as stream:  # noqa: PTH118, PTH123
                return stream.read()
        except OSError as error:
            if error.errno in _NOT_THERE:
                return None
            raise

    return read_hooks(name, read)


def _apply(
    edits: Iterable[tuple[Path, Edit | Script]], variables: Mapping[str, str], *, first: bool
) -> dict[str, str]:
    """Apply edits in as few runs as the scripts between them allow."""
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
    """Return the environment that a hook leaves when sh sources it."""
    if not hook.is_file():
        return dict(variables)
    given = dict(variables) | {"COLCON_CURRENT_PREFIX": str(prefix), "AMENT_CURRENT_PREFIX": str(prefix)}
    with tempfile.NamedTemporaryFile("w", suffix=".sh", encoding="utf-8") as script:
        script.write(scripts.hook_runner())
        script.flush()
        done = subprocess.run(
            ["/bin/sh", script.name, str(hook)], env=given, capture_output=True, check=False
        )
    _, _, after = done.stdout.partition(b"\0\0")
    if not after:
        said = done.stderr.decode(errors="replace").strip() or f"it exits with {done.returncode}"
        raise EnvironmentFault(Problem(f"the environment hook '{hook}' ends the shell: {said}"))
    pairs = (item.decode(errors="surrogateescape").partition("=") for item in after.split(b"\0") if item)
    left = {name: value for name, _, value in pairs if name not in _SHELL_S_OWN}
    return left | {name: value for name, value in variables.items() if name in _SHELL_S_OWN}
