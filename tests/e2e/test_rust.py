"""Rust packages, with and without package.xml, beside C++ and Python ones."""

import os
import subprocess
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text

pytestmark = pytest.mark.needs("cargo", "cmake")

CARGO = '[package]\nname = "{}"\nversion = "0.1.0"\nedition = "2021"\n'
LIBRARY = """/// Answers.
pub fn answer() -> i32 { 42 }
#[test] fn is_right() { assert_eq!(answer(), 42); }
#[test] #[ignore] fn later() {}
"""
MIXED = {
    "src/cpp/package.xml": manifest_text("cpp", build_type="cmake"),
    "src/cpp/CMakeLists.txt": "cmake_minimum_required(VERSION 3.10)\nproject(cpp NONE)\n"
    "install(FILES package.xml DESTINATION share/cpp)\n",
    "src/py/package.xml": manifest_text("py", "<depend>node</depend>", build_type="ament_python"),
    "src/py/setup.py": "from setuptools import setup\nsetup(name='py')\n",
    "src/lib/Cargo.toml": CARGO.format("lib_crate"),
    "src/lib/src/lib.rs": LIBRARY,
    "src/node/package.xml": manifest_text("node", "<depend>cpp</depend>", build_type="ament_cargo"),
    "src/node/Cargo.toml": CARGO.format("node") + '[dependencies]\nlib_crate = { path = "../lib" }\n',
    "src/node/src/main.rs": 'fn main() { println!("{}", lib_crate::answer()); }\n',
}


def test_rust_builds_alongside_cpp_and_python(forge: Forge, tree: Tree) -> None:
    root = tree(MIXED)
    ran = forge("build", "--merge-install", cwd=root)
    assert ran.code == 0, ran.err
    prefix = root / "install"
    assert said_by(prefix / "lib/node/node") == said_by(prefix / "bin/node") == "42\n"
    assert (prefix / "share/ament_index/resource_index/packages/node").is_file()
    assert forge("run", "node", "node", cwd=root).code == 0
    assert not list(root.glob("src/*/Cargo.lock"))
    assert "4 packages unchanged" in forge("build", "--merge-install", cwd=root).out
    (root / "src/lib/src/lib.rs").write_text(LIBRARY.replace("42", "43"))
    os.utime(root / "src/lib/src/lib.rs", (1e9, 1e9))  # as from an archive: cargo alone would miss it
    (root / "src/node/Cargo.toml").write_text(
        MIXED["src/node/Cargo.toml"].replace("[dep", '[[bin]]\nname = "other"\npath = "src/main.rs"\n[dep')
    )
    assert forge("build", "--merge-install", cwd=root).code == 0
    assert [path.name for path in (prefix / "lib/node").iterdir()] == ["other"]
    assert said_by(prefix / "lib/node/other") == "43\n"


def test_a_crate_of_another_package_is_found_by_its_name_and_tested(forge: Forge, tree: Tree) -> None:
    """As with colcon-ros-cargo: an installed crate replaces that of the same name on crates.io."""
    root = tree(
        {
            "src/lib/Cargo.toml": CARGO.format("lib_crate"),
            "src/lib/package.xml": manifest_text("lib_crate", build_type="ament_cargo"),
            "src/lib/src/lib.rs": LIBRARY,
            "src/node/package.xml": manifest_text(
                "node", "<depend>lib_crate</depend>", build_type="ament_cargo"
            ),
            "src/node/Cargo.toml": CARGO.format("node") + '[dependencies]\nlib_crate = "*"\n',
            "src/node/src/main.rs": MIXED["src/node/src/main.rs"],
        }
    )
    ran = forge("build", "--cargo-args", "--offline", cwd=root)
    assert ran.code == 0, ran.err
    assert (root / "install/lib_crate/share/lib_crate/rust/src/lib.rs").is_file()
    assert said_by(root / "install/node/lib/node/node") == "42\n"
    select = ("--packages-select", "lib_crate", "--return-code-on-test-failure", "--cargo-args", "--offline")
    ran = forge("test", *select, cwd=root)
    assert (ran.code, ran.err) == (0, "")
    assert "2 tests, 0 errors, 0 failures, 1 skipped" in ran.out
    (root / "src/lib/src/lib.rs").write_text(LIBRARY.replace("(), 42", "(), 41"))
    ran = forge("test", *select, cwd=root)
    assert ran.code == 1
    assert "is_right" in ran.out
    assert "2 tests, 0 errors, 1 failure, 1 skipped" in ran.out


SCRIPT = """fn main() {
    println!("cargo:rerun-if-env-changed=FROM_SCRIPT");
    println!("cargo:rerun-if-changed=../../../data");
    let count = std::fs::read_dir("../../../data").unwrap().count();
    let name = std::env::var("FROM_SCRIPT").unwrap_or("none".into());
    let more = std::fs::read_to_string("../../../undeclared").unwrap_or_default();
    println!("cargo:rustc-env=SCRIPT={name} {count}{more}");
}
"""
MEMBER = """fn main() {
    println!("{:?} {} {}", option_env!("FROM_SOURCE"), env!("SCRIPT"), env!("CARGO_PKG_VERSION"));
    if let Some(value) = outer::VALUE { println!("outer: {value}"); }
    if cfg!(special) { println!("special"); }
}
"""
INPUTS = {
    "src/all/Cargo.toml": '[workspace]\nmembers = ["node"]\n[workspace.package]\nversion = "1.0.0"\n',
    "src/all/node/Cargo.toml": '[package]\nname = "node"\nversion.workspace = true\nedition = "2021"\n'
    '[dependencies]\nouter = { path = "../../../crates/outer" }\n',
    "crates/COLCON_IGNORE": "",
    "crates/outer/Cargo.toml": CARGO.format("outer"),
    "crates/outer/src/lib.rs": 'pub const VALUE: Option<&str> = option_env!("FROM_CRATE");\n',
    "src/all/node/build.rs": SCRIPT,
    "src/all/node/src/main.rs": MEMBER,
    "data/one": "",
}


def test_external_files_read_by_cargo_are_inputs(forge: Forge, tree: Tree) -> None:
    """These are variables, folders, the root of a Cargo workspace, and cargo's configuration above."""
    root = tree(INPUTS)
    env: dict[str, str] = {}

    def built() -> str:
        ran = forge("build", cwd=root, env=env)
        assert ran.code == 0, ran.err
        assert "1 package unchanged" in forge("build", cwd=root, env=env).out
        return said_by(root / "install/node/lib/node/node")

    assert built() == "None none 1 1.0.0\n"
    env["FROM_SOURCE"] = "x"
    assert built() == 'Some("x") none 1 1.0.0\n'
    env["FROM_SCRIPT"] = "y"
    assert built() == 'Some("x") y 1 1.0.0\n'
    tree({"data/two": ""})
    assert built() == 'Some("x") y 2 1.0.0\n'
    tree({"undeclared": " and 3"})
    assert built() == 'Some("x") y 2 and 3 1.0.0\n'
    (root / "undeclared").unlink()
    tree({"src/all/Cargo.toml": INPUTS["src/all/Cargo.toml"].replace("1.0.0", "1.1.0")})
    assert built() == 'Some("x") y 2 1.1.0\n'
    tree({"src/all/.cargo/config.toml": '[build]\nrustflags = ["--cfg", "special"]\n'})
    assert built() == 'Some("x") y 2 1.1.0\nspecial\n'
    env["FROM_CRATE"] = "z"
    assert built() == 'Some("x") y 2 1.1.0\nouter: z\nspecial\n'
    lock = root / "src/all/Cargo.lock"
    lock.write_text(lock.read_text() + "\n# other versions\n")
    assert "1 package finished" in forge("build", cwd=root, env=env).out


def test_a_plain_package_installs_each_program_once(forge: Forge, tree: Tree) -> None:
    """The program in bin is a link to that in lib/PACKAGE."""
    root = tree({"src/app/Cargo.toml": CARGO.format("app"), "src/app/src/main.rs": "fn main() {}\n"})
    assert forge("build", cwd=root).code == 0
    ran = forge("run", "app", "app", cwd=root)
    assert (ran.code, ran.err) == (0, "")


def test_a_changed_file_of_a_used_crate_is_the_reason(forge: Forge, tree: Tree) -> None:
    root = tree({key: text for key, text in MIXED.items() if "/cpp/" not in key and "/py/" not in key})
    (root / "src/node/package.xml").unlink()
    assert forge("build", cwd=root).code == 0
    (root / "src/lib/src/lib.rs").write_text(LIBRARY.replace("42", "43"))
    assert "'src/lib.rs' changed" in forge("build", "--explain", cwd=root).out


def said_by(program: Path) -> str:
    return subprocess.run([program], capture_output=True, text=True, check=True).stdout
