"""Names that Rust sources, build scripts and Cargo.toml refer to."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from forge.plugins.cargo.references import in_manifest, in_script, in_source, reader_of

if TYPE_CHECKING:
    from tests.conftest import Tree


@pytest.mark.parametrize(
    "text",
    [
        'const X: &str = env!("FOO");',
        'let x = option_env!( "FOO" );',
        'println!("cargo:rerun-if-env-changed=FOO");',
        'println!("cargo::rerun-if-changed=x"); let x = env::var_os("FOO");',
        'println!("cargo:x"); for name in ["FOO"] { let x = std::env::var(name); }',
    ],
)
def test_environment_variables_of_rust_builds_are_found(text: str) -> None:
    assert in_source(text).variables == in_source(text).exported == {"FOO"}
    assert in_script(text) == in_source(text)


def test_runtime_variables_of_rust_programs_are_not_inputs() -> None:
    text = 'let x = std::env::var("FOO");'
    assert in_source(text).variables == frozenset()
    assert in_script(text).variables == {"FOO"}


def test_crates_in_other_folders_are_read_with_their_sources(tree: Tree) -> None:
    root = tree(
        {"x/Cargo.toml": "", "x/src/lib.rs": "", "x/notes.txt": "", "shared.rs": "", "a/Cargo.toml": ""}
    )
    text = '[dependencies]\nx = { path = "../x" }\n[lib]\npath = "../shared.rs"\n'
    included = in_manifest(f"{root}/a", text).included
    files = {path for path in included if Path(path).is_file()}
    assert files == {f"{root}/x/Cargo.toml", f"{root}/x/src/lib.rs", f"{root}/shared.rs"}


def test_sources_and_manifests_are_searched() -> None:
    assert all(reader_of(f"/ws/x/{name}") for name in ("build.rs", "src/main.rs", "Cargo.toml"))
    assert reader_of("/ws/x/x.cpp") is None
