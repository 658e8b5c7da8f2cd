"""After any change, what is installed is what a clean build installs: files, links, folders, rights.

And what comes out the same keeps its time, so that nobody compiles because of it.
"""

import itertools
import os
import re
import shutil
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.conftest import Forge, Ran, Tree
from tests.packages import manifest_text

pytestmark = [pytest.mark.needs("cmake")]

MERGED, LINKED = "--merge-install", "--symlink-install"
LAYOUTS = pytest.mark.parametrize("options", [(), (MERGED,), (LINKED,)], ids=["isolated", "merged", "linked"])
PLAIN = "cmake_minimum_required(VERSION 3.18)\nproject({name} {languages})\n{body}\n"


def cmake(name: str, body: str, *needs: str, languages: str = "NONE", **files: str) -> dict[str, str]:
    """Return the files of a package; '__' in a name is a folder, '_' before its last part a dot."""
    depends = (f"<depend>{need}</depend>" for need in needs)
    return {
        f"src/{name}/package.xml": manifest_text(name, *depends, build_type="cmake"),
        f"src/{name}/CMakeLists.txt": PLAIN.format(name=name, languages=languages, body=body),
        **{f"src/{name}/{path}": text for path, text in files.items()},
    }


def look(install: Path) -> dict[str, str]:
    """Return everything below an install folder: kinds, rights, contents; but for Python's own files."""
    found = {}
    for folder, folders, files in os.walk(install):
        folders[:] = [name for name in folders if name != "__pycache__"]
        for path in (f"{folder}/{name}" for name in (*folders, *files)):
            status = os.lstat(path)
            rights = f"{stat.S_IMODE(status.st_mode):o}"
            if stat.S_ISLNK(status.st_mode):
                said = f"link {Path(path).readlink()}"
            elif stat.S_ISDIR(status.st_mode):
                said = f"folder {rights}"
            else:
                said = f"{rights} {Path(path).read_bytes()!r}"
            found[os.path.relpath(path, install)] = said
    return found


def times(install: Path) -> dict[str, int]:
    """Return the times of all regular files but forge's own lists of them."""
    paths = (path for path in install.rglob("[!.]*/**/*") if path.is_file() and not path.is_symlink())
    return {str(path.relative_to(install)): path.stat().st_mtime_ns for path in paths}


def build(forge: Forge, root: Path, *options: str) -> Ran:
    ran = forge("build", *options, cwd=root)
    assert ran.code == 0, ran.out + ran.err
    return ran


def hold_against_clean(forge: Forge, root: Path, *options: str) -> None:
    """Build; the tree must be that of a clean build, which takes its place. Once more builds nothing."""
    build(forge, root, *options)
    again = build(forge, root, *options)
    assert "Starting" not in again.out
    found = look(root / "install")
    for folder in ("build", "install"):
        shutil.rmtree(root / folder)
    build(forge, root, *options)
    assert found == look(root / "install")


# --- what stays behind, what is in the way


def test_install_code_sees_the_prefix_as_in_a_clean_build(forge: Forge, tree: Tree) -> None:
    body = (
        'install(CODE "execute_process(COMMAND ln -s to ${CMAKE_INSTALL_PREFIX}/made)")\n'
        "install(FILES c.txt DESTINATION share)"
    )
    root = tree(cmake("a", body, **{"c.txt": "1"}))
    build(forge, root)
    tree({"src/a/c.txt": "2"})
    hold_against_clean(forge, root)
    (root / "install/a").chmod(0o750)
    before = look(root / "install")
    tree({"src/a/CMakeLists.txt": "message(FATAL_ERROR)\n"})
    assert forge("build", cwd=root).code == 1
    assert before == look(root / "install")


def test_a_file_is_reinstalled_when_another_package_stops_overwriting_it(forge: Forge, tree: Tree) -> None:
    body = "install(FILES c.txt DESTINATION share)"
    root = tree({**cmake("a", body, **{"c.txt": "a"}), **cmake("b", body, "a", **{"c.txt": "b"})})
    build(forge, root, MERGED)
    tree(cmake("b", "", "a"))
    build(forge, root, MERGED, "--packages-select", "b")
    hold_against_clean(forge, root, MERGED)
    assert (root / "install/share/c.txt").read_text() == "a"


SHAPES: Mapping[str, Mapping[str, str]] = {
    "a file": {"share/d/x": "file"},
    "a folder": {"share/d/x/y": "in it"},
    "a deep folder": {"share/d/x/y/z": "deep", "share/d/x/w": "w"},
    "another folder": {"share/d/x/other": "1", "share/d/q": "q"},
    "a link": {"share/d/x": "-> q", "share/d/q": "q"},
    "a link to a folder": {"share/d/x": "-> f", "share/d/f/k": "k"},
    "a dangling link": {"share/d/x": "-> nowhere"},
    "an empty folder": {"share/d/x/": ""},
    "nothing": {"share/d/q": "q"},
}


def shape(source: Path, shape: str) -> None:
    """Give the folder that is installed one of the shapes."""
    shutil.rmtree(source / "share/d", ignore_errors=True)
    for name, text in SHAPES[shape].items():
        path = source / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if name.endswith("/"):
            path.mkdir()
        elif text.startswith("-> "):
            path.symlink_to(text.removeprefix("-> "))
        else:
            path.write_text(text)


@pytest.mark.parametrize("merged", [False, True], ids=["isolated", "merged"])
def test_files_folders_and_links_can_replace_each_other(forge: Forge, tree: Tree, *, merged: bool) -> None:
    """From each shape into others, and a build that fails in between puts everything back."""
    root = tree(cmake("a", "include(more.cmake OPTIONAL)\ninstall(DIRECTORY share/d DESTINATION share)"))
    more = root / "src/a/more.cmake"
    options = (MERGED,) if merged else ()
    # A merged prefix is shared: who made an empty folder there nobody knows.
    names = [name for name in SHAPES if not (merged and name == "an empty folder")]
    clean = {}
    for name in names:
        shape(root / "src/a", name)
        build(forge, root, *options)
        clean[name] = look(root / "install")
        for folder in ("build", "install"):
            shutil.rmtree(root / folder)
    path = names
    if "FORGE_TEST_EDITS" in os.environ:
        path = list(itertools.chain.from_iterable(itertools.combinations(names, 2)))
    before = clean[names[-1]]
    build(forge, root, *options)
    for name in path:
        shape(root / "src/a", name)
        more.write_text("install(CODE [[message(FATAL_ERROR no)]])")
        assert forge("build", *options, cwd=root).code == 1
        left = look(root / "install")
        # In a merged prefix, new files of a build that failed are in no list.
        assert before.items() <= left.items() if merged else before == left, name
        more.unlink()
        build(forge, root, *options)
        before = look(root / "install")
        assert before == clean[name]


WITH_CODE = pytest.mark.parametrize("options", [(), (MERGED, LINKED)], ids=["isolated", "merged-linked"])


@WITH_CODE
def test_files_installed_by_cmake_code_belong_to_the_package(
    forge: Forge, tree: Tree, options: tuple[str, ...]
) -> None:
    """It is missed when it is deleted, and goes when nothing makes it any more."""
    code = (
        "install(CODE [[file(WRITE ${CMAKE_INSTALL_PREFIX}/share/{0}.txt hello)\n"
        "file(MAKE_DIRECTORY ${CMAKE_INSTALL_PREFIX}/var/{0})\n"
        "execute_process(COMMAND ln -sfn {0}.txt ${CMAKE_INSTALL_PREFIX}/share/{0}.link)]])"
    )
    root = tree(cmake("a", code.replace("{0}", "one")))
    build(forge, root, *options)
    prefix = root / "install" / ("" if MERGED in options else "a")
    for path in ("share/one.txt", "share/one.link"):
        (prefix / path).unlink()
        hold_against_clean(forge, root, *options)
    (prefix / "var/one").rmdir()
    hold_against_clean(forge, root, *options)
    (root / "src/a/CMakeLists.txt").write_text(
        PLAIN.format(name="a", languages="NONE", body=code.replace("{0}", "two"))
    )
    hold_against_clean(forge, root, *options)
    assert not (prefix / "share/one.txt").exists()


SETUP = """import os, subprocess, sys
from setuptools import setup
from setuptools.command.install import install
class Hook(install):
    def run(self):
        super().run()
        subprocess.run(["cp", "setup.py", f"{sys.prefix}/NAME.copied"], check=True)
        code = "import sys; open(sys.prefix + '/NAME.started', 'w')"
        subprocess.run([sys.executable, "-c", code], check=True)
        with open(os.path.join(self.install_data, "NAME.opened"), "w") as stream:
            stream.write("NAME")
        if os.path.exists("fail"):
            sys.exit(1)
setup(name="a", version="1", cmdclass={"install": Hook})
"""


@WITH_CODE
def test_files_installed_by_setup_py_code_belong_to_the_package(
    forge: Forge, tree: Tree, options: tuple[str, ...]
) -> None:
    """By itself, or by the programs that it starts."""
    manifest = manifest_text("a", build_type="ament_python")
    root = tree({"src/a/package.xml": manifest, "src/a/setup.py": SETUP.replace("NAME", "one")})
    build(forge, root, *options)
    prefix = root / "install" / ("" if MERGED in options else "a")
    for path in ("one.copied", "one.started", "one.opened"):
        (prefix / path).unlink()
        hold_against_clean(forge, root, *options)
    (root / "src/a/setup.py").write_text(SETUP.replace("NAME", "two"))
    hold_against_clean(forge, root, *options)
    assert not list(prefix.glob("one.*"))
    before = look(root / "install")
    (root / "src/a/setup.py").write_text(SETUP.replace("NAME", "three"))
    (root / "src/a/fail").write_text("")
    assert forge("build", *options, cwd=root).code == 1
    assert look(root / "install") == before


def test_folders_match_a_clean_build(forge: Forge, tree: Tree) -> None:
    """Empty folders appear and disappear, with current permissions."""
    root = tree(
        cmake(
            "a",
            "install(DIRECTORY DESTINATION var/spool)\n"
            "install(DIRECTORY d DESTINATION share USE_SOURCE_PERMISSIONS)",
            **{"d/f": "1"},
        )
    )
    build(forge, root)
    (root / "src/a/d").chmod(0o700)
    (root / "src/a/d/empty").mkdir()
    (root / "src/a/d/f").write_text("2")
    hold_against_clean(forge, root)
    assert look(root / "install")["a/share/d"] == "folder 700"
    (root / "src/a/d/empty").rmdir()
    (root / "src/a/d").chmod(0o755)
    lists = root / "src/a/CMakeLists.txt"
    lists.write_text(lists.read_text().replace("install(DIRECTORY DESTINATION var/spool)", ""))
    hold_against_clean(forge, root)
    assert not (root / "install/a/var").exists()


@pytest.mark.parametrize("options", [(), (MERGED,)], ids=["isolated", "merged"])
def test_hooks_follow_current_files(forge: Forge, tree: Tree, options: tuple[str, ...]) -> None:
    """A package that stops installing libraries, programs and its own setup."""
    everything = (
        "install(FILES x.so DESTINATION lib)\ninstall(PROGRAMS x.so DESTINATION bin)\n"
        "install(FILES local_setup.dsv DESTINATION share/a)"
    )
    files = {"x.so": "", "local_setup.dsv": "set;WORD;one\n"}
    root = tree(cmake("a", everything, **files))
    build(forge, root, *options)
    (root / "src/a/CMakeLists.txt").write_text(PLAIN.format(name="a", languages="NONE", body=""))
    hold_against_clean(forge, root, *options)
    tree(cmake("a", everything, **files))
    hold_against_clean(forge, root, *options)


def test_hooks_added_by_the_user_are_written(forge: Forge, tree: Tree) -> None:
    """By colcon.meta, of a package in which nothing else changed."""
    root = tree(cmake("a", "install(FILES x.sh DESTINATION share/a)", **{"x.sh": "WORD=1\n"}))
    build(forge, root)
    meta = root / "colcon.meta"
    meta.write_text('{"names": {"a": {"hooks": ["share/a/x.sh"]}}}')
    hold_against_clean(forge, root)
    assert "x.sh" in (root / "install/a/share/a/package.sh").read_text()
    meta.unlink()
    hold_against_clean(forge, root)


@LAYOUTS
def test_removed_workspace_scripts_are_recreated(forge: Forge, tree: Tree, options: tuple[str, ...]) -> None:
    """Deleted or edited by hand, they are written again, though there is nothing to build."""
    root = tree(cmake("a", ""))
    build(forge, root, *options)
    before = look(root / "install")
    scripts = sorted(path for path in (root / "install").iterdir() if "setup." in path.name)
    assert len(scripts) == 8
    for path in scripts:
        path.unlink()
        assert "Starting" not in build(forge, root, *options).out
        assert look(root / "install") == before
        path.write_text("exit 1\n")
        build(forge, root, *options)
        assert look(root / "install") == before


def test_files_of_earlier_builds_are_removed_without_records(forge: Forge, tree: Tree) -> None:
    """The build folder was removed, the install folder was not."""
    root = tree(cmake("a", "install(DIRECTORY d/ DESTINATION share/d)", **{"d/x": "1", "d/y": "1"}))
    build(forge, root)
    shutil.rmtree(root / "build")
    (root / "src/a/d/y").unlink()
    hold_against_clean(forge, root)


@pytest.mark.parametrize("options", [(LINKED,), (LINKED, MERGED)], ids=["isolated", "merged"])
def test_existing_links_are_reinstalled_without_records(
    forge: Forge, tree: Tree, options: tuple[str, ...]
) -> None:
    """CMake does not list links that exist, so their hooks and stale links would be lost from sight."""
    config = "install(FILES aConfig.cmake DESTINATION share/a/cmake)\n"
    files = {"aConfig.cmake": "", "d/x": "1", "d/y": "1"}
    root = tree(cmake("a", f"{config}install(DIRECTORY d/ DESTINATION share/d)", **files))
    build(forge, root, *options)
    shutil.rmtree(root / "build")
    (root / "src/a/d/y").unlink()
    hold_against_clean(forge, root, *options)


def test_a_failed_first_build_leaves_no_files(forge: Forge, tree: Tree) -> None:
    """Else they would stay for ever if the next one does not install them."""
    body = "install(FILES x DESTINATION share)\ninstall(CODE [[message(FATAL_ERROR no)]])"
    root = tree(cmake("a", body, x="1"))
    assert forge("build", cwd=root).code == 1
    assert not (root / "install/a").exists()
    assert not (root / "install/.forge_before").exists()


def test_the_build_after_a_kill_matches_a_clean_build(forge: Forge, tree: Tree, tmp_path: Path) -> None:
    """What was installed half-way goes; after Ctrl-C at once."""
    here = tmp_path / "here"
    wait = f"install(CODE [[file(WRITE {here} 1)\nexecute_process(COMMAND sleep 60)]])"
    root = tree(cmake("a", "install(FILES x DESTINATION share)", x="1"))
    build(forge, root)
    before = look(root / "install")
    lists = root / "src/a/CMakeLists.txt"
    good = lists.read_text()
    for number, ending in ((signal.SIGINT, "aborts"), (signal.SIGKILL, "fails"), (signal.SIGKILL, "works")):
        lists.write_text(f"{good}install(FILES x DESTINATION other)\n{wait}\n")
        here.unlink(missing_ok=True)
        with subprocess.Popen([sys.executable, "-m", "forge", "build"], cwd=root) as started:
            while not here.exists() and started.poll() is None:
                time.sleep(0.02)
            started.send_signal(number)
        if ending == "aborts":
            assert look(root / "install") == before
        if ending == "fails":
            lists.write_text("message(FATAL_ERROR no)")
            assert forge("build", cwd=root).code == 1
            assert look(root / "install") == before
    lists.write_text(good)
    build(forge, root)
    assert look(root / "install") == before


def test_a_prefix_that_is_a_link_remains_a_link(forge: Forge, tree: Tree, tmp_path: Path) -> None:
    """Somebody has moved it to a larger disk."""
    root = tree(cmake("a", "install(DIRECTORY d/ DESTINATION share/d)", **{"d/x": "1", "d/y": "1"}))
    build(forge, root)
    prefix, elsewhere = root / "install/a", tmp_path / "elsewhere"
    shutil.move(prefix, elsewhere)
    prefix.symlink_to(elsewhere)
    (root / "src/a/d/y").unlink()
    (root / "src/a/d/x").write_text("2")
    build(forge, root)
    assert prefix.is_symlink()
    assert [path.name for path in (elsewhere / "share/d").iterdir()] == ["x"]
    (root / "src/a/CMakeLists.txt").write_text("message(FATAL_ERROR no)")
    assert forge("build", cwd=root).code == 1
    assert (elsewhere / "share/d/x").read_text() == "2"


# --- times


@LAYOUTS
def test_unchanged_installed_files_keep_their_time(
    forge: Forge, tree: Tree, options: tuple[str, ...]
) -> None:
    """And what does not gets a new one, though CMake copies old times."""
    body = (
        "install(FILES x y DESTINATION share/a)\n"
        "install(FILES y DESTINATION share/a RENAME s PERMISSIONS {0})"
    )
    root = tree(cmake("a", body.replace("{0}", "OWNER_READ"), x="1", y="1"))
    build(forge, root, *options)
    before = times(root / "install")
    (root / "src/a/x").write_text("2")
    (root / "src/a/CMakeLists.txt").write_text(
        PLAIN.format(name="a", languages="NONE", body=body.replace("{0}", "OWNER_READ OWNER_WRITE"))
    )
    began = time.time_ns()
    build(forge, root, *options)
    after = times(root / "install")
    changed = {name.rpartition("/")[2] for name, at in after.items() if at != before[name]}
    assert changed <= {"x", "s"}
    if LINKED not in options:
        assert changed == {"x", "s"}
        assert all(at >= began - 20_000_000 for name, at in after.items() if at != before[name])


@LAYOUTS
@pytest.mark.needs("gcc", "ninja")
def test_a_changed_line_recompiles_only_its_file(forge: Forge, tree: Tree, options: tuple[str, ...]) -> None:
    """What includes its headers is linked again, not compiled."""
    library = (
        "add_library(base SHARED base.c)\n"
        "target_include_directories(base INTERFACE $<INSTALL_INTERFACE:include>)\n"
        "install(TARGETS base EXPORT base DESTINATION lib)\ninstall(FILES base.h DESTINATION include)\n"
        "install(EXPORT base DESTINATION share/base/cmake FILE baseConfig.cmake)"
    )
    files = cmake("base", library, languages="C", **{"base.h": "int base(void);\n"})
    files["src/base/base.c"] = "int base(void) { return 1; }\n"
    program = (
        "find_package(base REQUIRED)\nadd_executable(main main.c)\ntarget_link_libraries(main base)\n"
        "install(TARGETS main DESTINATION bin)"
    )
    main = {"main.c": "#include <base.h>\nint main(void) { return base(); }\n"}
    for number in range(2):
        files |= cmake(f"user{number}", program, "base", languages="C", **main)
    log = tree(files) / "compiled"
    compiler = (
        tree({"cc": f'#!/bin/sh\ncase " $* " in *" -c "*) echo "$*" >>{log};; esac\nexec gcc "$@"\n'}) / "cc"
    )
    asked = (*options, "--cmake-args", f"-DCMAKE_C_COMPILER={compiler}", "-GNinja")
    root = log.parent
    build(forge, root, *asked)
    log.unlink()
    (root / "src/base/base.c").write_text("int base(void) { return 2; }\n")
    build(forge, root, *asked)
    assert re.findall(r"[a-z]+\.c$", log.read_text(), re.MULTILINE) == ["base.c"]
    prefix = root / "install" / ("" if MERGED in options else "user0")
    assert (
        subprocess.run(
            [prefix / "bin/main"], check=False, env={"LD_LIBRARY_PATH": _libraries(root)}
        ).returncode
        == 2
    )


def _libraries(root: Path) -> str:
    return f"{root}/install/base/lib:{root}/install/lib"


# --- two packages, one file


def contested(name: str, *needs: str, text: str) -> dict[str, str]:
    """Return a package that installs a file that others install, too."""
    return cmake(name, "install(FILES c.txt DESTINATION share)", *needs, **{"c.txt": text})


@pytest.mark.parametrize("needs", [(), ("a",)], ids=["unrelated", "dependent"])
def test_two_packages_that_install_the_same_file_reach_a_stable_state(
    forge: Forge, tree: Tree, needs: tuple[str, ...]
) -> None:
    """The second build has nothing to do, and whichever changes, the last one wins as in a clean build."""
    root = tree({**contested("a", text="a"), **contested("b", *needs, text="b")})
    options = (MERGED, "--executor", "sequential")
    assert "warning" in build(forge, root, *options).err
    assert "Starting" not in build(forge, root, *options).out
    for path, text in (("src/a/c.txt", "aa"), ("src/b/c.txt", "bb")):
        (root / path).write_text(text)
        assert "warning" in build(forge, root, *options).err
        assert (root / "install/share/c.txt").read_text() == ("bb" if text == "bb" else "b")
        assert "Starting" not in build(forge, root, *options).out
    (root / "install/share/c.txt").write_text("by hand")
    hold_against_clean(forge, root, *options)
    (root / "src/a/c.txt").write_text("aaa")
    build(forge, root, *options, "--packages-select", "a")
    hold_against_clean(forge, root, *options)
    (root / "src/b/CMakeLists.txt").write_text(PLAIN.format(name="b", languages="NONE", body=""))
    hold_against_clean(forge, root, *options)
    assert (root / "install/share/c.txt").read_text() == "aaa"
    tree(contested("b", *needs, text="again"))
    build(forge, root, *options)
    hold_against_clean(forge, root, *options)


@pytest.mark.parametrize(
    "options", [(), (LINKED,), ("--no-observer",)], ids=["copied", "linked", "unobserved"]
)
def test_the_last_package_wins_even_if_an_earlier_one_takes_longer(
    forge: Forge, tree: Tree, options: tuple[str, ...]
) -> None:
    slow = "execute_process(COMMAND sleep 0.5)\ninstall(FILES c.txt DESTINATION share)"
    root = tree({**cmake("a", slow, **{"c.txt": "a"}), **contested("b", text="b")})
    for _ in range(2):
        build(forge, root, MERGED, *options)
        assert (root / "install/share/c.txt").read_text() == "b"
    assert "Starting" not in build(forge, root, MERGED, *options).out
    tree(cmake("a", slow, **{"c.txt": "edited"}))
    build(forge, root, MERGED, *options)
    assert (root / "install/share/c.txt").read_text() == "b"
    hold_against_clean(forge, root, MERGED, *options)


def test_a_folder_removed_by_another_package_is_recreated(forge: Forge, tree: Tree) -> None:
    """`b` begins, and with it the last file in `lib` is moved away, while `a` is about to make `lib/a`."""
    wait = (
        "file(MAKE_DIRECTORY ${{CMAKE_INSTALL_PREFIX}}/lib)\n"
        "file(TOUCH ${{CMAKE_CURRENT_LIST_DIR}}/../begun{edition})\n"
        "foreach(i RANGE 20)\n"
        "  if({edition} EQUAL 1 OR NOT EXISTS ${{CMAKE_INSTALL_PREFIX}}/lib)\n    break()\n  endif()\n"
        "  execute_process(COMMAND sleep 0.1)\nendforeach()\n"
        "execute_process(COMMAND mkdir ${{CMAKE_INSTALL_PREFIX}}/lib/a RESULT_VARIABLE code)\n"
        "if(code)\n  message(FATAL_ERROR no)\nendif()\n"
    )
    install_b = "install(FILES b.txt DESTINATION lib)"
    until = 'execute_process(COMMAND sh -c "until [ -e ../begun{edition} ]; do sleep 0.1; done")'

    def edition(number: int) -> dict[str, str]:
        code = wait.format(edition=number)
        return {
            **cmake("a", f"install(CODE [==[{code}]==])\ninstall(FILES x DESTINATION lib/a)", x="x"),
            **cmake("c", until.format(edition=number)),
            **cmake("b", f"execute_process(COMMAND sleep 1)\n{install_b}", "c", **{"b.txt": str(number)}),
        }

    root = tree(edition(1))
    build(forge, root, MERGED, "--no-observer")
    tree(edition(2))
    build(forge, root, MERGED, "--no-observer")
    assert (root / "install/lib/a/x").read_text() == "x"
    assert (root / "install/lib/b.txt").read_text() == "2"


# --- what else an install step copies


def test_an_installed_external_folder_remains_an_input(forge: Forge, tree: Tree) -> None:
    """Also after a build that began in an empty folder, but had little to install."""
    body = (
        "file(READ ../../conf conf)\nfile(WRITE ${CMAKE_BINARY_DIR}/conf.txt ${conf})\n"
        "install(FILES ${CMAKE_BINARY_DIR}/conf.txt DESTINATION share)\n"
        "install(DIRECTORY ../../elsewhere/ DESTINATION share/elsewhere)"
    )
    root = tree({**cmake("a", body), "conf": "1", "elsewhere/x": "1"})
    build(forge, root)
    for files in ({"conf": "2"}, {"elsewhere/x": "2"}, {"elsewhere/d/y": "1"}):
        tree(files)
        build(forge, root)
        assert look(root / "elsewhere") == look(root / "install/a/share/elsewhere")
    hold_against_clean(forge, root)


@pytest.mark.parametrize(
    "body",
    [
        "install(DIRECTORY d DESTINATION share USE_SOURCE_PERMISSIONS)",
        "file(COPY d DESTINATION ${CMAKE_BINARY_DIR})\n"
        "install(DIRECTORY ${CMAKE_BINARY_DIR}/d DESTINATION share USE_SOURCE_PERMISSIONS)",
    ],
)
def test_folders_are_copied_with_changed_modes(forge: Forge, tree: Tree, body: str) -> None:
    root = tree(cmake("a", body, **{"d/e/x": "1"}))
    build(forge, root)
    for name, mode in (("d/e", 0o700), ("d", 0o750), ("d/e", 0o755)):
        (root / "src/a" / name).chmod(mode)
        build(forge, root)
        assert stat.S_IMODE((root / "install/a/share" / name).stat().st_mode) == mode
    hold_against_clean(forge, root)


def test_a_changed_umask_changes_installed_permissions(forge: Forge, tree: Tree) -> None:
    body = (
        "file(WRITE ${CMAKE_BINARY_DIR}/d/x 1)\n"
        "install(DIRECTORY ${CMAKE_BINARY_DIR}/d DESTINATION . USE_SOURCE_PERMISSIONS)"
    )
    root = tree(cmake("a", body))
    build(forge, root)
    before = os.umask(0o027)
    try:
        build(forge, root)
        found = look(root / "install/a")
        assert (found["d"], found["d/x"]) == ("folder 750", "640 b'1'")
        assert {text[:3] for text in found.values() if not text.startswith("folder")} == {"640"}
        assert "Starting" not in build(forge, root).out
    finally:
        os.umask(before)


@pytest.mark.needs("g++")
def test_outputs_of_another_target_are_not_installed_later(forge: Forge, tree: Tree) -> None:
    body = "add_executable(x EXCLUDE_FROM_ALL x.c)\ninstall(TARGETS x OPTIONAL DESTINATION bin)"
    root = tree(cmake("a", body, languages="C", **{"x.c": "int main(void) { return 0; }"}))
    build(forge, root, "--cmake-target", "x")
    assert (root / "install/a/bin/x").is_file()
    hold_against_clean(forge, root)
    assert not (root / "install/a/bin/x").exists()


def test_a_file_in_place_of_a_folder_is_reported(forge: Forge, tree: Tree) -> None:
    root = tree(
        cmake(
            "a", "file(WRITE ${CMAKE_BINARY_DIR}/a)\ninstall(FILES ${CMAKE_BINARY_DIR}/a DESTINATION share)"
        )
    )
    ran = forge("build", cwd=root)
    assert ran.code == 2
    assert "a file is in place of one of its folders" in ran.err
    assert "hint: move that file, or let its package install it elsewhere" in ran.err
