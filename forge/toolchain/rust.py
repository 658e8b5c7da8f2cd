"""Finds cargo, and identifies the Rust toolchain that it uses."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

from forge.base.digests import digest
from forge.base.errors import HostError, Problem
from forge.base.files import text_or_nothing
from forge.toolchain.programs import find_program

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.workspace.model import Package

_BEGINNINGS = ("CARGO_BUILD_", "CARGO_PROFILE_", "CARGO_TARGET_", "CARGO_ENCODED_", "RUSTC", "RUSTFLAGS")
_NAMES = frozenset({"CARGO_HOME", "RUSTUP_HOME", "RUSTUP_TOOLCHAIN"})
_JOBS = "CARGO_BUILD_JOBS"
_CONFIGS = ("config", "config.toml")


def require_cargo(package: Package, variables: Mapping[str, str]) -> None:
    """Raise HostError if cargo, which `package` needs, is not installed."""
    if find_program("cargo", variables) is None:
        hint = (
            "install it with `sudo apt install cargo`, or the latest version with rustup: https://rustup.rs"
        )
        raise HostError(Problem(f"cargo not found; '{package.name}' needs it", hint=hint))


def rust_toolchain(root: Path, variables: Mapping[str, str]) -> str:
    """Return a digest of the compiler, of variables, and of cargo's configuration for a workspace."""
    rustc = find_program("rustc", variables)
    version = b""
    if rustc is not None:
        argv = (str(rustc), "-vV")
        version = subprocess.run(argv, cwd=root, env=dict(variables), capture_output=True, check=False).stdout
    named = [name for name in sorted(variables) if name in _NAMES or name.startswith(_BEGINNINGS)]
    home = Path(variables.get("CARGO_HOME") or Path.home() / ".cargo")
    folders = (home, *(folder / ".cargo" for folder in (root, *root.parents)))
    texts = (text_or_nothing(folder / name) for folder in folders for name in _CONFIGS)
    parts = (
        version.decode(errors="replace"),
        *(f"{name}={variables[name]}" for name in named if name != _JOBS),
        *texts,
    )
    return digest(*parts)
