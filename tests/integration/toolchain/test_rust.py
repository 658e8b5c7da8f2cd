"""Which Rust toolchain a build uses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from forge.base.errors import HostError
from forge.toolchain.rust import require_cargo, rust_toolchain
from tests.packages import package

if TYPE_CHECKING:
    from tests.conftest import Tree


def test_the_toolchain_is_its_compiler_variables_and_configuration(tree: Tree) -> None:
    root = tree({"bin/rustc": "#!/bin/sh\necho rustc 1.0\n", "ws/x": ""})
    variables = {"PATH": str(root / "bin"), "CARGO_HOME": str(root / "home")}
    known = {rust_toolchain(root / "ws", variables)}
    for files, more in (
        ({}, {"RUSTFLAGS": "-g"}),
        ({"ws/.cargo/config.toml": "[build]"}, {}),
        ({"home/config.toml": "[net]"}, {}),
        ({"bin/rustc": "#!/bin/sh\necho rustc 1.1\n"}, {}),
    ):
        tree(files)
        found = rust_toolchain(root / "ws", {**variables, **more})
        assert found not in known
        assert found == rust_toolchain(
            root / "ws", {**variables, **more, "OTHER": "x", "CARGO_BUILD_JOBS": "3"}
        )
        known.add(found)


def test_a_missing_cargo_is_reported_with_its_remedy() -> None:
    with pytest.raises(HostError) as caught:
        require_cargo(package("a", build_type="ament_cargo"), {"PATH": "/nowhere"})
    (problem,) = caught.value.problems
    assert problem.message == "cargo not found; 'a' needs it"
    assert "apt install cargo" in str(problem.hint)
