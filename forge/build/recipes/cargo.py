"""Recipes for Rust packages: `cargo build`, and programs installed to lib/<package>; pure."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from forge.base.layout import PACKAGE
from forge.build.recipes.context import Recipe, common_options, install_tree
from forge.build.tasks import TEST_FAILURES, Step, StepKind
from forge.build.tests.recipes import missing_result

if TYPE_CHECKING:
    from pathlib import Path

    from forge.build.recipes.context import BuildContext
    from forge.build.tests.recipes import TestContext
    from forge.workspace.model import Package

_PROGRAM = (sys.executable, "-S", "-E", str(PACKAGE / "build/recipes/cargo_run.py"))
_KEPT = ("target", "Cargo.lock")
"""What stays in a build folder: cargo knows what it made from what, the compiler included."""


def options(package: Package, context: BuildContext) -> tuple[str, ...]:
    """Return the options shared by all build types, cargo's arguments, and the Rust toolchain."""
    arguments = (*context.cargo_args, *package.option_values("cargo-args"))
    return (*common_options(package, context), *arguments, context.rust)


def recipe(package: Package, context: BuildContext) -> Recipe:
    """Return the steps that build with cargo and install the programs."""
    build, source = context.layout.build_dir(package.name), context.source(package)
    cargo = (
        *_cargo("build", source, build),
        *("--message-format", "json-render-diagnostics", "--quiet"),
        *context.cargo_args,
        *package.option_values("cargo-args"),
    )
    argv = (*_PROGRAM, "build", package.name, str(source), str(build), str(context.root), *cargo)
    steps = (Step(StepKind.BUILD, argv, build), install_tree(package, context, build / "staged"))
    return Recipe(steps, kept=_KEPT)


def tests(package: Package, context: TestContext) -> Recipe:
    """Return the `cargo test` run."""
    build, source = context.layout.build_dir(package.name), context.source(package)
    result = context.results_of(package.name) / "test.xml"
    cargo = (
        *_cargo("test", source, build),
        *("--no-fail-fast", "--color", "never"),
        *context.options.cargo_args,
        *package.option_values("cargo-args"),
    )
    argv = (*_PROGRAM, "test", package.name, str(source), str(build), str(result), *cargo)
    step = Step(StepKind.TEST, argv, build, meanings=((1, TEST_FAILURES),))
    return Recipe((step,), ((result, missing_result(package, "cargo")),))


def _cargo(verb: str, source: Path, build: Path) -> tuple[str, ...]:
    """Return cargo's command line without arguments of the user."""
    return (
        "cargo",
        verb,
        "--manifest-path",
        str(source / "Cargo.toml"),
        "--target-dir",
        str(build / "target"),
    )
