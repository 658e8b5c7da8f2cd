"""forge and colcon on the same workspaces: what scripts read must be the same.

docs/reference/from-colcon.md lists what is meant to differ.
"""

import random
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import Forge, Ran, Tree
from tests.packages import manifest_text
from tests.peers import ROS, Colcon, colcon_in
from tests.random_workspaces import Shape, random_options, write_random_workspace
from tests.snippets import ROOT

pytestmark = [pytest.mark.slow, pytest.mark.needs("colcon")]

SEEDS = range(5)
LEFT_OUT = ("extension-points", "metadata", "version-check")
LEFT_OUT_OF = {"extensions": {"--all", "--verbose"}}
"""The commands, and the options of others, of which the page says so."""


@pytest.fixture(scope="module")
def colcon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Colcon]:
    with colcon_in(tmp_path_factory.mktemp("home"), COLCON_LOG_PATH="/dev/null") as running:
        yield running


def workspace(tmp_path: Path, seed: int, **shape: bool) -> Path:
    return write_random_workspace(tmp_path / "ws", random.Random(seed), Shape(**shape))


_UNKNOWN = re.compile(r"error: (--packages-select-by-dep: )?no package named")
"""Meant: an unknown name of a package to select is an error; see docs/reference/from-colcon.md."""


def both(colcon: Colcon, forge: Forge, root: Path, *argv: str) -> tuple[Ran, Ran]:
    ours = forge(*argv, cwd=root, env=ROS)
    theirs = colcon(*argv, cwd=root)
    if _UNKNOWN.match(ours.err):
        return theirs, theirs
    assert (ours.code == 0) == (theirs.code == 0), f"{argv}\n{ours}\n{theirs}"
    return ours, theirs


@pytest.mark.parametrize("seed", SEEDS)
def test_the_same_packages_are_found_and_selected_in_the_same_order(
    colcon: Colcon, forge: Forge, tmp_path: Path, seed: int
) -> None:
    root = workspace(tmp_path, seed)
    chance = random.Random(seed)
    for number, options in enumerate(([], *(random_options(chance) for _ in range(4)))):
        form = ["-t", chance.choice(("-n", "-p"))] if (seed + number) % 2 else []
        ours, theirs = both(colcon, forge, root, "list", *form, *options)
        assert ours.out == theirs.out, f"{form} {options}\n{theirs.err}"


@pytest.mark.parametrize("seed", SEEDS)
def test_graphs_are_the_same(colcon: Colcon, forge: Forge, tmp_path: Path, seed: int) -> None:
    root = workspace(tmp_path, seed, faults=False)
    chance = random.Random(seed)
    for number, options in enumerate(([], *(random_options(chance) for _ in range(2)))):
        if (seed + number) % 2:
            form = chance.choice(([], ["--density"]))
            ours, theirs = both(colcon, forge, root, "graph", *form, *options)
            assert ours.out == theirs.out, f"{form} {options}"
        else:
            form = chance.choice(([], ["--dot-include-skipped"], ["--dot-cluster"], ["--legend"]))
            ours, theirs = both(colcon, forge, root, "graph", "--dot", *form, *options)
            assert _parts(ours.out) == _parts(theirs.out), f"{form} {options}"


def _packages(info: str) -> str:
    """Return what `forge info` prints about packages. Meant: without names, it begins with the workspace."""
    return re.sub(r"workspace: .*\n(  .*\n)*", "", info, count=1)


@pytest.mark.parametrize("seed", SEEDS)
def test_info_prints_the_same(colcon: Colcon, forge: Forge, tmp_path: Path, seed: int) -> None:
    root = workspace(tmp_path, seed)
    for names in ([], ["a", "b", "nobody"]):
        ours, theirs = both(colcon, forge, root, "info", *names)
        # Meant: colcon prints how it reads Python's metadata, a function.
        said = re.sub(r"    get_python_setup_options: .*\n", "", theirs.out)
        assert (ours.out if names else _packages(ours.out)) == said


@pytest.mark.parametrize("seed", SEEDS[:2])
def test_both_tools_report_cycles(colcon: Colcon, forge: Forge, tmp_path: Path, seed: int) -> None:
    root = workspace(tmp_path, seed, cycles=True)
    for command in ("list", "graph", "info"):
        ours, _ = both(colcon, forge, root, command)
        assert ours.code != 0


@pytest.mark.parametrize("seed", SEEDS[:4])
def test_packages_with_the_same_name_are_both_listed(
    colcon: Colcon, forge: Forge, tmp_path: Path, seed: int
) -> None:
    root = workspace(tmp_path, seed, duplicates=True)
    chance = random.Random(seed)
    for options in ([], *(random_options(chance) for _ in range(2))):
        options = [word for word in options if word not in {"--packages-start", "--packages-end"}]
        ours, theirs = both(colcon, forge, root, "list", *options)
        assert ours.out == theirs.out, f"{options}"


def test_option_files_have_the_same_effect(colcon: Colcon, forge: Forge, tree: Tree) -> None:
    root = tree(
        {
            "src/a/package.xml": manifest_text("a", "<depend>b</depend>"),
            "src/b/package.xml": manifest_text("b"),
            "src/c/CMakeLists.txt": "project(c)",
            "src/c/colcon.pkg": "name: d\ntest-dependencies: [a]\n",
            "src/f/CMakeLists.txt": "project(f)\nfind_package(a)",
            "src/f/colcon.pkg": "name: f\ntype: cmake\ndependencies: [b]\n",
            "src/h/CMakeLists.txt": "project(h)\nfind_package(a)",
            "src/h/colcon.pkg": "type: cmake\n",
            "src/i/setup.py": "from setuptools import setup\n"
            "setup(name='i', version='1', install_requires=['a'])",
            "src/i/colcon.pkg": "name: i\ntype: python\n",
            "src/e/setup.py": "from setuptools import setup\n"
            "setup(name='e', version='1', install_requires=['a'])",
            "colcon.meta": "names: {a: {cmake-args: [-D1], hooks: [x.sh]}}\n"
            "paths: {src/b: {name: g, ctest-args: [x]}}",
            "more/colcon.meta": "names: {a: {cmake-args: [-D2]}, d: {dependencies: [g]}}",
            "colcon_defaults.yaml": "list: {packages-skip: [d], base-paths: [src]}\ngraph: {density: true}",
        }
    )
    for argv in (
        *(
            ["list"],
            ["list", "-t"],
            ["list", "--packages-skip"],
            ["graph"],
            ["graph", "--metas", "more", "gone"],
        ),
        *(["list", "--paths", "src/*"], ["list", "--base-paths", "."], ["list", "--names-only", "--metas"]),
    ):
        ours, theirs = both(colcon, forge, root, *argv)
        assert ours.out == theirs.out, f"{argv}"
    ours, theirs = both(colcon, forge, root, "info", "--metas", "colcon.meta", "more")
    assert _packages(ours.out) == re.sub(r"    get_python_setup_options: .*\n", "", theirs.out)


def test_the_same_version_mismatches_are_reported(colcon: Colcon, forge: Forge, tree: Tree) -> None:
    chance = random.Random(3)
    versions = ("0.1.0", "0.1", "0.2.0", "00.1.0", "1.0.0", "0.0.9", "0.1.0.1")
    words = ("lt", "lte", "eq", "gte", "gt")
    files = {"src/a/package.xml": manifest_text("a")}
    for number in range(30):
        asked = {word: chance.choice(versions) for word in chance.sample(words, chance.randrange(1, 3))}
        attributes = "".join(f' version_{word}="{version}"' for word, version in asked.items())
        tag = chance.choice(("depend", "test_depend", "build_depend", "doc_depend", "conflict"))
        name = f"b{number}"
        files[f"src/{name}/package.xml"] = manifest_text(name, f"<{tag}{attributes}>a</{tag}>")
    for number, asked_in_python in enumerate(
        ("a>=1,<2", "a~=0.1.0", "a~=0.2; python_version > '3'", "a==0.1", "a!=0.1")
    ):
        name = f"p{number}"
        said = f"[metadata]\nname={name}\nversion=1\n[options]\ninstall_requires=\n  {asked_in_python}\n"
        files |= {
            f"src/{name}/setup.cfg": said,
            f"src/{name}/setup.py": "from setuptools import setup\nsetup()",
        }
    root = tree(files)
    ours, theirs = both(colcon, forge, root, "list")
    assert ours.out == theirs.out
    found = re.findall(r"warning: '(\w+)' requires version [^']* of 'a'", ours.err)
    assert found
    assert sorted(found) == sorted(set(re.findall(r"(\w+) depends on a which has version", theirs.err)))


def options_of(text: str) -> set[str]:
    """Return the long options that a help text or a page names."""
    return set(re.findall(r"(?<![\w-])--[a-z][a-z-]*[a-z](?![\w-])", text))


def test_every_colcon_option_is_accepted(colcon: Colcon, forge: Forge, tmp_path: Path) -> None:
    """Forge takes each option that colcon's own help names, and the page has a word on it."""
    page = (ROOT / "docs/reference/from-colcon.md").read_text(encoding="utf-8")
    commands = re.findall(r"\{([a-z,-]+)\}", colcon("--help", cwd=tmp_path).out)[0].split(",")
    for command in ("", *commands):
        words = [*filter(None, [command]), "--help"]
        offered = options_of(colcon(*words, cwd=tmp_path).out) - {"--help"}
        assert offered <= options_of(page), command
        assert not command or f"`{command}`" in page
        if command not in LEFT_OUT:
            taken = options_of(forge(*words, cwd=tmp_path).out)
            assert offered - LEFT_OUT_OF.get(command, set()) <= taken, command


def _parts(text: str) -> list[str]:
    """Return the lines of a dot file in an order that does not depend on that of a set."""
    return sorted(re.sub(r"cluster_\d+", "cluster_N", line) for line in text.splitlines())
