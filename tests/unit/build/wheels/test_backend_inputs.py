"""Inputs of Python packages among the accesses that build backends and compilers log."""

from __future__ import annotations

import ast
import json
from typing import TYPE_CHECKING

import pytest

from forge.build.wheels.backend_inputs import (
    Started,
    Traced,
    external_files,
    parse_list,
    parse_make_rules,
    parse_trace,
)
from tests.snippets import ROOT

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Tree


def log(*lines: list[object]) -> str:
    """Return a log as the tracer writes it."""
    return "".join(f"{json.dumps(line)}\n" for line in lines)


def test_an_access_log_is_parsed() -> None:
    traced = parse_trace(
        log(
            ["read", "/a/../b"],
            ["read", "/m/__pycache__/x.cpython-311.opt-1.pyc"],
            ["written", "/w"],
            ["made", "/d/"],
            ["listed", "/l/."],
            ["started", "/here", "cat", ["cat", "x"]],
            ["missing", "Cython", True],
            ["interpreter", ["", "/lib"], ["/bin/python3"]],
        )
    )
    assert traced == Traced(
        read={"/b", "/m/x.py"},
        written={"/w"},
        made={"/d"},
        listed={"/l"},
        started=[Started("/here", "cat", ("cat", "x"))],
        missing={"Cython": True},
        search_path={"/lib"},
        programs={"/bin/python3"},
    )


@pytest.mark.parametrize(
    "line",
    ["", "{", "3", '["read"', '["read"]', '["read", 3]', '["started", "/", "x", 3]', '["a", "b"]', "\0"],
)
def test_meaningless_log_lines_are_skipped(line: str) -> None:
    assert parse_trace(f"{line}\n" + log(["read", "/a"])) == Traced(read={"/a"})


def test_any_file_name_survives_the_log() -> None:
    name = "/a\nb\udcff\u2028'\"\\"
    assert parse_trace(log(["read", name])).read == {name}


def test_prerequisites_are_read_from_make_rules() -> None:
    text = "e.o: /usr/include/a.h \\\n a\\ b.h ../c$$\\#.h\ne.o: x.h\n/abs/f.o: /g:h.h\nno rule\n"
    found = list(parse_make_rules(text, "/src/p"))
    assert found == ["/usr/include/a.h", "/src/p/a b.h", "/src/c$#.h", "/src/p/x.h", "/g:h.h"]


def test_a_list_has_a_file_on_each_line() -> None:
    assert list(parse_list("/usr/include/a b.h\n./x.h\n\n", "/src/p")) == ["/usr/include/a b.h", "/src/p/x.h"]


def test_sources_and_build_products_are_not_external_inputs(tree: Tree) -> None:
    root = tree(dict.fromkeys(("src/p/a", "tmp/made/a", "tmp/written", "VERSION", "python"), ""))
    traced = Traced(
        read={*(str(root / name) for name in ("src/p/a", "tmp/made/a", "tmp/written", "VERSION", "python"))},
        written={str(root / "tmp/written")},
        made={str(root / "tmp/made")},
        programs={str(root / "python")},
    )
    traced.read.update(("/proc/self/maps", "/dev/null", str(root)))
    assert external_files(traced, (), (str(root / "src/p"),)) == (str(root / "VERSION"),)


def test_missing_files_and_folder_listings_are_inputs(tree: Tree) -> None:
    root = tree({"shared/a": ""})
    traced = Traced(read={f"{root}/absent"}, listed={f"{root}/shared", f"{root}/gone", f"{root}/shared/a"})
    assert external_files(traced, (), ()) == (f"{root}/absent", f"{root}/shared/.")


def site(root: Path) -> Traced:
    """Return the trace of a program that imported all that is installed."""
    read = {str(path) for path in root.rglob("*.py")}
    return Traced(read=read, search_path={str(root / "site-packages")})


def test_a_large_distribution_is_identified_by_its_record_file(tree: Tree) -> None:
    names = ["big/__init__.py", *(f"big/sub/m{number}.py" for number in range(20)), "_other_name/x.py"]
    record = "".join(f"{name},,\n" for name in names)
    files = {f"site-packages/{name}": "" for name in names}
    root = tree(
        {
            **files,
            "site-packages/Big-1.0.dist-info/RECORD": record,
            "site-packages/other-1.dist-info/RECORD": "",
        }
    )
    assert external_files(site(root), (), ()) == (f"{root}/site-packages/Big-1.0.dist-info/RECORD",)


def test_small_distributions_and_single_modules_are_identified_by_their_files(tree: Tree) -> None:
    root = tree(
        {
            "site-packages/yaml/__init__.py": "",
            "site-packages/PyYAML-6.egg-info/PKG-INFO": "",
            "site-packages/PyYAML-6.egg-info/top_level.txt": "_yaml\nyaml\n",
            "site-packages/alone.py": "",
        }
    )
    names = ("PyYAML-6.egg-info/PKG-INFO", "alone.py", "yaml/__init__.py")
    assert external_files(site(root), (), ()) == tuple(f"{root}/site-packages/{name}" for name in names)


def test_a_missing_module_is_looked_for_beside_others(tree: Tree) -> None:
    root = tree({"lib/python3/os.py": "", "lib/python3/lib-dynload/x": "", "site-packages/a.py": ""})
    folders = ("lib/python3", "lib/python3/lib-dynload", "site-packages", "site-packages/a/_vendor", "absent")
    traced = Traced(
        missing={"mine": False, "Cython": True}, search_path={f"{root}/{name}" for name in folders}
    )
    names = ("Cython/__init__.py", "mine.py", "mine/__init__.py")
    assert external_files(traced, (), ()) == tuple(f"{root}/site-packages/{name}" for name in names)


@pytest.mark.parametrize(
    "words",
    [
        ["tool", "VERSION"],
        ["tool", "--version-file=VERSION"],
        ["sh", "-c", "cat VERSION | head -1"],
        ["sh", "-c", "cat 'VERSION'; exit # not 'closed"],
        ["sh", "-c", "cat <VERSION"],
        ["sh", "-c", "cat VERSION - <<end\nit's\nend\n"],
    ],
)
def test_a_command_line_names_files(words: list[str], tree: Tree) -> None:
    root = tree({"VERSION": ""})
    traced = Traced(started=[Started(str(root), words[0], tuple(words))])
    found = external_files(traced, (), ())
    assert [path for path in found if path.startswith(f"{root}/")] == [f"{root}/VERSION"]


def test_programs_libraries_and_include_folders_are_inputs(tree: Tree) -> None:
    root = tree({"bin/cc": "#!", "lib/liba.a": "", "lib/liba.so": "", "more/liba.a": "", "include/x.h": ""})
    words = ("cc", "-Lnone", "-Llib", f"-L{root}/more", "-la", "-lnowhere", "-Iinclude", "-Inone")
    traced = Traced(started=[Started(str(root), f"{root}/bin/cc", words)])
    found = external_files(traced, (), ())
    assert found == tuple(f"{root}/{name}" for name in ("bin/cc", "include/.", "lib/liba.so"))


@pytest.mark.parametrize("name", ["backend_tracer", "setup_install"])
def test_code_for_the_workspace_interpreter_runs_on_python_3_8(name: str) -> None:
    """The workspace's interpreter, and what a setup.py starts, may be older than forge's."""
    text = (ROOT / f"forge/build/wheels/{name}.py").read_text(encoding="utf-8")
    ast.parse(text, feature_version=(3, 8))
