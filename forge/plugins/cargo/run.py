"""Run cargo for one package; a separate program, without forge.

    python run.py build NAME SOURCE BUILD WORKSPACE [cargo's command line]
    python run.py test NAME SOURCE BUILD RESULT [cargo's command line]

`build` stages the installed files of the package in BUILD/staged, and lists for forge the files that rustc
read outside of SOURCE, from its dep-info files, and the manifests and configuration that cargo read above
SOURCE, up to the folder WORKSPACE. `test` writes the results as JUnit to RESULT; it ends with 1 if tests
failed.

A Cargo.lock that the package does not have is kept in BUILD, so that the sources stay as they are; members of
a Cargo workspace share that beside its root manifest, which cargo finds or writes there. Crates
that packages in AMENT_PREFIX_PATH have installed replace those of the same name on crates.io.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import Any
from xml.etree import ElementTree as ET

INDEX = "share/ament_index/resource_index/rust_packages"
TESTS_FAILED = 1
_LOCAL = "forge_local_crates"
_DEPENDENCY = re.compile(r"(?:\\ |[^\s\\]|\\[^ ])+")
_CARGO_WORKSPACE = re.compile(r"^\s*\[\s*workspace\s*[\].]", re.MULTILINE)
_CARGO_ROOT = re.compile(r"""^\s*workspace\s*=\s*["']([^"']+)["']""", re.MULTILINE)
"""The line in a member's manifest that names the folder of the workspace."""
_STATUS = re.compile(r"(?=.{12} ) *[A-Z][a-z-]+ ")
"""A status line of cargo: a verb, right-aligned to 12 columns."""
_TEST = re.compile(r"^test (\S.*?) \.\.\. (ok|FAILED|ignored)\b", re.MULTILINE)
_BEGIN = re.compile(r"^running \d+ tests?$", re.MULTILINE)
_END = re.compile(r"^test result: ", re.MULTILINE)
"""The first and the last line of each test program and of the documentation tests."""
_PANIC = re.compile(
    r" panicked at (?:'(.*?)', (\S+:\d+:\d+)|(\S+:\d+:\d+):\n(.*?))\s*(?=^(?:note|stack backtrace):|\Z)",
    re.MULTILINE | re.DOTALL,
)
"""A panic: message and location in Rust before 1.73, location and message since."""
_OUTPUT = re.compile(r"^---- (.+?) stdout ----\n(.*?)(?=^---- |^failures:|\Z)", re.MULTILINE | re.DOTALL)


def build(name: str, source: Path, folder: Path, workspace: Path, command: list[str]) -> int:
    """Build and stage; return cargo's exit code."""
    _forget_local_crates(folder / "target")
    lock = (_cargo_root(source) or source) / "Cargo.lock"
    locked = _content(lock)
    with _own_lock_file(source, folder), _cargo(command, source, name) as cargo:
        output, _ = cargo.communicate()
    if cargo.returncode == 0:
        messages = (json.loads(line) for line in output.splitlines() if line.startswith("{"))
        artifacts = [message for message in messages if message.get("reason") == "compiler-artifact"]
        local = sorted({crate for artifact in artifacts if (crate := _local_crate(artifact["package_id"]))})
        (folder / "target" / _LOCAL).write_text("".join(f"{crate}\n" for crate in local), encoding="utf-8")
        staged = folder / "staged"
        shutil.rmtree(staged, ignore_errors=True)
        here = source.resolve()
        own = [each for each in artifacts if Path(each["manifest_path"]).parent.resolve() == here]
        _stage_programs(own, staged, name)
        if any({"lib", "rlib", "proc-macro"} & {*artifact["target"]["kind"]} for artifact in own):
            # The sources of a library, marked as a crate for other packages.
            ignored = shutil.ignore_patterns(".*", "target", "Cargo.lock")
            shutil.copytree(source, staged / "share" / name / "rust", ignore=ignored)
            (staged / INDEX).mkdir(parents=True)
            (staged / INDEX / name).touch()
        read = {*_read_by_rustc(artifacts), *_manifests(artifacts), *_configurations(source, workspace)}
        if locked in {None, _content(lock)}:
            # Members with different patches would keep changing it, and cause rebuilds of each other.
            read.add(str(lock))
        read = {path for path in read if not path.startswith(f"{source}/")}
        _write_list(folder / ".forge/read_by_backend", read)
        _write_list(folder / ".forge/written_by_backend", () if locked == _content(lock) else (str(lock),))
    return cargo.returncode


def test(name: str, source: Path, folder: Path, result: Path, command: list[str]) -> int:
    """Test and write the results; return 0, TESTS_FAILED, or cargo's exit code if no test failed."""
    with _own_lock_file(source, folder), _cargo(command, source, name, stderr=subprocess.PIPE) as cargo:
        output = _forward(cargo)
    tests = _TEST.findall(output)
    if len(_BEGIN.findall(output)) > len(_END.findall(output)):
        # A test called exit() with some code, or killed its program.
        tests.append(("a test program ended before its last test", "FAILED"))
    result.parent.mkdir(parents=True, exist_ok=True)
    result.write_bytes(_junit(name, tests, dict(_OUTPUT.findall(output))))
    return TESTS_FAILED if any(outcome == "FAILED" for _, outcome in tests) else cargo.returncode


def _cargo(command: list[str], source: Path, name: str, stderr: int | None = None) -> subprocess.Popen[str]:
    """Start cargo with crates of AMENT_PREFIX_PATH instead of those on crates.io."""
    manifest = _content(source / "Cargo.toml") or ""
    # cargo warns about patches that are not used.
    patches = [
        word
        for crate, folder in sorted(_installed_crates().items())
        for word in ("--config", f"patch.crates-io.{crate}.path={json.dumps(str(folder))}")
        if crate != name and re.search(rf"\b{re.escape(crate)}\b", manifest)
    ]
    # Pass on all descriptors, because cargo is a client of make's jobserver.
    return subprocess.Popen(
        (*command[:2], *patches, *command[2:]),
        cwd=source,
        stdout=subprocess.PIPE,
        stderr=stderr,
        text=True,
        errors="replace",
        close_fds=False,
    )


def _forward(cargo: subprocess.Popen[str]) -> str:
    """Print cargo's output, with status lines on stdout, since they are not warnings; return stdout."""
    assert cargo.stdout is not None
    assert cargo.stderr is not None

    def forward_status(stderr: Iterable[str]) -> None:
        for line in stderr:
            print(line, end="", flush=True, file=sys.stdout if _STATUS.match(line) else sys.stderr)

    status = Thread(target=forward_status, args=(cargo.stderr,))
    status.start()
    lines = []
    for line in cargo.stdout:
        lines.append(line)
        print(line, end="", flush=True)
    status.join()
    return "".join(lines)


def _forget_local_crates(target: Path) -> None:
    """Make cargo check all crates of the last build that come from folders.

    cargo compares file times, and would miss a file that was replaced by an older one.
    """
    listed = target / _LOCAL
    for crate in listed.read_text(encoding="utf-8").split() if listed.is_file() else ():
        for fingerprint in target.glob(f"**/.fingerprint/{crate}-*"):
            shutil.rmtree(fingerprint)


def _local_crate(package_id: str) -> str:
    """Return the name of a crate that comes from a folder, else ''.

    Ids are 'NAME VERSION (path+file:///FOLDER)', and since cargo 1.77 'path+file:///FOLDER#NAME@VERSION' or,
    if the folder has the name, 'path+file:///NAME#VERSION'.
    """
    if "path+file:" not in package_id:
        return ""
    if not package_id.startswith("path+file:"):
        return package_id.partition(" ")[0]
    folder, _, version = package_id.partition("#")
    return version.partition("@")[0] if "@" in version else folder.rpartition("/")[2]


def _installed_crates() -> dict[str, Path]:
    path = os.environ.get("AMENT_PREFIX_PATH", "")
    prefixes = [Path(prefix) for prefix in path.split(os.pathsep) if prefix]
    return {
        marker.name: prefix / "share" / marker.name / "rust"
        for prefix in reversed(prefixes)
        for marker in (prefix / INDEX).glob("*")
    }


@contextmanager
def _own_lock_file(source: Path, folder: Path) -> Iterator[None]:
    """Move the Cargo.lock of an earlier build into the source folder, and back."""
    lock, saved_lock = source / "Cargo.lock", folder / "Cargo.lock"
    if lock.exists():
        yield
        return
    if saved_lock.is_file():
        shutil.copy2(saved_lock, lock)
    try:
        yield
    finally:
        if lock.exists():
            shutil.move(lock, saved_lock)


def _stage_programs(artifacts: Iterable[dict[str, Any]], staged: Path, name: str) -> None:
    """Copy the programs to lib/NAME, where `ros2 run` finds them, and link them in bin, which is on PATH."""
    programs, links = staged / "lib" / name, staged / "bin"
    for artifact in artifacts:
        if artifact.get("executable") and "bin" in artifact["target"]["kind"]:
            programs.mkdir(parents=True, exist_ok=True)
            links.mkdir(parents=True, exist_ok=True)
            program = shutil.copy2(artifact["executable"], programs)
            (links / Path(program).name).symlink_to(f"../lib/{name}/{Path(program).name}")


def _read_by_rustc(artifacts: Iterable[dict[str, Any]]) -> Iterator[str]:
    """Yield the absolute paths in the dep-info files of the artifacts."""
    for artifact in artifacts:
        for file in artifact["filenames"]:
            info = Path(file).with_suffix(".d")
            text = info.read_text(encoding="utf-8") if info.is_file() else ""
            for line in text.splitlines():
                words = _DEPENDENCY.findall(line.partition(": ")[2])
                yield from (os.path.normpath(word.replace("\\ ", " ")) for word in words if word[0] == "/")


def _write_list(path: Path, lines: Iterable[str]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(f"{line}\n" for line in sorted(lines)), encoding="utf-8")


def _manifests(artifacts: Iterable[dict[str, Any]]) -> Iterator[str]:
    """Yield the manifests of the artifacts, and those of the Cargo workspaces that these are members of."""
    for artifact in artifacts:
        yield artifact["manifest_path"]
        is_local = _local_crate(artifact["package_id"])
        if is_local and (root := _cargo_root(Path(artifact["manifest_path"]).parent)):
            yield str(root / "Cargo.toml")


def _cargo_root(source: Path) -> Path | None:
    """Return the folder of the Cargo workspace that contains the crate in a folder, or None."""
    text = _content(source / "Cargo.toml") or ""
    if _CARGO_WORKSPACE.search(text):
        return None
    if match := _CARGO_ROOT.search(text):
        return Path(os.path.normpath(source / match[1]))
    manifests = ((folder, _content(folder / "Cargo.toml") or "") for folder in source.parents)
    return next((folder for folder, text in manifests if _CARGO_WORKSPACE.search(text)), None)


def _configurations(source: Path, workspace: Path) -> Iterator[str]:
    """Yield the files that would configure cargo between a package and the workspace, existing or not.

    Those in the package are sources, those in the workspace's folder and above identify the toolchain.
    """
    for folder in source.parents:
        if folder in {workspace, *workspace.parents}:
            return
        yield from (str(folder / ".cargo" / name) for name in ("config", "config.toml"))


def _content(path: Path) -> str | None:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return None


def _junit(name: str, tests: list[tuple[str, str]], outputs: dict[str, str]) -> bytes:
    outcomes = [outcome for _, outcome in tests]
    failures, skipped = str(outcomes.count("FAILED")), str(outcomes.count("ignored"))
    counts = {"tests": str(len(tests)), "errors": "0", "failures": failures, "skipped": skipped}
    suite = ET.Element("testsuite", counts, name=name)
    for test_name, outcome in tests:
        case = ET.SubElement(suite, "testcase", classname=name, name=test_name)
        if outcome == "ignored":
            ET.SubElement(case, "skipped")
        elif outcome == "FAILED":
            # Remove characters that XML cannot contain.
            output = outputs.get(test_name, "")
            text = "".join(letter for letter in output if letter.isprintable() or letter in "\n\t")
            ET.SubElement(case, "failure", message=_message(text)).text = text
    ET.indent(suite)
    return bytes(ET.tostring(suite, encoding="utf-8", xml_declaration=True))


def _message(output: str) -> str:
    panic = _PANIC.search(output)
    return f"{panic[2] or panic[3]}: {panic[1] or panic[4]}" if panic else "the test failed"


def main(argv: list[str]) -> int:
    mode, name, source, folder, other, *command = argv
    run = build if mode == "build" else test
    return run(name, Path(source), Path(folder), Path(other), command)


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except OSError as error:
        path = error.filename2 or error.filename or sys.argv[4]
        sys.exit(f"error: cannot read or write '{path}': {error.strerror}")
