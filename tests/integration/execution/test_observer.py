"""What the steps of a package write into its prefix is observed, or known not to be."""

import os
import struct
import subprocess
from pathlib import Path

import pytest

from forge.base.layout import Layout
from forge.build.observed_writes import NOTES, ObservedWrites, begin_log, read_writes
from forge.build.prefix import written_log
from forge.build.tasks import Step, StepKind, Task
from forge.engine.observer import compile_library
from forge.execution.observer import Observer, note_step
from tests.packages import package

pytestmark = pytest.mark.needs("gcc", "cmake", "perl")

WRITERS = {
    "sh": "echo x > a; echo y >> a; mkdir d; cd d; echo x > ../b; : > c",
    "cp": "cp /etc/passwd a; cp -r /etc/init.d d; cp -a a e; ln -s a l; ln a h; mv e f; mv d g",
    "install": "install -D -m 755 /bin/sh bin/deep/sh; install -d x/y",
    "tar": "tar cf - -C /etc passwd init.d | tar xf -",
    "sed": "echo x > a; sed -i s/x/y/ a",
    "python": "python3 -c 'import os, shutil, tempfile\n"
    'open("a", "w"); os.makedirs("d/e"); os.symlink("a", "d/l"); shutil.copy("a", "d/c")\n'
    'os.rename("d", "f"); os.mkfifo("p"); os.close(tempfile.mkstemp(dir=".")[0])\'',
    "perl": "perl -e 'open F, q(>a); mkdir q(d); rename q(a), q(d/a); symlink q(x), q(l)'",
    "cmake": "cmake -E touch a; cmake -E copy a b; cmake -E make_directory d/e; cmake -E rename b c; "
    "cmake -E create_symlink a l; cmake -E copy_directory d f",
    "make": "printf 'all:\\n\\techo x > a\\n' | make -f -",
    "system": 'python3 -c \'import os; os.system("echo x > a"); os.popen("echo x > b").close()\'',
    "execl": "perl -e 'exec(q(sh), q(-c), q(echo x > a))'",
    "cleared environment": "env -i /bin/sh -c 'echo x > a'",
    "variable removed": "env -u LD_PRELOAD sh -c 'echo x > a'",
    "killed": "sh -c 'echo x > a; kill -9 $$' || true",
    "link": "ln -sfn \"$PWD\" ../other; cp /etc/passwd ../other/a; python3 -c \"open('../other/c', 'w')\"",
    "background": "(sleep 0.1; echo x > a) & wait",
}
UNSEEN = {
    "static": "{static} a",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the compiled library."""
    return tmp_path_factory.mktemp("library")


@pytest.fixture
def observed(tmp_path: Path, folder: Path) -> tuple[Layout, Task, Observer]:
    """Return a layout whose path has a space, a task and its observer."""
    layout = Layout(tmp_path / "b", tmp_path / "in stall", None)
    task = Task("a", package("a", build_type="cmake"), layout.prefix("a"), tmp_path / "b/a", (), (), "")
    task.prefix.mkdir(parents=True)
    log = written_log("a", layout)
    log.parent.mkdir()
    begin_log(log)
    observer = Observer(layout, compile_library(folder, dict(os.environ)))
    assert observer.library is not None
    return layout, task, observer


def run(script: str, observed: tuple[Layout, Task, Observer]) -> ObservedWrites:
    """Run a script of a step in the prefix; return what was observed."""
    layout, task, observer = observed
    step = Step(StepKind.BUILD, (), task.prefix)
    with (
        observer.surroundings(task, step, os.environ, None) as (variables, logs),
        subprocess.Popen(("sh", "-ec", script), cwd=task.prefix, env=variables) as process,
    ):
        assert logs
        note_step(variables, process.pid, step)
    assert process.returncode == 0
    return read_writes(written_log("a", layout), task.prefix)


@pytest.mark.parametrize("writer", WRITERS)
def test_everything_that_a_step_writes_is_observed(
    observed: tuple[Layout, Task, Observer], writer: str
) -> None:
    writes = run(WRITERS[writer], observed)
    assert writes.complete
    prefix = observed[1].prefix
    found = [path for path in prefix.rglob("*") if path.is_symlink() or not path.is_dir()]
    assert found
    assert [path for path in found if str(path) not in writes.files] == []
    folders = [path for path in prefix.rglob("*") if path.is_dir() and not path.is_symlink()]
    assert [path for path in folders if str(path) not in writes.folders] == []


REMOVERS = {
    "rm": "rm a; rm -r d",
    "mv": "mv a ../moved; mv d ../gone",
    "find": "find . -mindepth 1 -delete",
    "python": 'python3 -c \'import os, shutil; os.remove("a"); shutil.rmtree("d")\'',
    "cmake": "cmake -E rm a; cmake -E rm -r d",
    "perl": "perl -e 'unlink q(a); unlink q(d/f); rmdir q(d)'",
}


@pytest.mark.parametrize("remover", REMOVERS)
def test_everything_that_a_step_removes_is_observed(
    observed: tuple[Layout, Task, Observer], remover: str
) -> None:
    prefix = observed[1].prefix
    (prefix / "d").mkdir()
    for name in ("a", "d/f"):
        (prefix / name).write_text("x")
    writes = run(REMOVERS[remover], observed)
    assert writes.complete
    assert all(writes.take_away(f"{prefix}/{name}") for name in ("a", "d", "d/f"))
    assert not writes.take_away(f"{prefix}/b")


def test_writes_of_other_processes_are_not_observed(observed: tuple[Layout, Task, Observer]) -> None:
    prefix = observed[1].prefix
    writes = run(f"cat /etc/passwd > {prefix.parent.parent}/out; ls > /dev/null; echo x > a", observed)
    (prefix / "b").touch()
    assert writes.complete
    assert [*writes.files] == [str(prefix / "a")]


@pytest.mark.parametrize("program", UNSEEN)
def test_an_unobservable_process_is_detected(
    observed: tuple[Layout, Task, Observer], program: str, tmp_path: Path
) -> None:
    static = tmp_path / "static"
    code = '#include <stdio.h>\nint main(int n, char **v) { return !fopen(v[n - 1], "w"); }\n'
    subprocess.run(("gcc", "-static", "-x", "c", "-", "-o", static), input=code, text=True, check=True)
    assert not run(UNSEEN[program].format(static=static), observed).complete
    assert (observed[1].prefix / "a").exists()


def test_a_linked_prefix_is_observed(tmp_path: Path, observed: tuple[Layout, Task, Observer]) -> None:
    prefix = observed[1].prefix
    (tmp_path / "elsewhere").mkdir()
    prefix.rmdir()
    prefix.symlink_to(tmp_path / "elsewhere")
    writes = run(f"echo x > a; echo x > '{tmp_path}/elsewhere/b'; echo x > '{prefix}/c'", observed)
    assert writes.files == {str(prefix / name) for name in "abc"}


def test_writes_are_not_observed_without_a_compiler(
    tmp_path: Path, observed: tuple[Layout, Task, Observer]
) -> None:
    layout, task, _ = observed
    observer = Observer(layout, compile_library(tmp_path / "empty", {"PATH": str(tmp_path)}))
    assert observer.library is None
    with observer.surroundings(task, Step(StepKind.BUILD, (), task.prefix), {}, None) as (variables, logs):
        assert "LD_PRELOAD" not in variables
        assert not logs


@pytest.mark.parametrize("damage", ["shorter", "more records", "no space", "no notes", "unfinished notes"])
def test_a_damaged_log_is_incomplete(observed: tuple[Layout, Task, Observer], damage: str) -> None:
    assert run("echo x > a; echo x > b", observed).complete
    log = written_log("a", observed[0])
    notes = log.with_name(f"{log.name}{NOTES}")
    with log.open("rb") as file:
        content = file.read(1 << 16)
    end, count, lost = struct.unpack_from("=QQQ", content)
    match damage:
        case "shorter":
            log.write_bytes(content[:4096])
        case "more records":
            log.write_bytes(struct.pack("=QQQ", end, count + 1, lost) + content[24:end])
        case "no space":
            log.write_bytes(struct.pack("=QQQ", end, count, 1) + content[24:end])
        case "no notes":
            notes.unlink()
        case _:
            notes.write_bytes(notes.read_bytes()[:-1])
    assert not read_writes(log, observed[1].prefix).complete
