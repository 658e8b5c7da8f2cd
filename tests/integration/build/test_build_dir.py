"""Reuse of build folders as CMake and ninja leave them."""

import json
import os
import subprocess
import time
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from forge.base.layout import RECORD_FILE, SCRATCH_DIR, Layout
from forge.build import build_dir
from forge.build.inputs.fingerprints import FileTable, contents_of, fingerprint_tree
from forge.build.installed_lists import InstalledStates
from forge.build.observed_writes import append, begin_log, read_steps
from forge.build.records import FolderRecord, add_commands, complete_record, read_record
from forge.build.reuse import Reuse
from forge.engine.observation import LOG_VARIABLE
from forge.engine.observer import compile_library
from forge.engine.world import World
from tests.testable import restored, save

pytestmark = pytest.mark.needs("cmake", "gcc", "ninja")

_CMAKE = """cmake_minimum_required(VERSION 3.18)
project(probe C)
set(LEVEL 1)
configure_file(made.h.in made.h)
configure_file(blob.in blob.bin)
add_library(probe STATIC one.c two.c three.c)
target_include_directories(probe PRIVATE ${CMAKE_CURRENT_BINARY_DIR})
set_source_files_properties(three.c PROPERTIES COMPILE_OPTIONS -Wa,-I${CMAKE_CURRENT_BINARY_DIR})
"""
_FILES = {
    "CMakeLists.txt": _CMAKE,
    "made.h.in": "#define MADE 1\n",
    "blob.in": "1\n",
    "one.c": '#include "one.h"\nint one(void) { return ONE; }\n',
    "one.h": "#define ONE 1\n",
    "two.c": '#include "made.h"\nint two(void) { return MADE; }\n',
    "three.c": '__asm__(".data\\n.incbin \\"blob.bin\\"\\n.text");\n',
}
OBJECTS = {"one", "two", "three"}


@dataclass
class Probe:
    """A package, its build folder, and the options of its builds."""

    root: Path
    inputs: FolderRecord
    externals: tuple[str, ...] = ()
    last: FolderRecord | None = None
    begun: FolderRecord | None = None

    @property
    def source(self) -> Path:
        """The package's folder."""
        return self.root / "source"

    @property
    def log(self) -> Path:
        """What its steps do."""
        return self.root / "log/probe"

    @property
    def build(self) -> Path:
        """Its build folder."""
        return self.root / "build" / "probe"

    def table(self) -> FileTable:
        """Return a table that remembers nothing."""
        return FileTable(self.root / "table.json", World(os.environ).answer)

    def begin(self, *, can_reuse: bool = True, reconfigure: bool = False) -> Reuse:
        """Prepare the folder for the steps of a build."""
        table = self.table()
        _, sources = fingerprint_tree(str(self.source), table)
        begin_log(self.log)
        self.last = build_dir.last_record(self.build)
        reuse, self.begun = build_dir.prepare_build_dir(
            self.build,
            self.last,
            replace(self.inputs, sources=sources),
            InstalledStates(self.root / "build"),
            table,
            can_reuse=can_reuse,
            reconfigure=reconfigure,
        )
        return reuse

    def configure(self) -> None:
        """Run CMake, unless the folder is configured, and what forge does after it."""
        if not (self.build / "build.ninja").is_file():
            self.run("cmake", "cmake", "-G", "Ninja", "-S", str(self.source), "-B", str(self.build))
            build_dir.restore_outputs(self.build)

    def compile(self) -> set[str]:
        """Run ninja; return the names of the sources that it compiled."""
        out = self.run("build", "ninja", "-C", str(self.build))
        return {name for name in OBJECTS if f"/{name}.c.o" in out}

    def run(self, kind: str, *argv: str) -> str:
        """Run a step of a kind, which must succeed; return what it printed."""
        library = compile_library(self.root, os.environ)
        variables = {**os.environ, LOG_VARIABLE: str(self.log), "LD_PRELOAD": str(library)}
        with subprocess.Popen(argv, env=variables, stdout=subprocess.PIPE, text=True) as process:
            append(str(self.log), f"P{process.pid} {kind}".encode())
            out, _ = process.communicate()
        assert process.returncode == 0, out
        layout, world = Layout(self.root / "build", self.root / "install", None), World(os.environ)
        assert self.begun is not None
        before = self.begun.commands
        commands = build_dir.observed_commands(
            read_steps(self.log), self.build, self.source, layout, world, before
        )
        add_commands(self.build, commands)
        return out

    def end(self) -> frozenset[str]:
        """Note that the build ended well; return what was saved meanwhile."""
        assert self.begun is not None
        table = self.table()
        externals = contents_of(self.externals, table)
        saved = build_dir.saved_during_build(
            self.build, self.source, self.last, self.begun, externals, table, frozenset()
        )
        complete_record(self.build, externals, saved, build_dir.generated_digest(self.build), {})
        return saved

    def make(self) -> tuple[Reuse, set[str]]:
        """Build; return what was reused and which sources were compiled."""
        reuse = self.begin()
        self.configure()
        compiled = self.compile()
        self.end()
        return reuse, compiled

    def write(self, name: str, text: str, *, old: bool = False) -> None:
        """Write a source, perhaps with an old time."""
        path = self.source / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        if old:
            os.utime(path, (1_000_000_000, 1_000_000_000))


@pytest.fixture(scope="module")
def built_root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the package once."""
    root = tmp_path_factory.mktemp("probe") / "root"
    (root / "build").mkdir(parents=True)
    found = Probe(root, FolderRecord("base", "shape", {}, {}))
    for name, text in _FILES.items():
        found.write(name, text)
    assert found.make() == (Reuse.NOTHING, OBJECTS)
    save(root, "built")
    return root


@pytest.fixture
def probe(built_root: Path) -> Probe:
    """Return the package as it was built."""
    return Probe(restored(built_root), FolderRecord("base", "shape", {}, {}))


def note_of(probe: Probe, **values: object) -> None:
    """Change what a build noted as it began."""
    path = probe.build / SCRATCH_DIR / RECORD_FILE
    first, *more = path.read_text().splitlines()
    path.write_text("\n".join((json.dumps({**json.loads(first), **values}), *more)), encoding="utf-8")


def test_objects_that_include_a_generated_file_by_name_are_rebuilt(probe: Probe) -> None:
    probe.write("blob.in", "2\n", old=True)
    assert probe.make() == (Reuse.PRODUCTS, {"three"})


def test_an_external_file_written_during_a_killed_build_rebuilds_everything(
    probe: Probe,
) -> None:
    outside = probe.root / "outside.h"
    outside.write_text("#define ONE 1\n", encoding="utf-8")
    probe.write("one.c", f'#include "{outside}"\nint one = ONE;\n')
    probe.begin()
    probe.compile()
    assert probe.begin() is Reuse.EVERYTHING
    outside.write_text("#define ONE 2\n", encoding="utf-8")
    assert probe.make() == (Reuse.NOTHING, OBJECTS)


def test_a_file_reverted_after_a_killed_build_is_recompiled(
    probe: Probe,
) -> None:
    probe.write("one.h", "#define ONE 2\n")
    probe.begin()
    probe.compile()
    probe.write("one.h", _FILES["one.h"], old=True)
    assert probe.make()[1] == {"one"}


def test_a_build_folder_set_aside_before_a_kill_is_restored(probe: Probe) -> None:
    probe.write("CMakeLists.txt", f"{_CMAKE}# a remark\n")
    probe.begin()
    assert build_dir.set_aside_path(probe.build).is_dir()
    assert probe.make() == (Reuse.PRODUCTS, set())


def test_setting_the_clock_back_rebuilds_everything(probe: Probe) -> None:
    note_of(probe, began=time.time_ns() + 3600 * 10**9)
    assert probe.make() == (Reuse.NOTHING, OBJECTS)


def test_changed_files_are_not_reused_after_losing_the_record(probe: Probe) -> None:
    (probe.build / SCRATCH_DIR / RECORD_FILE).unlink()
    probe.write("one.h", "#define ONE 2\n", old=True)
    assert "one" in probe.make()[1]


def test_a_damaged_record_counts_as_lost(probe: Probe) -> None:
    path = probe.build / SCRATCH_DIR / RECORD_FILE
    whole = path.read_text(encoding="utf-8")
    version = json.loads(whole.splitlines()[0])["version"]
    assert read_record(probe.build) is not None
    for text in (
        *("", "[]", "{", "null", '{"began": "x"}', '{"version": 2}', '{"version": 0}', "[" * 9999),
        *(f'{{"version": {version}, "began": {rest}' for rest in ("-1}", "0}\nnull")),
        *(whole.rstrip()[:-1], whole[:1], whole[:100]),
    ):
        path.write_text(text, encoding="utf-8")
        assert read_record(probe.build) is None, text[:100]


def test_a_record_of_another_version_forces_a_clean_build(probe: Probe) -> None:
    note_of(probe, version=-1)
    assert read_record(probe.build) is None
    assert probe.make() == (Reuse.NOTHING, OBJECTS)


@pytest.mark.parametrize(
    ("name", "kept"),
    [
        *(("build.ninja", kept) for kept in (0, 100, None)),
        *(("CMakeFiles/rules.ninja", 0), ("cmake_install.cmake", 100)),
    ],
)
def test_a_damaged_cmake_file_forces_a_clean_build(probe: Probe, name: str, kept: int | None) -> None:
    """The native tool could not read it, or would leave something out."""
    path = probe.build / name
    text = path.read_text(encoding="utf-8")
    path.write_text("{}" if kept is None else text[:kept], encoding="utf-8")
    probe.write("one.h", "#define ONE 2\n")
    assert probe.make() == (Reuse.NOTHING, OBJECTS)
    assert path.read_text(encoding="utf-8") == text


def test_a_source_removed_during_the_build_rebuilds_everything(probe: Probe) -> None:
    probe.write("more.h", "")
    probe.make()
    probe.begin()
    (probe.source / "more.h").unlink()
    assert probe.end() == {str(probe.source / "more.h")}
    assert probe.begin() is Reuse.NOTHING


def test_external_files_written_during_the_build_are_detected(probe: Probe) -> None:
    outside = probe.root / "outside.h"
    outside.write_text("1", encoding="utf-8")
    probe.externals = (str(outside),)
    time.sleep(0.05)
    probe.make()
    probe.begin()
    outside.write_text("1", encoding="utf-8")
    assert probe.end() == {str(outside)}


def test_files_left_by_tests_are_kept_in_the_build_folder(probe: Probe) -> None:
    (probe.build / "test_results").mkdir()
    (probe.build / "test_results" / "one.xml").touch()
    probe.inputs = replace(probe.inputs, base="other")
    assert probe.begin() is Reuse.NOTHING
    assert (probe.build / "test_results" / "one.xml").is_file()


def test_a_symbolic_link_in_place_of_a_build_folder_is_not_followed(tmp_path: Path) -> None:
    away = tmp_path / "away"
    away.mkdir()
    (away / "precious").touch()
    probe = Probe(tmp_path, FolderRecord("base", "shape", {}, {}))
    probe.write("CMakeLists.txt", "")
    (tmp_path / "build").mkdir()
    probe.build.symlink_to(away)
    assert probe.begin() is Reuse.NOTHING
    assert (away / "precious").exists()


def test_an_edit_after_a_failed_configure_is_not_lost(probe: Probe) -> None:
    probe.write("CMakeLists.txt", f"{_CMAKE}message(FATAL_ERROR wrong)\n")
    probe.begin()
    probe.write("one.h", "#define ONE 2\n", old=True)
    probe.write("CMakeLists.txt", _CMAKE)
    assert probe.make()[1] == {"one"}


def test_an_edit_before_a_failed_configure_is_not_lost(probe: Probe) -> None:
    probe.write("one.h", "#define ONE 2\n", old=True)
    probe.write("CMakeLists.txt", f"{_CMAKE}message(FATAL_ERROR wrong)\n")
    probe.begin()
    probe.write("CMakeLists.txt", _CMAKE)
    assert probe.make()[1] == {"one"}
