"""What the program that runs cargo reads and writes; tests/e2e/test_rust.py runs it."""

import json
from pathlib import Path

import pytest

from forge.base.xml import parse_xml
from forge.build.recipes import install_tree
from forge.plugins.cargo import run
from forge.testing.outcomes import Counts, read_junit
from tests.conftest import Tree

TESTED = """
running 3 tests
test tests::works ... ok
test slow ... ignored, takes an hour
test tests::fails ... FAILED

failures:

---- tests::fails stdout ----
thread 'tests::fails' panicked at 'a < b \x1b'

failures:
    tests::fails

test result: FAILED. 1 passed; 1 failed; 1 ignored; 0 measured; 0 filtered out
"""
CARGO = """#!/bin/sh
[ ! -e Cargo.lock ] || cat Cargo.lock >> seen
echo locked > Cargo.lock
echo "$@" > arguments
cat output
[ ! -e stderr ] || cat stderr >&2
exit ${CODE:-0}
"""


def write_cargo(tree: Tree, output: str) -> Path:
    """Write a package, and a program that prints what cargo would print."""
    manifest = '[package]\nname = "node"\n[dependencies]\nlib_crate = "*"\n'
    return tree({"src/Cargo.toml": manifest, "src/output": output, "cargo": CARGO, "build/.forge/x": ""})


def test_cargo_output_is_staged_and_inputs_of_rustc_are_listed(
    tree: Tree, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = tree(
        {
            "build/target/debug/node": "#!/bin/sh\n",
            "build/target/debug/node.d": "x: SRC/src/main.rs /other/a\\ b.rs relative.rs\n",
            "build/target/debug/liblib.rlib": "",
            "prefix/share/ament_index/resource_index/rust_packages/lib_crate": "",
            "prefix/share/ament_index/resource_index/rust_packages/unused": "",
        }
    )
    info = root / "build/target/debug/node.d"
    info.write_text(info.read_text().replace("SRC", str(root / "src")))
    messages = [
        artifact(root, "src", ["bin"], "node", executable=str(root / "build/target/debug/node")),
        artifact(root, "src", ["lib"], "liblib.rlib"),
        artifact(root, "elsewhere", ["bin"], "node", executable="/not/ours"),
        {"reason": "build-finished", "success": True},
    ]
    write_cargo(tree, "".join(f"{json.dumps(message)}\n" for message in messages))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(root / "prefix"))
    words = (root / "src", root / "build", root, root / "cargo")
    command = ["build", "node", *map(str, words), "build", "-q"]
    assert run.main(command) == 0
    assert run.main(command) == 0
    staged = root / "build/staged"
    assert (staged / "bin/node").resolve() == staged / "lib/node/node"
    assert (staged / "share/node/rust/Cargo.toml").is_file()
    assert (staged / "share/ament_index/resource_index/rust_packages/node").is_file()
    listed = (root / "build/.forge/read_by_backend").read_text()
    assert listed == f"/other/a b.rs\n{root}/elsewhere/Cargo.toml\n"
    crate = root / "prefix/share/lib_crate/rust"
    patch = f'--config patch.crates-io.lib_crate.path="{crate}"'
    assert (root / "src/arguments").read_text() == f"build {patch} -q\n"
    assert (root / "src/seen").read_text() == "locked\n"
    assert not (root / "src/Cargo.lock").exists()
    install_tree.main(staged, root / "install", root / "manifest")
    assert (root / "install/bin/node").is_symlink()
    assert f"{root}/install/lib/node/node\n" in (root / "manifest").read_text()


@pytest.mark.parametrize(
    ("package_id", "crate"),
    [
        ("node 0.1.0 (path+file:///ws/src/x)", "node"),
        ("path+file:///ws/src/x#node@0.1.0", "node"),
        ("path+file:///ws/src/node#0.1.0", "node"),
        ("registry+https://github.com/rust-lang/crates.io-index#libc@0.2.0", ""),
        ("libc 0.2.0 (registry+https://github.com/rust-lang/crates.io-index)", ""),
    ],
)
def test_path_dependencies_are_recognized(package_id: str, crate: str) -> None:
    assert run._local_crate(package_id) == crate


def artifact(root: Path, folder: str, kind: list[str], file: str, executable: str | None = None) -> object:
    return {
        "reason": "compiler-artifact",
        "package_id": f"path+file://{root}/{folder}#{'node' if folder == 'src' else 'other'}@1.0.0",
        "manifest_path": f"{root}/{folder}/Cargo.toml",
        "target": {"kind": kind},
        "filenames": [f"{root}/build/target/debug/{file}"],
        "executable": executable,
    }


def command_of_tests(root: Path) -> list[str]:
    words = (root / "src", root / "build", root / "results/test.xml", root / "cargo")
    return ["test", "node", *map(str, words), "test"]


def test_cargo_test_results_become_junit_files(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    root = write_cargo(tree, TESTED)
    (root / "src/Cargo.lock").write_text("own\n")
    result, command = root / "results/test.xml", command_of_tests(root)
    monkeypatch.setenv("CODE", "101")
    assert run.main(command) == run.TESTS_FAILED
    outcome = read_junit(parse_xml(result.read_bytes(), result), str(result), "")
    assert outcome.counts == Counts(tests=3, failures=1, skipped=1)
    assert [case.name for case in outcome.cases] == ["tests::fails"]
    assert "panicked at 'a < b '" in outcome.cases[0].failures[0] + outcome.cases[0].text
    (root / "src/output").write_text("error: could not compile\n")
    assert run.main(command) == 101
    assert (root / "src/Cargo.lock").exists()


def test_a_test_program_that_exits_early_has_failed(tree: Tree, monkeypatch: pytest.MonkeyPatch) -> None:
    """`exit(0)` in a test ends it and its program, and cargo takes that for success."""
    root = write_cargo(
        tree, "\nrunning 1 test\ntest a ... ok\n\ntest result: ok. 1 passed;\n\nrunning 2 tests\n"
    )
    monkeypatch.setenv("CODE", "0")
    assert run.main(command_of_tests(root)) == run.TESTS_FAILED
    result = root / "results/test.xml"
    outcome = read_junit(parse_xml(result.read_bytes(), result), str(result), "")
    assert outcome.counts == Counts(tests=2, failures=1)
    assert [case.name for case in outcome.cases] == ["a test program ended before its last test"]


@pytest.mark.parametrize(
    ("output", "message"),
    [
        (  # since Rust 1.73
            "thread 'x' panicked at a.rs:3:25:\nassertion failed\n  left: 42\n right: 41\nnote: run with\n",
            "a.rs:3:25: assertion failed\n  left: 42\n right: 41",
        ),
        (
            "some output\nthread 'x' panicked at 'it is late', src/lib.rs:3:25\nnote: run with\n",
            "src/lib.rs:3:25: it is late",
        ),
        (
            "thread 'x' panicked at src/lib.rs:1:1:\nlate\nstack backtrace:\n   0: main\n",
            "src/lib.rs:1:1: late",
        ),
        ('Error: "no file"\n', "the test failed"),
    ],
)
def test_the_message_of_a_failed_test_is_its_panic_message(output: str, message: str) -> None:
    assert run._message(output) == message


def test_cargo_status_lines_are_not_errors(
    tree: Tree, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Programs and compilers write to stderr for a reason, cargo also to say what it does."""
    root = write_cargo(tree, TESTED)
    status = (
        "   Compiling node v0.1.0 (/ws/src/node)\n"
        "    Finished `test` profile [unoptimized + debuginfo] target(s) in 2.02s\n"
        "     Running unittests src/lib.rs (/ws/build/node/target/debug/deps/node-efc8)\n"
        "   Doc-tests node\n"
    )
    rest = (
        "warning: unused variable: `x`\n"
        "  --> src/lib.rs:1:5\n"
        "   |\n"
        "12 |     Let there be\n"
        "   |\n"
        "   = note: Some note\n"
        "  A program says more\n"
    )
    (root / "src/stderr").write_text(status + rest)
    monkeypatch.setenv("CODE", "101")
    run.main(command_of_tests(root))
    out, err = capfd.readouterr()
    assert err == rest
    assert sorted(out.splitlines()) == sorted((status + TESTED).splitlines())
