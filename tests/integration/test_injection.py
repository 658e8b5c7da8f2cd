"""Text from packages never becomes code: compilers, CMake, shells and make read it as text."""

import os
import re
import subprocess
from pathlib import Path

import pytest
from hypothesis import given, settings

from forge.build.recipes.initial_cache import manifest_variables
from forge.environment.dsv import Edit, PackageEdits, apply
from forge.environment.scripts import local_setup, package_setup, setup
from forge.interfaces.model import Message
from forge.interfaces.writing import write_depfile
from forge.workspace.model import Dependency, DependencyKind, Export, Manifest, Person
from tests.hostile import CANARY, FRAGMENTS
from tests.unit.test_injection import BIDI, EXAMPLES, NEUTRAL, definition, generated, messages, quick


def code_of(text: str, language: str) -> str:
    """Return C or C++ as the compiler's own first phases leave it: no comments, no literals, no blanks."""
    words = ["g++", "-x", language, "-fpreprocessed", "-dD", "-E", "-P", "-trigraphs", "-"]
    done = subprocess.run(words, input=text.encode(), capture_output=True, check=True)
    assert b"warning" not in done.stderr, done.stderr
    bare = re.sub(r'(u8|u|U|L)?"(\\.|[^"\\\n])*"|(u|U|L)?\'(\\.|[^\'\\\n])*\'', "T", done.stdout.decode())
    bare = re.sub(r"\{(?:[T0-9a-fx]+, )*0\}|T(?:\s*T)+", "T", bare)
    return re.sub(r"\(T, \d+\)|\s+", " ", bare)


@pytest.mark.needs("g++")
@pytest.mark.parametrize("target", ["cpp", "c"])
def test_preprocessed_code_does_not_depend_on_comments(target: str) -> None:
    plain = generated(NEUTRAL, target)
    struct = next(
        path for path in plain if path.endswith(f"detail/hostile__struct.h{'pp' * (target == 'cpp')}")
    )

    @settings(quick, max_examples=max(EXAMPLES // 2, 10))
    @given(messages)
    def check(message: Message) -> None:
        found = generated(message, target)
        language = "c++" if target == "cpp" else "c"
        assert CANARY not in code_of(found[struct], language)
        for path, text in found.items():
            assert not BIDI.search(text), path
            text.encode("ascii") if path != struct else None
            assert not re.search("[\0-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029]", text), path

    check()


@pytest.mark.needs("g++", "gcc")
@pytest.mark.parametrize(("target", "compiler"), [("cpp", "g++ -std=c++17"), ("c", "gcc -std=c99")])
def test_compilers_accept_hostile_texts(target: str, compiler: str, tmp_path: Path) -> None:
    """Comments of each fragment, alone and at the end of a line; values of each as well."""
    lines = []
    for number, fragment in enumerate(FRAGMENTS):
        message = definition(
            [fragment, f"x{fragment}", fragment * 2], f"u{fragment}", f"v{fragment}", f"H{number}"
        )
        for path, text in generated(message, target).items():
            (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / path).write_text(text, encoding="utf-8")
            if f"/detail/h{number}__struct." in path:
                lines.append(f'#include "{path.removeprefix(f"{target}/")}"\n')
    language = "c++" if target == "cpp" else "c"
    (tmp_path / "all").write_text("".join(lines))
    runtime = Path(__file__).parents[2] / "forge" / "embedded" / "rosidl_default_runtime" / "include"
    words = [
        *compiler.split(),
        "-fsyntax-only",
        "-x",
        language,
        "-trigraphs",
        "-Wall",
        "-Wextra",
        "-Wcomment",
    ]
    folders = [f"-I{tmp_path / target}", f"-I{runtime}"]
    done = subprocess.run(
        [*words, "-Werror", *folders, tmp_path / "all"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[:4000]


# --- Packages -----------------------------------------------------------------------------------------------


def manifest_of(text: str) -> Manifest:
    """Return a manifest that says the same in every place that takes any text."""
    return Manifest(
        name="pkg", version=text, description=text, build_type="ament_cmake", path=Path("package.xml"),
        dependencies=(Dependency("other", frozenset({DependencyKind.BUILD}), (("gte", text),)),),
        maintainers=(Person(text, text),), licenses=(text,), groups=(text, text), group_dependencies=(text,),
        exports=(Export("deprecated", (("a", text),), text), Export("x", (), text)),
    )  # fmt: skip


@pytest.mark.needs("cmake")
def test_cmake_reads_hostile_manifests_as_text(tmp_path: Path) -> None:
    script = ["cmake_minimum_required(VERSION 3.18)\n"]
    texts = [fragment.replace("\0", "") for fragment in FRAGMENTS]
    texts += [f"{text}\\" for text in texts[:40]] + ["".join(texts[at : at + 3]) for at in range(len(texts))]
    for number, text in enumerate(texts):
        (tmp_path / f"{number}.cmake").write_text(
            manifest_variables(manifest_of(text)), encoding="utf-8", newline=""
        )
        script.append(f'include({number}.cmake)\nfile(WRITE "{number}.txt" "${{pkg_VERSION}}")\n')
    (tmp_path / "all.cmake").write_text("".join(script))
    done = subprocess.run(
        ["cmake", "-P", "all.cmake"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / CANARY).exists()
    for number, text in enumerate(texts):
        read = (tmp_path / f"{number}.txt").read_bytes().decode()
        assert read == text.replace(";", "\\;").replace("\r\n", "\n"), text


# --- Shells -------------------------------------------------------------------------------------------------

_SHELLS = {
    "sh": ("dash", "-eu", "-c", ". ./setup.sh; env -0"),
    "bash": ("bash", "--norc", "-eu", "-c", ". ./setup.bash; env -0"),
    "zsh": ("zsh", "-f", "-c", ". ./setup.zsh; env -0"),
    "fish": ("fish", "--no-config", "-c", "source ./setup.fish; env -0"),
}


def values() -> list[str]:
    """Return hostile values, as far as an environment can hold them."""
    texts = [fragment.replace("\0", "") for fragment in FRAGMENTS]
    return [text for text in (*texts, *(f"{text}\\" for text in texts[:20]), "".join(texts)) if text]


@pytest.mark.parametrize(
    "shell", [pytest.param(s, marks=pytest.mark.needs(w[0], "env")) for s, w in _SHELLS.items()]
)
def test_shells_read_hostile_hooks_as_text(shell: str, tmp_path: Path) -> None:
    root = tmp_path / 'it\'s a $(touch x) "root"; `touch x` #\\'
    root.mkdir()
    edits = [Edit("set", f"SET_{n}", value, below=False) for n, value in enumerate(values())]
    edits += [Edit("default", f"DEFAULT_{n}", value, below=False) for n, value in enumerate(values())]
    listed = [(n, value) for n, value in enumerate(values()) if not {":", "\n"} & {*value}]
    edits += [Edit("prepend", f"LIST_{n}", value, below=not value.startswith("/")) for n, value in listed]
    underlay = tmp_path / f"gone\n touch {CANARY}\n'\" $(touch {CANARY})"
    package = PackageEdits("pkg", "pkg", tuple(edits))
    (root / f"local_setup.{shell}").write_text(local_setup(shell, root, [package]), newline="")
    (root / f"setup.{shell}").write_text(setup(shell, root, [underlay / f"local_setup.{shell}"]), newline="")
    (root / f"package.{shell}").write_text(package_setup(shell, root, package), newline="")
    marker = root / "pkg" / "share" / "colcon-core" / "packages" / "pkg"
    marker.parent.mkdir(parents=True)
    marker.touch()
    variables = {"PATH": os.environ["PATH"], "HOME": str(tmp_path), "COLCON_CURRENT_PREFIX": str(root)}
    done = subprocess.run(_SHELLS[shell], cwd=root, env=variables, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
    found = dict(
        entry.decode(errors="surrogateescape").split("=", 1)
        for entry in done.stdout.split(b"\0")
        if b"=" in entry
    )
    wanted = apply({}, [(f"{root}/pkg", edit) for edit in edits])
    assert {name: found.get(name) for name in wanted} == wanted
    assert not list(tmp_path.rglob(CANARY))
    assert not list(tmp_path.rglob("x"))


# --- The rest -----------------------------------------------------------------------------------------------


@pytest.mark.needs("make")
def test_make_reads_hostile_paths_in_depfiles(tmp_path: Path) -> None:
    folders = [
        tmp_path / name for name in ("a b", "a#b", "a$b", "a$(touch canary)b", "a'b", 'a"b', "a`b", "a\\b")
    ]
    for folder in folders:
        folder.mkdir()
        (folder / "X.msg").touch()
    write_depfile(tmp_path / "deps", Path("target"), [folder / "X.msg" for folder in folders])
    (tmp_path / "Makefile").write_text("include deps\ntarget: ; @echo made\n")
    done = subprocess.run(
        ["make", "-s", "-C", tmp_path, "target"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout
    assert not (tmp_path / "canary").exists()


def test_all_shells_are_covered() -> None:
    from forge.environment.shells import SHELLS

    assert SHELLS.keys() == _SHELLS.keys()
