"""Special files where forge and its tools read: nothing hangs or crashes.

Each command runs in a separate process, with a limit on its time and on its memory.
"""

import os
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import Tree
from tests.packages import manifest_text

pytestmark = pytest.mark.needs("cmake")

SECONDS = 60
KILOBYTES = 900_000
CMAKE = """cmake_minimum_required(VERSION 3.18)
project(a NONE)
install(FILES said.txt DESTINATION share/a)
"""


@pytest.fixture
def root(tree: Tree) -> Path:
    """Make a workspace with the package 'a', not built."""
    return tree(
        {
            "src/a/package.xml": manifest_text("a", build_type="cmake"),
            "src/a/CMakeLists.txt": CMAKE,
            "src/a/said.txt": "said\n",
        }
    )


def run(root: Path, *words: str, line: str = 'exec "$@"', lines: int = 1) -> tuple[int, str]:
    """Return exit code and output of forge, started by a line of sh under a memory limit."""
    command = (sys.executable, "-m", "forge", *words)
    done = subprocess.run(
        ("sh", "-c", f"ulimit -v {KILOBYTES}; {line}", "sh", *command),
        cwd=root,
        env={**os.environ, "COLCON_HOME": str(root / "home")},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        timeout=SECONDS,
        check=False,
    )
    assert "Traceback" not in done.stdout, done.stdout
    assert lines == 0 or done.stdout
    return done.returncode, done.stdout


def make_device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def make_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as end:
        end.bind(os.path.relpath(path))


KINDS = {
    "named pipe": (os.mkfifo, "it is a named pipe, not a regular file"),
    "device": (make_device, "it is a device, not a regular file"),
    "socket": (make_socket, "it is a socket, not a regular file"),
    "folder": (lambda path: path.mkdir(), "s a directory"),
}


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        *(("src/b/package.xml", kind) for kind in KINDS),
        ("src/a/colcon.pkg", "socket"),
        ("forge.toml", "named pipe"),
        ("colcon_defaults.yaml", "device"),
    ],
)
def test_special_files_in_place_of_text_files_are_rejected(
    root: Path, name: str, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(root)
    make, reason = KINDS[kind]
    path = root / name
    path.parent.mkdir(exist_ok=True)
    make(path)
    code, said = run(root, "build")
    assert code == 2
    assert name in said
    assert reason in said
    code, said = run(root, "list", lines=0)
    assert code in {0, 2}


@pytest.mark.parametrize(
    ("name", "kind"), [("CMakeLists.txt", "named pipe"), ("setup.py", "device"), ("pyproject.toml", "socket")]
)
def test_a_folder_with_a_special_file_as_manifest_is_ignored_with_a_warning(
    root: Path, name: str, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(root)
    make, reason = KINDS[kind]
    (root / "src/b").mkdir()
    make(root / "src/b" / name)
    code, said = run(root, "build")
    assert code == 0
    assert f"src/b/{name}: warning: ignored: {reason}" in said
    assert "1 package finished" in said


@pytest.mark.parametrize(
    ("name", "build_type"),
    [("CMakeLists.txt", "cmake"), ("setup.py", "ament_python"), ("setup.cfg", "ament_python")],
)
def test_special_files_that_block_builds_are_rejected(root: Path, name: str, build_type: str) -> None:
    assert run(root, "build")[0] == 0
    (root / "src/a/package.xml").write_text(manifest_text("a", build_type=build_type))
    (root / "src/a" / name).unlink(missing_ok=True)
    os.mkfifo(root / "src/a" / name)
    code, said = run(root, "build")
    assert code == 2
    assert f"src/a/{name}: error: cannot read the file: it is a named pipe" in said
    assert (root / "install/a/share/a/said.txt").is_file()


def test_special_files_that_no_step_opens_give_warnings(root: Path) -> None:
    """CMake opens the files that CMakeLists.txt names, and no others."""
    names = ("part/CMakeLists.txt", "setup.py", "setup.cfg", "options.cmake", "part/x.cpp", "msg/X.msg")
    for name in names:
        (root / "src/a" / name).parent.mkdir(exist_ok=True)
        os.mkfifo(root / "src/a" / name)
    code, said = run(root, "build")
    assert code == 0
    for name in names:
        warning = f"src/a/{name}: warning: cannot read the file: it is a named pipe, not a regular file\n"
        assert warning in said
    assert "hint: a program that opens it would wait or read without end\n" in said
    assert "1 package unchanged" in run(root, "build")[1]


def test_special_files_that_no_tool_opens_are_accepted(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(root)
    os.mkfifo(root / "src/a/pipe")
    make_socket(root / "src/a/socket")
    make_device(root / "src/a/zero.bin")
    (root / "src/a/empty.h").symlink_to(os.devnull)
    (root / "src/a/itself").symlink_to("itself")
    (root / "src/a/nowhere").symlink_to("not there")
    assert run(root, "build")[0] == 0
    assert "1 package unchanged" in run(root, "build")[1]
    assert run(root, "doctor")[0] in {0, 1}


def test_the_null_device_is_an_empty_file(root: Path) -> None:
    (root / "forge.toml").symlink_to(os.devnull)
    (root / "colcon.meta").symlink_to(os.devnull)
    assert run(root, "build")[0] == 0


def test_named_pipes_as_test_results_do_not_block(root: Path) -> None:
    run(root, "build")
    os.mkfifo(root / "build/a/result.xml")
    os.mkfifo(root / "build/a/CTestTestfile.cmake")
    assert run(root, "test")[0] == 0
    code, said = run(root, "test-result")
    assert (code, said.splitlines()[-1]) == (0, "Summary: 0 tests, 0 errors, 0 failures, 0 skipped")


def test_sources_can_be_larger_than_memory(root: Path) -> None:
    with (root / "src/a/large.bin").open("wb") as stream:
        stream.truncate(1 << 30)
    assert run(root, "build")[0] == 0
    assert "1 package unchanged" in run(root, "build")[1]


def test_unreadable_result_folders_are_reported(root: Path) -> None:
    assert run(root, "build")[0] == 0
    results = root / "build"
    results.chmod(0)
    try:
        code, said = as_nobody(root, "test-result")
        assert code == 1
        assert "build" in said
        assert "permission denied" in said.lower()
    finally:
        results.chmod(0o755)


def test_unreadable_folders_are_reported(root: Path) -> None:
    secret = root / "src/secret"
    secret.mkdir()
    shutil.copy(root / "src/a/package.xml", secret)
    secret.chmod(0)
    try:
        code, said = as_nobody(root, "list")
        assert code == 0
        assert "src/secret: warning: ignoring unreadable folder: permission denied" in said
        (root / "src/a/package.xml").chmod(0)
        code, said = as_nobody(root, "list")
        assert "src/a/package.xml" in said
        assert "cannot read the manifest: Permission denied" in said
    finally:
        secret.chmod(0o755)


def as_nobody(root: Path, *words: str) -> tuple[int, str]:
    """Run forge as a user whom rights bind.

    It runs twice in one process, which loses its rights in between: the interpreter may be root's alone.
    """
    code = (
        "import os, sys\n"
        "from forge.cli.main import main\n"
        "main(sys.argv[1:])\n"
        "print('again', flush=True)\n"
        "os.geteuid() or os.seteuid(65534)\n"
        "sys.exit(main(sys.argv[1:]))\n"
    )
    for folder in (root, *root.parents) if not os.geteuid() else ():
        if folder.name.startswith(("test_", "popen-", "pytest-")):
            folder.chmod(0o755)
    done = subprocess.run(
        (sys.executable, "-c", code, *words),
        cwd=root,
        env={**os.environ, "COLCON_HOME": str(root / "home")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    return done.returncode, done.stdout.partition("again\n")[2]


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("build/a", "the build folder '{root}/build/a' of 'a' is a file"),
        ("install/a", "the install folder '{root}/install/a' of 'a' is a file"),
        ("install/a/share", "'{root}/install/a/share', where 'a' installed files, is no longer a folder"),
    ],
)
def test_a_file_in_place_of_a_folder_is_rejected(root: Path, path: str, message: str) -> None:
    run(root, "build")
    shutil.rmtree(root / path)
    (root / path).write_text("precious\n")
    code, said = run(root, "build", "--force")
    assert code == 2
    assert message.format(root=root) in said
    assert (root / path).read_text() == "precious\n"
    (root / path).unlink()
    assert run(root, "build")[0] == 0
    assert (root / "install/a/share/a/said.txt").is_file()


@pytest.mark.parametrize("layout", ["", "--merge-install"])
def test_a_folder_in_place_of_an_installed_file_is_rejected(root: Path, layout: str) -> None:
    options = [layout] if layout else []
    run(root, "build", *options)
    path = root / f"install/{'' if layout else 'a/'}share/a/said.txt"
    path.unlink()
    path.mkdir()
    (path / "precious").touch()
    code, said = run(root, "build", *options)
    assert code == 2
    assert f"'{path}', installed as a file by 'a', is now a folder" in said
    assert [entry.name for entry in path.iterdir()] == ["precious"]
    shutil.rmtree(path)
    assert run(root, "build", *options)[0] == 0
    assert path.read_text() == "said\n"


@pytest.mark.parametrize(
    ("words", "closed"),
    [
        *(("build", closed) for closed in (">&-", "2>&-", "<&-", "<&- >&- 2>&-")),
        *((words, "<&- >&- 2>&-") for words in ("build --json", "list", "graph")),
    ],
)
def test_closed_standard_streams_are_not_an_error(root: Path, words: str, closed: str) -> None:
    code, _ = run(root, *words.split(), line=f'exec "$@" {closed}', lines=0)
    assert code == 0
    for name in ("build/forge_journal.jsonl", "install/.forge.json"):
        # Nothing that was printed went into a file that happened to have the number of a closed stream.
        assert not (root / name).exists() or b"Finished" not in (root / name).read_bytes()


@pytest.mark.needs("/dev/full")
@pytest.mark.parametrize(
    ("words", "unbuffered"), [(("list",), ""), (("build",), ""), (("build",), "1"), (("graph",), "1")]
)
def test_unwritable_outputs_are_reported(
    root: Path, words: tuple[str, ...], unbuffered: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONUNBUFFERED", unbuffered)
    code, said = run(root, *words, line='"$@" 2>&1 >/dev/full')
    assert code == 2
    assert said == "error: cannot write to the standard output: no space left on device\n"
    code, said = run(root, *words, line='exec "$@" 1</dev/null', lines=0)
    assert code in {2, 130}


def test_a_closed_pipe_ends_listings_silently(root: Path) -> None:
    code, said = run(root, "list", line='"$@" 2>&1 | :; "$@" | head -c 1', lines=0)
    assert code == 0
    assert said == "a"


NAMES = (
    "xa\nxb",
    "xa",
    "xb",
    "c;d",
    "e\n",
    "g\rh",
    "i\u2028j",
    "k;",
    "l\n\nm",
    "n;o;p",
    "q;r\ns",
    'v"w',
    "ä",
)
NO_UTF8 = os.fsdecode(b"\xff\xfe\n.txt")


def installed(root: Path) -> set[str]:
    return {path.name for path in (root / "install").rglob("*") if path.is_file()}


@pytest.mark.parametrize("options", [(), ("--merge-install", "--symlink-install")])
def test_names_with_line_breaks_and_semicolons_are_installed_and_removed(
    root: Path, options: tuple[str, ...]
) -> None:
    text = CMAKE.replace("(FILES said.txt ", "(DIRECTORY d/ ")
    (root / "src/a/CMakeLists.txt").write_text(text)
    folder = root / "src/a/d"
    folder.mkdir()
    for name in (*NAMES, NO_UTF8):
        (folder / name).write_text("x")
    assert run(root, "build", *options)[0] == 0
    assert installed(root) >= {*NAMES, NO_UTF8}
    assert "1 package unchanged" in run(root, "build", *options)[1]
    shutil.rmtree(folder)
    folder.mkdir()
    (folder / "kept").touch()
    assert run(root, "build", *options)[0] == 0
    assert installed(root).isdisjoint({*NAMES, NO_UTF8})
    assert "kept" in installed(root)


PYTHON = {
    "src/p/package.xml": manifest_text("p", build_type="ament_python"),
    "src/p/setup.py": "from setuptools import setup\n"
    "setup(name='p', version='1', packages=['p'], package_data={'p': ['*.txt']})\n",
    "src/p/p/__init__.py": "",
}


@pytest.mark.parametrize("options", [(), ("--merge-install", "--symlink-install")])
def test_an_empty_python_package_folder_is_not_an_installed_file(
    tree: Tree, options: tuple[str, ...]
) -> None:
    root = tree(PYTHON)
    setup = root / "src/p/setup.py"
    launch = "data_files=[('share/p/launch', glob('launch/*'))])"
    setup.write_text("from glob import glob\n" + setup.read_text().replace("})\n", f"}}, {launch}\n"))
    folder = root / "install" / ("" if "--merge-install" in options else "p") / "share/p/launch"
    assert run(root, "build", *options)[0] == 0
    assert folder.is_dir()
    (folder / "precious").touch()
    file = root / "src/p/launch/a.py"
    file.parent.mkdir()
    file.touch()
    assert run(root, "build", *options)[0] == 0
    assert {path.name for path in folder.iterdir()} == {"a.py", "precious"}
    file.unlink()
    assert run(root, "build", *options)[0] == 0
    setup.write_text(f"{setup.read_text()}# changed\n")
    assert run(root, "build", *options)[0] == 0
    assert [path.name for path in folder.iterdir()] == ["precious"]


def test_a_wheel_with_line_breaks_in_names_is_installed_and_removed(tree: Tree) -> None:
    root = tree(PYTHON)
    names = ("a\nb.txt", 'c,d "q".txt', "e\u2028f.txt")
    for name in names:
        (root / "src/p/p" / name).write_text("x")
    code, said = run(root, "build")
    assert code == 0, said
    assert installed(root) >= set(names)
    for name in names:
        (root / "src/p/p" / name).unlink()
    assert run(root, "build")[0] == 0
    assert installed(root).isdisjoint(names)


def test_a_file_name_that_wheels_cannot_contain_is_rejected(tree: Tree) -> None:
    root = tree(PYTHON)
    (root / "src/p/p" / os.fsdecode(b"\xff.txt")).touch()
    code, said = run(root, "build")
    assert code == 1
    assert r"src/p: error: the file name b'p/\xff.txt' is not UTF-8" in said


def test_files_removed_by_the_package_itself_are_not_missing(root: Path) -> None:
    line = r'install(CODE "file(REMOVE \${CMAKE_INSTALL_PREFIX}/share/a/said.txt)")'
    (root / "src/a/CMakeLists.txt").write_text(f"{CMAKE}{line}\n")
    assert run(root, "build")[0] == 0
    assert "1 package unchanged" in run(root, "build")[1]


@pytest.mark.parametrize(
    "variables",
    [
        {"LC_ALL": "C"},
        {"LC_ALL": "C", "PYTHONUTF8": "0"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": "ascii"},
    ],
)
def test_non_ascii_paths_work_in_the_c_locale(
    tree: Tree, variables: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    files = {
        **PYTHON,
        "src/p/p/ö.txt": "x",
        "src/a/package.xml": manifest_text("a", build_type="cmake"),
        "src/a/CMakeLists.txt": CMAKE.replace("said.txt", "ß.txt"),
        "src/a/ß.txt": "ß",
    }
    root = tree({f"bäh/{name}": text for name, text in files.items()}) / "bäh"
    code, said = run(root, "build")
    assert code == 0, said
    assert installed(root) >= {"ö.txt", "ß.txt"}
    assert "2 packages unchanged" in run(root, "build")[1]
    assert run(root, "clean", "packages", "p", "-y", lines=0)[0] == 0
    assert "ö.txt" not in installed(root)


@pytest.mark.parametrize(
    "words",
    [
        ("-GNinja Multi-Config",),
        ("-G", "Ninja Multi-Config"),
        ("-GNinja", "-G", "Ninja Multi-Config"),
        (),
    ],
)
def test_multi_configuration_generators_are_rejected(
    root: Path, words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("CMAKE_GENERATOR", raising=False)
    if not words:
        monkeypatch.setenv("CMAKE_GENERATOR", "Ninja Multi-Config")
    code, said = run(root, "build", "--cmake-args", *words)
    assert code == 2
    assert said.startswith("error: 'a' cannot be built with 'Ninja Multi-Config'")
    assert run(root, "build", "--cmake-args", *words, "-G", "Ninja")[0] == 0


@pytest.mark.parametrize("options", ["", "--merge-install", "--symlink-install", "--no-observer"])
def test_installed_folders_without_write_permission_are_updated(root: Path, options: str) -> None:
    """Root without the capability to override permissions is bound by them like other users."""
    bound = ("setpriv", "--bounding-set=-dac_override,-dac_read_search") if os.geteuid() == 0 else ()
    forge = (*bound, sys.executable, "-m", "forge", "build", *options.split())
    source, script = root / "src/a/data", root / "src/a/CMakeLists.txt"
    prefix = root / ("install" if options == "--merge-install" else "install/a")

    def build() -> int:
        return subprocess.run(forge, cwd=root, capture_output=True, timeout=SECONDS, check=False).returncode

    def installed() -> dict[str, str]:
        folder = prefix / "share/a/data"
        assert folder.stat().st_mode & 0o777 == 0o555
        # A link to a source that was removed leads nowhere.
        return {path.name: path.read_text() if path.exists() else "" for path in folder.iterdir()}

    source.mkdir()
    (source / "one").write_text("1\n")
    rule = "install(DIRECTORY data DESTINATION share/a DIRECTORY_PERMISSIONS OWNER_READ OWNER_EXECUTE"
    text = f"{CMAKE}{rule} GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)\n"
    script.write_text(text)
    assert build() == 0
    (source / "one").write_text("one\n")
    (source / "two").write_text("2\n")
    assert build() == 0
    assert installed() == {"one": "one\n", "two": "2\n"}
    (source / "two").unlink()
    (source / "three").write_text("3\n")
    script.write_text(f'{text}install(CODE "message(FATAL_ERROR no)")\n')
    assert build() == 1
    assert installed().keys() - ({"three"} if options == "--no-observer" else ()) == {"one", "two"}
    script.write_text(text)
    assert build() == 0
    assert installed() == {"one": "one\n", "three": "3\n"}
    script.write_text(CMAKE)
    assert build() == 0
    assert not (prefix / "share/a/data").exists()
