"""Which Rust toolchain a build uses."""

from dataclasses import replace
from pathlib import Path

import pytest

from forge.base.errors import HostError
from forge.base.layout import Layout
from forge.build.tests.recipes import TestContext
from forge.plugins.cargo.build_type import toolchain
from tests.conftest import Tree
from tests.packages import package

PACKAGES = [package("a", build_type="ament_cargo"), package("b", build_type="cargo")]


def context(root: Path) -> TestContext:
    return TestContext(root, Layout(root / "build", root / "install", None), root / "python")


def test_the_toolchain_consists_of_compiler_variables_and_configuration(tree: Tree) -> None:
    root = tree({"bin/rustc": "#!/bin/sh\necho rustc 1.0\n", "bin/cargo": "#!/bin/sh\n", "ws/x": ""})
    variables = {"PATH": str(root / "bin"), "CARGO_HOME": str(root / "home")}
    here = context(root / "ws")
    seen = {toolchain(PACKAGES, here, variables)}
    for files, more in (
        ({}, {"RUSTFLAGS": "-g"}),
        ({"ws/.cargo/config.toml": "[build]"}, {}),
        ({"home/config.toml": "[net]"}, {}),
        ({"bin/rustc": "#!/bin/sh\necho rustc 1.1\n"}, {}),
    ):
        tree(files)
        found = toolchain(PACKAGES, here, {**variables, **more})
        assert found not in seen
        assert found == toolchain(
            PACKAGES, here, {**variables, **more, "OTHER": "x", "CARGO_BUILD_JOBS": "3"}
        )
        seen.add(found)


def test_a_missing_cargo_is_reported_with_a_remedy() -> None:
    with pytest.raises(HostError) as caught:
        toolchain(PACKAGES, context(Path("/ws")), {"PATH": "/nowhere"})
    (problem,) = caught.value.problems
    assert problem.message == "cargo not found; 'a' needs it"
    assert "apt install cargo" in str(problem.hint)


def test_packages_for_another_platform_are_reported_together() -> None:
    here = context(Path("/ws"))
    cross = replace(here, layout=replace(here.layout, target="aarch64-linux-gnu"))
    with pytest.raises(HostError) as caught:
        toolchain(PACKAGES, cross, {})
    (problem,) = caught.value.problems
    assert problem.message == "'--target' does not support Rust: 'a', 'b'"
    assert problem.hint == "build without '--target', or pass --packages-skip a b"
