"""The build types `ament_cargo` and `cargo`: `cargo build`, and programs installed to lib/<package>."""

from __future__ import annotations

import subprocess
import sys
import sysconfig
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from forge.base.errors import HostError, Problem
from forge.base.files import text_or_nothing
from forge.base.formats import read_toml
from forge.base.text import listed
from forge.build.recipes.context import BuildContext, Recipe, common_options, install_tree
from forge.build.tasks import TEST_FAILURES, TIMED_OUT, Step, StepKind
from forge.build.tests.recipes import TestContext, missing_result
from forge.toolchain.programs import find_program
from forge.workspace.identity import Folder, Identity
from forge.workspace.model import Dependency, DependencyKind, Package
from forge.workspace.plain_packages import plain_package

__all__ = ["identify", "options", "recipe", "staged", "tests", "tests_build", "tool_folders", "toolchain"]

staged = True
tests_build = True

_PROGRAM = (sys.executable, "-S", "-E", str(Path(__file__).with_name("run.py")))
_KEPT = ("target", "Cargo.lock")
"""Files kept in a build folder: cargo tracks their inputs, including the compiler."""
_VARIABLES = ("CARGO_BUILD_", "CARGO_PROFILE_", "CARGO_TARGET_", "CARGO_ENCODED_", "RUSTC", "RUSTFLAGS")
_NAMES = frozenset({"CARGO_HOME", "RUSTUP_HOME", "RUSTUP_TOOLCHAIN"})
_JOBS = "CARGO_BUILD_JOBS"


def options(package: Package, context: BuildContext) -> tuple[str, ...]:
    """Return the options shared by all build types, and cargo's arguments."""
    return (*common_options(package, context), *context.cargo_args, *package.option_values("cargo-args"))


def recipe(package: Package, context: BuildContext) -> Recipe:
    build, source = context.layout.build_dir(package.name), context.source(package)
    quiet = ("--message-format", "json-render-diagnostics", "--quiet")
    cargo = (*_cargo("build", source, build), *quiet, *context.cargo_args)
    argv = (*_PROGRAM, "build", package.name, str(source), str(build), str(context.root), *cargo)
    compiling = Step(StepKind.BUILD, (*argv, *package.option_values("cargo-args")), build)
    return Recipe((compiling, install_tree(package, context, build / "staged")), kept=_KEPT)


def tests(package: Package, context: TestContext) -> Recipe:
    build, source = context.layout.build_dir(package.name), context.source(package)
    result = context.results_of(package.name) / "test.xml"
    all_tests = ("--no-fail-fast", "--color", "never")
    cargo = (*_cargo("test", source, build), *all_tests, *context.options.cargo_args)
    argv = (*_PROGRAM, "test", package.name, str(source), str(build), str(result), *cargo)
    argv += package.option_values("cargo-args")
    limit = context.options.test_timeout
    meanings = ((1, TEST_FAILURES), (TIMED_OUT, TEST_FAILURES))
    step = Step(StepKind.TEST, argv, build, meanings=meanings, seconds=limit)
    return Recipe((step,), ((result, missing_result(package, "cargo", limit)),))


def _cargo(verb: str, source: Path, build: Path) -> tuple[str, ...]:
    """Return cargo's command line without arguments of the user."""
    manifest, target = str(source / "Cargo.toml"), str(build / "target")
    return ("cargo", verb, "--manifest-path", manifest, "--target-dir", target)


def toolchain(
    packages: Sequence[Package], context: BuildContext | TestContext, variables: Mapping[str, str]
) -> tuple[str, str]:
    """Return the compiler's version, variables, and cargo's configuration for the workspace.

    Raises HostError if cargo is not installed, and for builds for another platform.
    """
    names = tuple(package.name for package in packages)
    if context.layout.target:
        hint = f"build without '--target', or pass --packages-skip {' '.join(names)}"
        raise HostError(Problem(f"'--target' does not support Rust: {listed(names)}", hint=hint))
    if find_program("cargo", variables) is None:
        hint = (
            "install it with `sudo apt install cargo`, or the latest version with rustup: https://rustup.rs"
        )
        raise HostError(Problem(f"cargo not found; '{names[0]}' needs it", hint=hint))
    version = b""
    if rustc := find_program("rustc", variables):
        argv = (str(rustc), "-vV")
        result = subprocess.run(argv, cwd=context.root, env=dict(variables), capture_output=True, check=False)
        version = result.stdout
    relevant = (
        f"{name}={variables[name]}"
        for name in sorted(variables)
        if (name in _NAMES or name.startswith(_VARIABLES)) and name != _JOBS
    )
    home, _ = _homes(variables)
    folders = (home, *(folder / ".cargo" for folder in (context.root, *context.root.parents)))
    texts = (text_or_nothing(folder / name) for folder in folders for name in ("config", "config.toml"))
    return "Rust", "\0".join((version.decode(errors="replace"), *relevant, *texts))


def tool_folders(variables: Mapping[str, str]) -> tuple[str, ...]:
    """Return the folders of cargo, whose crates run.py reports, of rustup, and of run.py's Python."""
    own = (sys.prefix,) if sys.prefix != sys.base_prefix else ()
    return (*map(str, _homes(variables)), sysconfig.get_path("stdlib"), *own)


def _homes(variables: Mapping[str, str]) -> tuple[Path, Path]:
    """Return the folders of cargo and rustup."""
    return (
        Path(variables.get("CARGO_HOME") or Path.home() / ".cargo"),
        Path(variables.get("RUSTUP_HOME") or Path.home() / ".rustup"),
    )


_KINDS = {
    "dependencies": frozenset({DependencyKind.BUILD, DependencyKind.EXEC}),
    "build-dependencies": frozenset({DependencyKind.BUILD}),
    "dev-dependencies": frozenset({DependencyKind.TEST}),
}
"""Libraries are linked statically, but may need files or libraries of other languages at run time."""


def identify(folder: Folder) -> Identity | None:
    """Read Cargo.toml; members of a Cargo workspace are found in the folders below, like other packages."""
    if not folder.may_be("cargo") or not folder.has("Cargo.toml"):
        return None
    path = folder.display_path / "Cargo.toml"
    content = read_toml(folder.content("Cargo.toml"), path)
    own = _table(content, "package")
    name, version = own.get("name"), own.get("version", "")
    if not isinstance(name, str):
        return None
    needs = _dependencies(content, name)
    package = plain_package(folder, folder.name or name, "cargo", path, needs)
    # The version may be inherited from a Cargo workspace.
    manifest = replace(package.manifest, version=version if isinstance(version, str) else "")
    return Identity(replace(package, manifest=manifest), descend="workspace" in content)


def _dependencies(content: Mapping[str, Any], own: str) -> tuple[Dependency, ...]:
    """Return the crates that a package depends on, including those for single platforms, except itself."""
    crates: dict[str, frozenset[DependencyKind]] = {}
    targets = _table(content, "target")
    for table in (content, *(_table(targets, name) for name in targets)):
        for key, kinds in _KINDS.items():
            for alias, source in _table(table, key).items():
                name = str(source.get("package", alias)) if isinstance(source, dict) else alias
                crates[name] = crates.get(name, frozenset()) | kinds
    return tuple(Dependency(name, kinds) for name, kinds in sorted(crates.items()) if name != own)


def _table(content: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    table = content.get(key)
    return table if isinstance(table, dict) else {}
