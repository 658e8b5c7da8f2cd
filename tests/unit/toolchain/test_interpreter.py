import os
import sys
from pathlib import Path

import pytest

from forge.base.errors import HostError
from forge.toolchain.interpreter import (
    Interpreter,
    find_interpreter,
    own_path,
)
from tests.conftest import Tree

OWN = Interpreter(own_path(), (sys.version_info.major, sys.version_info.minor))
PATH = {"PATH": str(Path(sys.executable).parent)}
OTHER = f"python3.{sys.version_info.minor + 1}"


def path_of(*folders: Path) -> str:
    return os.pathsep.join(map(str, folders))


def environment(root: Path, name: str, version: str = OTHER) -> Path:
    """Create an environment whose python is a link to a program with its version in the name."""
    base = root / "base" / version
    base.parent.mkdir(exist_ok=True)
    base.write_bytes(b"\x7fELF")
    base.chmod(0o755)
    folder = root / name
    (folder / "bin").mkdir(parents=True)
    (folder / "bin/python3").symlink_to(base)
    (folder / "bin/python").symlink_to("python3")
    return folder


def test_the_interpreter_is_chosen_in_the_documented_order(tree: Tree) -> None:
    """The option, the last build, the active environment, the highest underlay, PATH."""
    root = tree({})
    names = ("option", "venv", "conda", "path", "built", "low", "high")
    pythons = {name: environment(root, name) / "bin/python3" for name in names}
    for name in ("low", "high"):
        record = f'{{"python": "{pythons[name]}", "underlays": []}}'
        (root / name / ".forge.json").write_text(record)
    underlays = (root / "low", root / "high")
    variables = {
        "VIRTUAL_ENV": str(root / "venv"),
        "CONDA_PREFIX": str(root / "conda"),
        "CONDA_DEFAULT_ENV": "work",
        "PATH": path_of(root / "path/bin"),
    }
    option, built = str(pythons["option"]), str(pythons["built"])
    found = [find_interpreter(option, variables, underlays, built)]
    found.append(find_interpreter(None, variables, underlays, built))
    found.append(find_interpreter(None, variables, underlays))
    del variables["VIRTUAL_ENV"]
    found.append(find_interpreter(None, variables, underlays))
    variables["CONDA_DEFAULT_ENV"] = "base"  # active in every shell, and not by choice
    found.append(find_interpreter(None, variables, underlays))
    found.append(find_interpreter(None, variables, underlays[:1]))
    found.append(find_interpreter(None, variables))
    assert [(str(each.path.relative_to(root)), each.origin) for each in found] == [
        ("option/bin/python3", "'--python'"),
        ("built/bin/python3", "the last build"),
        ("venv/bin/python3", "the active virtual environment"),
        ("conda/bin/python3", "the active conda environment"),
        ("high/bin/python3", f"the underlay '{root}/high'"),
        ("low/bin/python3", f"the underlay '{root}/low'"),
        ("path/bin/python3", "'python3' on PATH"),
    ]
    assert {each.version for each in found} == {(3, sys.version_info.minor + 1)}


def test_the_environment_of_a_locked_workspace_precedes_that_of_an_underlay(tree: Tree) -> None:
    root = tree({})
    own = environment(root, ".venv") / "bin/python3"
    low = environment(root, "low") / "bin/python3"
    (root / "low/.forge.json").write_text(f'{{"python": "{low}", "underlays": []}}')
    variables = {"PATH": path_of(environment(root, "path") / "bin")}
    underlays = (root / "low",)
    assert find_interpreter(None, variables, underlays, root=root).path == low
    (root / "forge.lock").touch()
    found = find_interpreter(None, variables, underlays, root=root)
    assert (found.path, found.chosen) == (own, False)
    variables["VIRTUAL_ENV"] = str(environment(root, "active"))
    assert find_interpreter(None, variables, underlays, root=root).chosen


@pytest.mark.parametrize("receipt", ["tool/uv-receipt.toml", "tool/pipx_metadata.json", "archive-v0/x/CACHE"])
def test_the_environment_of_forge_itself_is_never_chosen(
    receipt: str, tree: Tree, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not even if it is active, on PATH as with `uvx`, or recorded by an underlay or the last build."""
    root = tree({receipt: ""})
    tool = environment(root, str(Path(receipt).parent))
    system = environment(root, "system")
    own = tool / "bin/python3"
    (tool / ".forge.json").write_text(f'{{"python": "{own}", "underlays": []}}')
    monkeypatch.setattr(sys, "prefix", str(tool))
    monkeypatch.setattr(sys, "executable", str(own))
    variables = {"VIRTUAL_ENV": str(tool), "PATH": path_of(tool / "bin", system / "bin")}
    assert find_interpreter(None, variables, [tool], str(own)).path == system / "bin/python3"
    assert find_interpreter(str(own), variables).path == own
    with pytest.raises(HostError, match="'python3' is not on PATH"):
        find_interpreter(None, {"PATH": path_of(tool / "bin")})


def test_the_interpreter_does_not_depend_on_how_forge_was_started(
    monkeypatch: pytest.MonkeyPatch, tree: Tree
) -> None:
    """`forge` uses python3, while users may write python; this causes no rebuild."""
    root = tree({"bin/python3": "", "other/python": "", "other/python3": ""})
    (root / "bin/python").symlink_to("python3")
    monkeypatch.setattr(sys, "executable", str(root / "bin/python"))
    assert own_path() == root / "bin/python3"
    monkeypatch.setattr(sys, "executable", str(root / "other/python"))
    assert own_path() == root / "other/python"


def test_the_python_version_of_an_underlay_is_recognized_by_its_modules(tree: Tree) -> None:
    """This includes isolated layouts. python3 precedes a program with the version in its name."""
    root = tree(
        {
            "low/.colcon_install_layout": "isolated\n",
            f"low/a/lib/{OTHER}/site-packages/a.py": "",
            f"low/a/lib/{OTHER}/empty": "",
            "low/b/lib/python3.1/site-packages/.keep": "",
        }
    )
    first, second = environment(root, "first"), environment(root, "second")
    usual = environment(root, "usual", "python3.9")
    (second / "bin" / OTHER).symlink_to("python3")
    both = {"PATH": path_of(usual / "bin", second / "bin")}
    low = root / "low"
    assert find_interpreter(None, {"PATH": path_of(first / "bin")}, [low]).path == first / "bin/python3"
    assert find_interpreter(None, both, [low]).path == second / "bin/python3"
    with pytest.raises(HostError) as caught:
        find_interpreter(None, {"PATH": path_of(usual / "bin")}, [low])
    version = OTHER.replace("python", "python ")
    assert str(caught.value) == (
        f"error: the underlay '{low}' is for {version}, but '{OTHER}' is not on PATH\n"
        "hint: install it, or pass the path of such an interpreter to '--python'"
    )


def test_the_interpreter_of_an_underlay_is_read_from_its_scripts(tree: Tree) -> None:
    """For example /opt/ros, if conda's python3 comes first on PATH."""
    root = tree(
        {"ros/bin/a": "#!/usr/bin/env python3\n", "ros/bin/b": "#!/gone/bin/python3\n", "ros/bin/c/d": ""}
    )
    python = environment(root, "system") / "bin/python3"
    (root / "ros/bin/ros2").write_text(f"#!{python}\n")
    assert find_interpreter(None, PATH, [root / "ros"]).path == python


def test_an_invalid_record_of_an_underlay_is_ignored(tree: Tree) -> None:
    """Another check reports it."""
    assert find_interpreter(None, PATH, [tree({"low/.forge.json": "{"}) / "low"]) == OWN


@pytest.mark.parametrize(
    ("variables", "option", "used", "hint"),
    [
        ({}, "R/venv/bin/python3", "'--python'", "pass '--python python3.1'"),
        (
            {"VIRTUAL_ENV": "R/venv"},
            None,
            "the active virtual environment",
            "run 'deactivate', or activate one of python3.1: python3.1 -m venv --system-site-packages .venv",
        ),
        (
            {"CONDA_PREFIX": "R/venv"},
            None,
            "the active conda environment",
            "run 'conda deactivate', or source an underlay for this environment",
        ),
        (
            {},
            None,
            "the underlay 'R/venv'",
            "source only underlays for the same version, or rebuild one of them",
        ),
    ],
)
def test_a_version_mismatch_with_the_underlay_is_rejected_with_a_hint(
    variables: dict[str, str],
    option: str | None,
    used: str,
    hint: str,
    tree: Tree,
) -> None:
    root = tree({"low/lib/python3.1/site-packages/a.py": ""})
    venv = environment(root, "venv")
    python = venv / "bin/python3"
    (venv / ".forge.json").write_text(f'{{"python": "{python}", "underlays": []}}')
    given = {name: value.replace("R", str(root)) for name, value in variables.items()}
    with pytest.raises(HostError) as caught:
        find_interpreter(option and str(python), given, [root / "low", venv])
    used, version = used.replace("R", str(root)), OTHER.removeprefix("python")
    assert str(caught.value) == (
        f"error: the underlay '{root}/low' is for python 3.1, but {used} is python {version} ('{python}')\n"
        f"hint: {hint}"
    )


@pytest.mark.parametrize(
    ("python", "variables", "message"),
    [
        (
            "python9",
            {"PATH": "/bin"},
            "error: python 'python9' not found\nhint: pass an existing program to '--python'",
        ),
        (
            None,
            {"VIRTUAL_ENV": "/not/there"},
            (
                "error: the active virtual environment '/not/there' has no 'bin/python'\n"
                "hint: run 'deactivate', or choose an interpreter with '--python'"
            ),
        ),
        (
            None,
            {"PATH": "/not/there"},
            (
                "error: 'python3' is not on PATH\n"
                "hint: install Python, activate a virtual environment, or pass an interpreter to '--python'"
            ),
        ),
    ],
)
def test_a_missing_interpreter_is_reported_with_a_hint(
    python: str | None, variables: dict[str, str], message: str
) -> None:
    with pytest.raises(HostError) as caught:
        find_interpreter(python, variables)
    assert str(caught.value) == message
