"""Files in a prefix that no build installed are kept unchanged."""

import itertools
import os
import random
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.conftest import Forge, Ran, Tree
from tests.packages import manifest_text

pytestmark = pytest.mark.needs("cmake", "gcc")

EDITS = int(os.environ.get("FORGE_TEST_EDITS", "6"))
"""The number of edits in each of the four layouts; `make soak` asks for many."""
SEED = int(os.environ.get("FORGE_TEST_SEED", "1"))
CMAKE = """cmake_minimum_required(VERSION 3.18)
project(a C)
add_custom_target(slow ALL COMMAND sleep 0.1)
add_executable(x x.c)
install(TARGETS x DESTINATION bin)
install(DIRECTORY data/ DESTINATION share/a/data)
install(CODE [[
file(STRINGS "${CMAKE_CURRENT_LIST_DIR}/words" words)
execute_process(COMMAND sleep 0.05)
foreach(word IN LISTS words)
  file(WRITE "${CMAKE_INSTALL_PREFIX}/share/a/code/${word}" ${word})
endforeach()
]])
include(more.cmake OPTIONAL)
"""
SETUP = """from setuptools import setup
setup(name='p', version='1', packages=['p'], data_files=[('share/p', ['package.xml'])])
"""


def sources() -> dict[str, str]:
    """Return a package of CMake, which also installs by code, and one of Python."""
    return {
        "src/a/package.xml": manifest_text("a", build_type="cmake"),
        "src/a/CMakeLists.txt": CMAKE.replace("${CMAKE_CURRENT_LIST_DIR}", "@SOURCE@"),
        "src/a/x.c": "int main(void) { return 0; }\n",
        "src/a/data/one": "1",
        "src/a/words": "one\n",
        "src/p/package.xml": manifest_text("p", build_type="ament_python"),
        "src/p/setup.py": SETUP,
        "src/p/p/__init__.py": "",
        "src/p/p/one.py": "",
    }


class Others:
    """Somebody who puts files into an install folder; all that is there must stay."""

    def __init__(self, root: Path, source: random.Random) -> None:
        """Begin with a folder of their own elsewhere."""
        self._install = root / "install"
        self._home = root / "precious"
        self._home.mkdir()
        (self._home / "file").write_text("precious")
        self._random = source
        self._count = 0
        self._texts: dict[Path, str] = {}
        self._links: dict[Path, str] = {}
        self._folders: set[Path] = set()

    def put(self) -> None:
        """Create a file, a link or a folder in some folder of the install folder, or write to a file."""
        folders = [path for name, _, _ in os.walk(self._install) if self._is_folder(path := Path(name))][1:]
        if not folders:
            return
        folder = self._random.choice(folders)
        if self._random.random() < 0.3:
            folder /= self._random.choice(["deep", "share/a", "lib/deeper/deepest"])
        self._count += 1
        path = folder / f"mine {self._count}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._create(path)
        except FileNotFoundError:
            pass  # a build has just removed the folder

    def _create(self, path: Path) -> None:
        match self._random.randrange(7):
            case 0:
                path.symlink_to(self._home)
                self._links[path] = str(self._home)
            case 1:
                path.symlink_to("nowhere")
                self._links[path] = "nowhere"
            case 2:
                path.mkdir()
                self._folders.add(path)
            case 3 if self._texts:
                path = self._random.choice(sorted(self._texts))
                path.write_text(f"again {self._count}")
                self._texts[path] = f"again {self._count}"
            case _:
                text = str(self._count) * self._random.choice([1, 100_000])
                path.write_text(text)
                self._texts[path] = text
                if self._random.random() < 0.3:
                    os.utime(path, (1, 1))

    def _is_folder(self, path: Path) -> bool:
        names = path.relative_to(self._install).parts
        hidden = any(name.startswith(".") or name == "__pycache__" for name in names)
        return not hidden and path.is_dir() and not path.is_symlink()

    def check(self) -> None:
        """Everything is there, and as it was."""
        assert {path: path.read_text() for path in self._texts} == self._texts
        assert {path: str(path.readlink()) for path in self._links} == self._links
        assert [path for path in self._folders if not path.is_dir()] == []
        assert [path.name for path in self._home.iterdir()] == ["file"]
        assert (self._home / "file").read_text() == "precious"

    def take_back(self) -> None:
        """Remove everything, and the folders that were made for it."""
        for path in (*self._texts, *self._links):
            path.unlink()
        for name, _, _ in os.walk(self._install, topdown=False):
            if name != str(self._install) and not any(Path(name).iterdir()):
                Path(name).rmdir()


def edits(root: Path) -> tuple[Callable[[int], object], ...]:
    """Return edits of the sources; each takes a number."""
    a, p = root / "src/a", root / "src/p/p"
    more = a / "more.cmake"

    def toggle(path: Path, number: int) -> None:
        path.unlink() if path.exists() else path.write_text(str(number))

    return (
        lambda n: (a / "x.c").write_text(f"int main(void) {{ return {n % 100}; }}\n"),
        lambda n: toggle(a / f"data/{n % 3}", n),
        lambda n: (a / "words").write_text("\n".join(f"w{number}" for number in range(n % 4)) + "\n"),
        lambda n: toggle(p / f"m{n % 3}.py", 0),
        lambda n: (p / "one.py").write_text(f"x = {n}\n"),
        lambda n: more.write_text(f'install(CODE "message(FATAL_ERROR {n})")'),
        lambda _: more.unlink(missing_ok=True),
        lambda _: shutil.rmtree(root / "build"),
        lambda n: toggle(a / "new file", n),
    )


EVERY_LAYOUT = pytest.mark.parametrize(
    "options",
    [(), ("--merge-install",), ("--symlink-install",), ("--symlink-install", "--merge-install")],
    ids=["isolated", "merged", "linked", "linked-merged"],
)
FAILS = "install(CODE [[message(FATAL_ERROR no)]])\n"


@pytest.mark.slow
@EVERY_LAYOUT
def test_unowned_files_survive_random_edits(forge: Forge, tree: Tree, options: tuple[str, ...]) -> None:
    root = tree(sources())
    lists = root / "src/a/CMakeLists.txt"
    lists.write_text(lists.read_text().replace("@SOURCE@", str(root / "src/a")))
    source = random.Random(SEED)
    assert forge("build", *options, cwd=root).code == 0
    others, changes = Others(root, source), edits(root)
    for number in range(EDITS):
        for _ in range(source.randrange(3)):
            others.put()
        source.choice(changes)(number)
        started = subprocess.Popen(
            [sys.executable, "-m", "forge", "build", *options],
            cwd=root,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        while started.poll() is None:
            others.put()
            time.sleep(source.random() / 5)
        output = started.communicate()[0]
        assert "Traceback" not in output
        assert started.returncode in {0, 1}, output
        others.check()
    (root / "src/a/more.cmake").unlink(missing_ok=True)
    assert forge("build", *options, cwd=root).code == 0
    others.check()
    others.take_back()
    assert forge("build", *options, cwd=root).code == 0
    left = installed(root)
    for folder in ("build", "install"):
        shutil.rmtree(root / folder)
    assert forge("build", *options, cwd=root).code == 0
    clean = installed(root)
    if "--merge-install" in options:
        # No manifest lists what code has installed, so that it stays in a merged prefix.
        left = {path: content for path, content in left.items() if path in clean or "/code/" not in path}
    assert left == clean


def installed(root: Path) -> dict[str, bytes | str]:
    return {
        str(path.relative_to(root)): str(path.readlink()) if path.is_symlink() else path.read_bytes()
        for path in (root / "install").rglob("*")
        if (path.is_symlink() or path.is_file()) and "__pycache__" not in path.parts
    }


# --- one file, two owners


def plain(body: str) -> dict[str, str]:
    """Return a package that installs what the body says."""
    head = "cmake_minimum_required(VERSION 3.18)\nproject(a NONE)\ninstall(FILES x DESTINATION share/a)\n"
    return {
        "src/a/package.xml": manifest_text("a", build_type="cmake"),
        "src/a/CMakeLists.txt": f"{head}{body}\n",
        "src/a/x": "1",
        "src/a/d/f": "2",
    }


def refuse(ran: Ran, *words: str) -> None:
    """Expect the exit code 2, and an error with the two paths in conflict."""
    assert ran.code == 2, ran.out + ran.err
    for word in words:
        assert word in ran.err


MERGED = pytest.mark.parametrize("options", [(), ("--merge-install",)], ids=["isolated", "merged"])
LAYOUTS_AND_ENDS = pytest.mark.parametrize(
    ("options", "end"),
    [((), FAILS), (("--merge-install",), ""), (("--merge-install",), FAILS)],
    ids=["isolated-failing", "merged-well", "merged-failing"],
)


@MERGED
@pytest.mark.parametrize(
    "case",
    [
        ("install(FILES d/f DESTINATION share/a)", "share/a/f", "share/a/f"),
        ("install(FILES d/f DESTINATION share/a RENAME g)", "share/a/g/mine.txt", "share/a/g"),
        ('install(CODE "file(WRITE \\${CMAKE_INSTALL_PREFIX}/share/a/f 2)")', "share/a/f", "share/a/f"),
    ],
    ids=["file", "folder", "code"],
)
def test_installs_do_not_overwrite_unowned_files(
    forge: Forge, tree: Tree, options: tuple[str, ...], case: tuple[str, str, str]
) -> None:
    """The build fails with both paths, and everything is as it was; without that file it succeeds."""
    body, mine, theirs = case
    root = tree(plain(""))
    assert forge("build", *options, cwd=root).code == 0
    prefix = root / "install" / ("" if options else "a")
    path = prefix / mine
    path.parent.mkdir(exist_ok=True)
    path.write_text("mine")
    before = installed(root)
    lists = root / "src/a/CMakeLists.txt"
    lists.write_text(f"{lists.read_text()}{body}\n")
    for _ in range(2):
        refuse(forge("build", *options, cwd=root), str(path), str(prefix / theirs))
        assert installed(root) == before
    path.unlink()
    if mine != theirs:
        path.parent.rmdir()
    assert forge("build", *options, cwd=root).code == 0
    assert (prefix / theirs).read_text() == "2"


def test_a_file_is_not_installed_into_a_former_folder_of_another_package(forge: Forge, tree: Tree) -> None:
    """In a clean build, the folder would not exist."""

    def rules(destination_a: str, destination_b: str) -> dict[str, str]:
        texts = {
            "a": f"FILES x DESTINATION share{destination_a}",
            "b": f"FILES x DESTINATION share/{destination_b}",
        }
        head = "cmake_minimum_required(VERSION 3.18)\nproject(p NONE)\n"
        return {f"src/{name}/CMakeLists.txt": f"{head}install({text})\n" for name, text in texts.items()}

    manifests = {
        "src/a/package.xml": manifest_text("a", build_type="cmake"),
        "src/b/package.xml": manifest_text("b", "<depend>a</depend>", build_type="cmake"),
    }
    root = tree({**manifests, "src/a/x": "a", "src/b/x": "b", **rules("", "y")})
    assert forge("build", "--merge-install", cwd=root).code == 0
    tree(rules(" RENAME y", "z"))
    ran = forge("build", "--merge-install", cwd=root)
    refuse(ran, f"'a' installs the file '{root}/install/share/y'", f"'b' has '{root}/install/share/y/x'")
    assert "hint: if 'b' no longer installs it: 'forge clean packages b'" in ran.err
    assert forge("clean", "packages", "b", "--yes", cwd=root).code == 0
    assert forge("build", "--merge-install", cwd=root).code == 0
    assert (root / "install/share/y").read_text() == "a"


@MERGED
def test_files_of_an_unobserved_failed_build_do_not_block_the_next(
    forge: Forge, tree: Tree, options: tuple[str, ...]
) -> None:
    """It is unknown who wrote them, unless they existed before the build."""
    root = tree(plain(FAILS))
    lists = root / "src/a/CMakeLists.txt"
    share = root / "install" / ("" if options else "a") / "share/a"
    for _ in range(2):
        assert forge("build", "--no-observer", *options, cwd=root).code == 1
        assert (share / "x").is_file()
    text = lists.read_text().replace(FAILS, "install(FILES d/f DESTINATION share/a)\n")
    lists.write_text(text)
    (share / "f").write_text("mine")
    refuse(forge("build", "--no-observer", *options, cwd=root), str(share / "f"))
    assert (share / "f").read_text() == "mine"
    (share / "f").unlink()
    assert forge("build", "--no-observer", *options, cwd=root).code == 0
    lists.write_text(text.replace("install(FILES x DESTINATION share/a)\n", ""))
    assert forge("build", *options, cwd=root).code == 0
    assert not (share / "x").exists()


@MERGED
def test_a_pipe_or_folder_in_place_of_a_file_is_kept(
    forge: Forge, tree: Tree, options: tuple[str, ...]
) -> None:
    """CMake replaces the pipe, and changes the permissions of the folder."""
    root = tree(plain(""))
    assert forge("build", *options, cwd=root).code == 0
    share = root / "install" / ("" if options else "a") / "share/a"
    os.mkfifo(share / "pipe")
    (share / "folder").mkdir(mode=0o750)
    then = [(share / name).lstat() for name in ("pipe", "folder")]
    lists = root / "src/a/CMakeLists.txt"
    for name, status in zip(("pipe", "folder"), then, strict=True):
        (root / "src/a" / name).write_text("2")
        lists.write_text(f"{plain('')['src/a/CMakeLists.txt']}install(FILES {name} DESTINATION share/a)\n")
        refuse(forge("build", *options, cwd=root), str(share / name))
        assert (share / name).lstat()[:3] == status[:3]


@MERGED
@pytest.mark.parametrize(
    "command", ["rm -r SHARE/mine", "mv SHARE/mine SHARE/theirs", "rm -r SHARE/mine; touch SHARE/mine"]
)
def test_unowned_files_removed_by_install_code_are_restored(
    forge: Forge, tree: Tree, options: tuple[str, ...], command: str
) -> None:
    """After a build that fails, and after one that does not."""
    root = tree(plain(""))
    assert forge("build", *options, cwd=root).code == 0
    share = root / "install" / ("" if options else "a") / "share/a"
    for path in ("mine/deep/file", "mine/large"):
        (share / path).parent.mkdir(parents=True, exist_ok=True)
        (share / path).write_text("mine" * (50_000 if path.endswith("large") else 1))
    (share / "mine/empty").mkdir()
    before = {path: text for path, text in installed(root).items() if "mine" in path}
    lists = root / "src/a/CMakeLists.txt"
    script = command.replace("SHARE", "${CMAKE_INSTALL_PREFIX}/share/a")
    code = f'install(CODE [[execute_process(COMMAND sh -c "{script}" COMMAND_ERROR_IS_FATAL ANY)]])'
    good = lists.read_text()
    for end in (FAILS, ""):
        lists.write_text(f"{good}{code}\n{end}")
        ran = forge("build", *options, cwd=root)
        assert ran.code == (1 if end else 2 if "touch" in command else 0), ran.out + ran.err
        after = installed(root)
        assert {path: after.get(path) for path in before} == before
        assert (share / "mine/empty").is_dir()


SOME_LAYOUTS = pytest.mark.parametrize(
    "options", [(), ("--merge-install", "--symlink-install")], ids=["isolated", "linked-merged"]
)
WRITES = ("echo 2 >FILE", "echo 2 >>FILE", "truncate -s 1 FILE", "dd if=LISTS of=FILE conv=notrunc")


@SOME_LAYOUTS
@pytest.mark.parametrize("end", ["", FAILS], ids=["well", "failing"])
def test_unowned_files_modified_by_install_code_are_restored(
    forge: Forge, tree: Tree, options: tuple[str, ...], end: str
) -> None:
    """Small and large files, however they are written to."""
    root = tree(plain(""))
    assert forge("build", *options, cwd=root).code == 0
    share = root / "install" / ("" if "--merge-install" in options else "a") / "share/a"
    lists = root / "src/a/CMakeLists.txt"
    mine, lines = {}, []
    for number, (size, command) in enumerate(itertools.product((1, 100_000), WRITES)):
        mine[f"mine{number}"] = "mine" * size
        (share / f"mine{number}").write_text("mine" * size)
        file = f"${{CMAKE_INSTALL_PREFIX}}/share/a/mine{number}"
        lines.append(command.replace("FILE", file).replace("LISTS", str(lists)))
    code = (
        f'install(CODE [[execute_process(COMMAND sh -ec "{"; ".join(lines)}" COMMAND_ERROR_IS_FATAL ANY)]])'
    )
    lists.write_text(f"{lists.read_text()}{code}\n{end}")
    ran = forge("build", *options, cwd=root)
    assert ran.code == (1 if end else 2), ran.out + ran.err
    assert {name: (share / name).read_text() for name in mine} == mine


def test_a_package_may_later_write_a_file_that_was_unobserved(forge: Forge, built: Tree) -> None:
    """At first, the program that writes it is not observed."""
    write = "sh -c 'echo 2 > ${CMAKE_INSTALL_PREFIX}/share/a/f'"
    root = built(plain(f"install(CODE [[execute_process(COMMAND env -i {write})]])"))
    for text in (f"execute_process(COMMAND {write.replace('2', '3')})", "", "message(FATAL_ERROR no)"):
        lists = plain(f"install(CODE [[{text}]])")["src/a/CMakeLists.txt"]
        (root / "src/a/CMakeLists.txt").write_text(lists.replace("'", '"'))
        ran = forge("build", cwd=root)
        assert ran.code == (1 if "ERROR" in text else 0), ran.out + ran.err


@SOME_LAYOUTS
@pytest.mark.parametrize(
    "body",
    [
        "install(FILES d/f DESTINATION share/a/link)",
        "install(FILES d/f DESTINATION share/a RENAME link)",
        "install(DIRECTORY d/ DESTINATION share/a/link)",
        'install(CODE "file(WRITE \\${CMAKE_INSTALL_PREFIX}/share/a/file 2)")',
        'install(CODE "file(APPEND \\${CMAKE_INSTALL_PREFIX}/share/a/link/f 2)")',
        'install(CODE "file(REMOVE_RECURSE \\${CMAKE_INSTALL_PREFIX}/share/a/link/deep)")',
        'install(CODE "execute_process(COMMAND ln -sfn f \\${CMAKE_INSTALL_PREFIX}/share/a/file)")',
    ],
    ids=["file", "file over folder", "folder", "through", "append", "remove", "replace"],
)
def test_no_files_are_written_through_links_out_of_the_prefix(
    forge: Forge, tree: Tree, options: tuple[str, ...], body: str
) -> None:
    """The link of somebody else stays, and so does what is behind it, permissions included."""
    root = tree(plain(""))
    assert forge("build", *options, cwd=root).code == 0
    share = root / "install" / ("a" if "--merge-install" not in options else "") / "share/a"
    precious = tree({"precious/f": "mine", "precious/deep/g": "mine"}) / "precious"
    (share / "link").symlink_to(precious)
    (share / "file").symlink_to(precious / "f")
    (share / "unused").symlink_to("/nowhere")
    before = installed(root)
    lists = root / "src/a/CMakeLists.txt"
    lists.write_text(f"{lists.read_text()}{body}\n")
    # In a stage, there is nothing to remove, as in a clean build.
    has_stage = "REMOVE" in body and not options
    for _ in range(2):
        ran = forge("build", *options, cwd=root)
        if has_stage:
            assert ran.code == 0
        else:
            refuse(ran, str(share / ("file" if "/file" in body else "link")))
        now = installed(root)
        assert {path: now.get(path) for path in before if not has_stage or "/share/a/" in path} == {
            path: text for path, text in before.items() if not has_stage or "/share/a/" in path
        }
        assert {path.name: path.stat().st_mode & 0o777 for path in precious.rglob("*")} == {
            "f": 0o644,
            "deep": 0o755,
            "g": 0o644,
        }
        assert [(precious / path).read_text() for path in ("f", "deep/g")] == ["mine"] * 2
    for name in ("file", "link"):
        (share / name).unlink()
    lists.write_text(plain("install(FILES d/f DESTINATION share/a RENAME link)")["src/a/CMakeLists.txt"])
    assert forge("build", *options, cwd=root).code == 0
    assert str((share / "unused").readlink()) == "/nowhere"


@MERGED
def test_python_modules_are_not_installed_through_a_link(
    forge: Forge, tree: Tree, options: tuple[str, ...]
) -> None:
    files = {path: text for path, text in sources().items() if path.startswith("src/p/")}
    root = tree({**files, "precious/__init__.py": "mine = 1"})
    assert forge("build", *options, cwd=root).code == 0
    site = next((root / "install").rglob("p/one.py")).parents[1]
    (site / "q").symlink_to(root / "precious")
    setup = root / "src/p/setup.py"
    setup.write_text(setup.read_text().replace("['p']", "['p', 'q']"))
    (root / "src/p/q").mkdir()
    (root / "src/p/q/__init__.py").touch()
    for more in ((), ("--symlink-install",)):
        refuse(forge("build", *options, *more, cwd=root), str(site / "q"))
        assert (site / "q").readlink() == root / "precious"
        assert (root / "precious/__init__.py").read_text() == "mine = 1"


def test_cached_files_are_not_restored_through_a_link(forge: Forge, tree: Tree, tmp_path: Path) -> None:
    root = tree(plain("install(FILES d/f DESTINATION share/a/link)"))
    cache = ("--cache", str(tmp_path / "cache"))
    assert forge("build", *cache, cwd=root).code == 0
    for body in ("", "install(FILES d/f DESTINATION share/a/link)"):
        (root / "src/a/CMakeLists.txt").write_text(plain(body)["src/a/CMakeLists.txt"])
        if body:
            precious = tree({"precious/f": "mine"}) / "precious"
            link = root / "install/a/share/a/link"
            link.symlink_to(precious)
            refuse(forge("build", *cache, cwd=root), str(link))
            assert (precious / "f").read_text() == "mine"
        else:
            assert forge("build", *cache, cwd=root).code == 0


@MERGED
def test_a_link_in_place_of_an_installed_folder_is_not_followed(
    forge: Forge, tree: Tree, options: tuple[str, ...]
) -> None:
    root = tree(plain("install(DIRECTORY d DESTINATION share)"))
    assert forge("build", *options, cwd=root).code == 0
    folder = root / "install" / ("" if options else "a") / "share/d"
    precious = tree({"precious/f": "mine"}) / "precious"
    shutil.rmtree(folder)
    folder.symlink_to(precious)
    (root / "src/a/x").write_text("3")
    refuse(forge("build", *options, cwd=root), str(folder), str(precious))
    assert [path.name for path in precious.iterdir()] == ["f"]
    assert (precious / "f").read_text() == "mine"


@MERGED
@pytest.mark.parametrize("copied", [True, False], ids=["copied workspace", "second install folder"])
def test_files_of_another_install_folder_listed_by_a_build_folder_are_kept(
    forge: Forge, tree: Tree, options: tuple[str, ...], *, copied: bool
) -> None:
    """A copied build folder lists the links of the original workspace, which the next build leaves there."""
    python = {path: text for path, text in sources().items() if path.startswith("src/p/")}
    files = {**python, **plain("install(FILES d/f DESTINATION share/a)")}
    root = tree({f"first/{path}": text for path, text in files.items()}) / "first"
    options = ("--symlink-install", *options)
    assert forge("build", *options, cwd=root).code == 0
    first = installed(root)
    second = root
    if copied:
        second = root.with_name("second")
        shutil.copytree(root, second, symlinks=True)
    else:
        options = (*options, "--install-base", "other")
    for name in ("x", "d/f"):
        (second / "src/a" / name).write_text("3")
    (second / "src/p/p/one.py").write_text("x = 1\n")
    for more in ((), ("--force",)):
        assert forge("build", *options, *more, cwd=second).code == 0
        assert installed(root) == first
    (second / "src/a/CMakeLists.txt").write_text("no\n")
    assert forge("build", *options, cwd=second).code == 1
    assert installed(root) == first


def test_an_edited_file_is_kept_when_no_longer_installed(forge: Forge, built: Tree) -> None:
    root = built(plain("install(FILES d/f DESTINATION share/a)"))
    path = root / "install/a/share/a/f"
    path.write_text("edited")
    (root / "src/a/CMakeLists.txt").write_text(plain("")["src/a/CMakeLists.txt"])
    ran = forge("build", cwd=root)
    assert ran.code == 0
    assert f"kept '{path}'" in ran.err
    assert path.read_text() == "edited"


@LAYOUTS_AND_ENDS
def test_a_hard_linked_file_outside_the_prefix_is_restored(
    forge: Forge, tree: Tree, options: tuple[str, ...], end: str
) -> None:
    """A step that writes to a hard link in place writes to a file outside of the prefix."""
    root = tree({**plain(""), "precious": "mine"})
    assert forge("build", *options, cwd=root).code == 0
    link = root / "install" / ("" if options else "a") / "share/a/link"
    link.hardlink_to(root / "precious")
    then = link.stat()
    lists = root / "src/a/CMakeLists.txt"
    code = 'install(CODE "file(WRITE \\${CMAKE_INSTALL_PREFIX}/share/a/link 2)")'
    lists.write_text(f"{lists.read_text()}{code}\n{end}")
    assert forge("build", *options, cwd=root).code == (1 if end else 2)
    assert (root / "precious").read_text() == "mine"
    assert (link.samefile(root / "precious"), link.stat().st_mtime_ns) == (True, then.st_mtime_ns)


@MERGED
@pytest.mark.parametrize("end", ["", "message(FATAL_ERROR no)\n"], ids=["well", "failing"])
def test_unowned_scripts_next_to_scripts_of_a_package_are_kept(
    forge: Forge, tree: Tree, options: tuple[str, ...], end: str
) -> None:
    """Hooks of the user may have any name."""
    root = tree(plain(""))
    assert forge("build", *options, cwd=root).code == 0
    share = root / "install" / ("" if options else "a") / "share/a"
    mine = [share / name for name in ("hook/mine.dsv", "hook/mine.sh", "package.mine.sh", "package.txt")]
    for path in mine:
        path.parent.mkdir(exist_ok=True)
        path.write_text("mine")
    lists = root / "src/a/CMakeLists.txt"
    lists.write_text(f"{lists.read_text()}# changed\n{end}")
    assert forge("build", *options, cwd=root).code == (1 if end else 0)
    assert [path for path in mine if not path.is_file()] == []
    assert forge("clean", "packages", "a", "-y", cwd=root).code == 0
    assert [path for path in mine if not path.is_file()] == []


WAIT = 'turn=0; until [ -e "$1" ] || [ $((turn += 1)) -gt 600 ]; do sleep 0.05; done'
"""Waits for a file, for half a minute at most."""


@pytest.mark.parametrize("end", ["", "message(FATAL_ERROR no)"], ids=["well", "failing"])
def test_an_unowned_file_in_a_renamed_folder_is_kept(
    forge: Forge, tree: Tree, tmp_path: Path, end: str
) -> None:
    """The folder is the package's, the file is not."""
    code = f"""install(CODE [[
file(WRITE "${{CMAKE_INSTALL_PREFIX}}/draft/own" x)
file(RENAME "${{CMAKE_INSTALL_PREFIX}}/draft" "${{CMAKE_INSTALL_PREFIX}}/data")
execute_process(COMMAND sh {tmp_path}/wait.sh {tmp_path}/go)
{end}]])"""
    root = tree({**plain(code), "wait.sh": WAIT})
    with subprocess.Popen([sys.executable, "-m", "forge", "build"], cwd=root, stdout=subprocess.DEVNULL):
        while not (root / "install/a/data/own").exists():
            time.sleep(0.05)
        mine = root / "install/a/data/mine"
        mine.write_text("mine")
        (root / "go").touch()
    assert mine.is_file()
    assert (root / "install/a/data/own").exists() is not bool(end)
    (root / "src/a/CMakeLists.txt").write_text(plain("")["src/a/CMakeLists.txt"])
    assert forge("build", cwd=root).code == 0
    assert (mine.is_file(), (root / "install/a/data/own").exists()) == (True, False)


@LAYOUTS_AND_ENDS
@pytest.mark.parametrize(
    "command", ["rm -rf PREFIX", "rm -rf PREFIX/.forge*; rm -rf PREFIX", "mv PREFIX PREFIX.old"]
)
def test_a_step_that_removes_its_prefix_removes_no_unowned_files(
    forge: Forge, tree: Tree, options: tuple[str, ...], command: str, end: str
) -> None:
    """In a merged prefix, the copies of these files lie in the same folder."""
    root = tree(plain(""))
    assert forge("build", *options, cwd=root).code == 0
    prefix = root / "install" / ("" if options else "a")
    for path in (prefix / "mine", prefix / "share/a/mine", prefix / "setup.txt"):
        path.write_text("mine")
    lists = root / "src/a/CMakeLists.txt"
    script = command.replace("PREFIX", "${CMAKE_INSTALL_PREFIX}")
    lists.write_text(f'{lists.read_text()}install(CODE [[execute_process(COMMAND sh -c "{script}")]])\n{end}')
    ran = forge("build", *options, cwd=root)
    assert "Traceback" not in ran.err
    assert (ran.code, end) in {(0, ""), (1, end)}, ran.out + ran.err
    for path in (prefix / "mine", prefix / "share/a/mine", prefix / "setup.txt"):
        assert path.read_text() == "mine"


@MERGED
def test_a_file_written_at_a_formerly_installed_path_is_kept(
    forge: Forge, tree: Tree, options: tuple[str, ...]
) -> None:
    """Another package, or its owner, may write it while the package is built."""
    root = tree(plain("install(FILES d/f DESTINATION share/a)"))
    assert forge("build", *options, cwd=root).code == 0
    mine = root / "install" / ("" if options else "a") / "share/a/f"
    slow = "add_custom_target(slow ALL COMMAND sleep 0.5)"
    (root / "src/a/CMakeLists.txt").write_text(plain(slow)["src/a/CMakeLists.txt"])
    words = [sys.executable, "-m", "forge", "build", *options]
    with subprocess.Popen(words, cwd=root, stdout=subprocess.DEVNULL):
        while mine.exists():
            time.sleep(0.05)
        mine.parent.mkdir(parents=True, exist_ok=True)
        mine.write_text("mine")
    assert mine.read_text() == "mine"


STATIC = """#include <fcntl.h>
#include <unistd.h>
int main(int count, char **words) {
    int file = open(words[1], O_WRONLY | O_TRUNC);
    return count != 2 || write(file, "theirs", 6) != 6;
}
"""


@LAYOUTS_AND_ENDS
def test_files_changed_by_an_unobservable_program_are_kept(
    forge: Forge, tree: Tree, options: tuple[str, ...], end: str
) -> None:
    """Whether the package or the user has changed a file is unknown: both contents stay."""
    root = tree({**plain(""), "w.c": STATIC})
    if subprocess.run(["gcc", "-static", "-o", root / "w", root / "w.c"], check=False).returncode:
        pytest.skip("no static C library")
    assert forge("build", *options, cwd=root).code == 0
    share = root / "install" / ("" if options else "a") / "share/a"
    (share / "mine").write_text("mine")
    lists = root / "src/a/CMakeLists.txt"
    code = f"install(CODE [[execute_process(COMMAND {root}/w ${{CMAKE_INSTALL_PREFIX}}/share/a/mine)]])"
    lists.write_text(f"{lists.read_text()}{code}\n{end}")
    for _ in range(2):
        ran = forge("build", "--force", *options, cwd=root)
        assert ran.code == (1 if end else 0), ran.out + ran.err
    kept = share / "mine.before_build"
    assert ((share / "mine").read_text(), kept.read_text()) == ("theirs", "mine")
    assert sorted(path.name for path in share.glob("*build*")) == ["mine.before_build"]


def test_files_installed_by_unobserved_code_are_restored_without_a_record(
    forge: Forge, tree: Tree, tmp_path: Path
) -> None:
    """The list of installed files names it, too, so that no result without it is stored."""
    root = tree(plain('install(CODE "file(WRITE \\${CMAKE_INSTALL_PREFIX}/share/a/code 1)")'))
    options = ("--no-observer", "--cache", str(tmp_path / "cache"))
    assert forge("build", *options, cwd=root).code == 0
    (root / "build/forge_journal.jsonl").unlink()
    (root / "src/a/x").write_text("2")
    assert forge("build", *options, cwd=root).code == 0
    path = root / "install/a/share/a/code"
    path.write_text("edited")
    (root / "build/forge_journal.jsonl").unlink()
    assert "came from the cache" in forge("build", *options, cwd=root).out
    for folder in ("build", "install"):
        shutil.rmtree(root / folder)
    assert "came from the cache" in forge("build", *options, cwd=root).out
    assert path.read_text() == "1"


def test_unobserved_code_in_a_merged_prefix_leaves_no_copies(
    forge: Forge, tree: Tree, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a compiler, no step is observed, and no list names what code installs."""
    code = 'install(CODE "file(WRITE \\${CMAKE_INSTALL_PREFIX}/share/a/code %s)")'
    root = tree({**plain(code % 1), "bin/.keep": ""})
    for name in ("cmake", "ninja", "make", "python3", "sh"):
        (root / "bin" / name).symlink_to(shutil.which(name) or "/none")
    monkeypatch.setenv("PATH", str(root / "bin"))
    monkeypatch.setenv("FORGE_CACHE_DIR", str(root / "cache"))
    for number in (1, 2):
        (root / "src/a/CMakeLists.txt").write_text(plain(code % number)["src/a/CMakeLists.txt"])
        assert forge("build", "--merge-install", cwd=root).code == 0
        assert (root / "install/share/a/code").read_text() == str(number)
    assert not [*(root / "install").rglob("*.before_build")]


def test_unowned_files_are_kept_in_the_first_build(forge: Forge, tree: Tree) -> None:
    """A link in a merged prefix leads to files that are named like those of forge."""
    mine = {f"precious/share/a/{name}": "mine" for name in ("package.sh", "package.dsv", "hook/x.sh")}
    root = tree({**plain(""), **mine, "install/.keep": ""})
    (root / "install/share").symlink_to("../precious/share")
    refuse(forge("build", "--merge-install", cwd=root), f"{root}/install/share'")
    assert {path: (root / path).read_text() for path in mine} == mine
    assert sum(path.is_file() for path in (root / "precious").rglob("*")) == len(mine)


def test_all_kinds_of_unowned_entries_are_kept(
    forge: Forge, built: Tree, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = built(plain(""))
    prefix = root / "install/a"
    os.mkfifo(prefix / "pipe")
    monkeypatch.chdir(prefix)
    with socket.socket(socket.AF_UNIX) as own:
        own.bind("socket")
    (prefix / ".git").mkdir()
    (prefix / ".git/HEAD").write_text("ref")
    names = {path.name for path in prefix.iterdir()}
    (root / "src/a/x").write_text("2")
    assert forge("build", cwd=root).code == 0
    assert {path.name for path in prefix.iterdir()} == names


MOUNT = ("unshare", "--user", "--map-root-user", "--mount")


def test_files_below_a_mount_are_kept(tree: Tree) -> None:
    """A volume in a prefix is left alone, in an install folder that is being rebuilt."""
    if shutil.which("unshare") is None or subprocess.run((*MOUNT, "true"), check=False).returncode:
        pytest.skip("no mounts in a namespace on this machine")
    root = tree({**plain(""), "precious/p.txt": "mine"})
    script = f"""set -e
{sys.executable} -m forge build
mkdir -p install/a/data
mount --bind precious install/a/data
echo 2 > src/a/x
{sys.executable} -m forge build
echo 'message(FATAL_ERROR no)' >> src/a/CMakeLists.txt
{sys.executable} -m forge build && exit 1
test "$(cat install/a/data/p.txt install/a/share/a/x)" = "mine2"
"""
    ran = subprocess.run((*MOUNT, "sh", "-c", script), cwd=root, check=False, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert (root / "precious/p.txt").read_text() == "mine"
