"""A command could see something else only if what it read, found, listed or missed has changed."""

import json
import tempfile
from pathlib import Path

import pytest

from forge.engine.accesses import Accesses, ObservedCommands, decode_commands, encode_commands
from forge.engine.commands import Folders, commands_of
from forge.engine.observation import ObservedStep, Process

SEEN = Accesses(
    read=frozenset({"/s/a.c"}),
    found=frozenset({"/s/b.c", "/s/d"}),
    listed=frozenset({"/s/l"}),
    searched=frozenset({"/s"}),
)
COMMANDS = ObservedCommands(missing=frozenset({"/s/config.h", "/s/inc", "/t/other.h"}))


@pytest.mark.parametrize("path", ["/s/a.c"])
def test_commands_are_affected_by_files_that_they_read(path: str) -> None:
    assert COMMANDS.affected(SEEN, (), (), {path})
    assert COMMANDS.affected(SEEN, (), {path}, ())


def test_commands_are_affected_if_a_found_file_disappears() -> None:
    assert COMMANDS.affected(SEEN, (), {"/s/b.c"}, ())
    assert COMMANDS.affected(SEEN, (), {"/s/d/"}, ())
    assert not COMMANDS.affected(SEEN, (), (), {"/s/b.c"})


@pytest.mark.parametrize("path", ["/s/l/new", "/s/l/folder/", "/s/config.h", "/s/inc/x/y.h", "/s/inc/"])
def test_commands_are_affected_by_new_names_that_they_listed_or_missed(path: str) -> None:
    assert COMMANDS.affected(SEEN, {path}, (), ())


@pytest.mark.parametrize("path", ["/s/new", "/s/d/l", "/t/other.h", "/s/l/deep/new", "/s/config.hpp"])
def test_commands_are_not_affected_by_other_new_names(path: str) -> None:
    assert not COMMANDS.affected(SEEN, {path}, (), ())


def test_later_builds_replace_records_of_the_same_commands() -> None:
    old, new = Accesses(read=frozenset({"/old"})), Accesses(read=frozenset({"/new"}))
    before = ObservedCommands(SEEN, {"a": old, "b": old, "gone": old}, frozenset({"/m"}))
    merged = before.merged(ObservedCommands(None, {"a": new}, frozenset({"/n"})), {"a", "b"})
    assert merged == ObservedCommands(SEEN, {"a": new, "b": old}, frozenset({"/m", "/n"}))


def test_commands_survive_a_round_trip() -> None:
    commands = ObservedCommands(
        SEEN, {"x": Accesses(blind=True), "y": SEEN}, frozenset({"/m"}), SEEN, (("$A", "1"),)
    )
    assert decode_commands(json.loads(json.dumps(encode_commands(commands)))) == commands


def process(pid: int, parent: Process | None, program: str, *records: tuple[str, str]) -> Process:
    found = Process(pid, parent, [program], "", [(number, *record) for number, record in enumerate(records)])
    if parent:
        parent.children.append(found)
    return found


def test_children_of_ninja_are_commands(tmp_path: Path) -> None:
    build, source, other = tmp_path / "b", tmp_path / "s", tmp_path / "other"
    for folder in (build, source, other):
        folder.mkdir()
    output, external = build / "x.o", other / "h.h"
    for path in (output, external):
        path.touch()
    cmake = process(1, None, "/usr/bin/cmake")
    ninja = process(2, cmake, "/usr/bin/ninja", ("R", str(build / "build.ninja")))
    shell = process(3, ninja, "/bin/sh")
    gcc = process(
        4,
        shell,
        "/usr/bin/gcc",
        ("R", str(source / "x.c")),
        ("R", str(external)),
        ("N", str(source / "y.h")),
        ("W", str(output)),
        ("R", str(output)),
    )
    step = ObservedStep((cmake, ninja, shell, gcc))
    folders = Folders(build, (source,))
    found = commands_of(step, {1: "build"}, lambda *_: (str(output),), folders)
    accesses = found.edges[str(output)]
    assert accesses.read == {str(source / "x.c")}
    assert accesses.written == {str(output)}
    assert accesses.searched == {str(source)}
    assert found.missing == {str(source / "y.h")}
    assert accesses.external == {str(external)}
    assert accesses.outputs_known
    found = commands_of(step, {1: "build"}, lambda *_: (str(output), str(external)), folders)
    assert not found.edges[str(output)].outputs_known


def test_names_in_the_temporary_folder_are_not_inputs(tmp_path: Path) -> None:
    (tmp_path / "names").mkdir()
    cmake = process(1, None, "/usr/bin/cmake")
    listed = [("L", tempfile.gettempdir()), ("L", str(tmp_path / "names"))]
    ninja = process(2, cmake, "/usr/bin/ninja", ("R", str(tmp_path / "b/build.ninja")))
    process(3, ninja, "/usr/bin/make", *listed)
    found = commands_of(
        ObservedStep((cmake, ninja, *ninja.children)),
        {1: "build"},
        lambda *_: ("x.so",),
        Folders(tmp_path / "b", (tmp_path / "s",)),
    )
    assert found.edges["x.so"].external == {f"{tmp_path}/names/."}


def test_an_inner_ninja_belongs_to_the_command_that_starts_it(tmp_path: Path) -> None:
    outer, inner = Process(1, programs=["/usr/bin/ninja"]), Process(3, programs=["/usr/bin/ninja"])
    shell, cc = Process(2, outer, ["/bin/sh"], "outer"), Process(4, inner, ["/usr/bin/cc"])
    inner.parent = shell
    outer.children, shell.children, inner.children = [shell], [inner], [cc]
    cc.records = [(1, "R", str(tmp_path / "x.c"))]
    step = ObservedStep((outer, shell, inner, cc))
    folders = Folders(tmp_path, ())

    def found(name: str | None) -> ObservedCommands:
        return commands_of(step, {1: "build"}, lambda each, _: (each.command,) if name else (), folders)

    source = {str(tmp_path / "x.c")}
    assert {name: each.read for name, each in found("outer").edges.items()} == {"outer": source}
    assert found("outer").rest == Accesses()
    assert (found(None).rest or Accesses()).read == source


def test_paths_are_spelled_like_their_configured_folders(tmp_path: Path) -> None:
    (tmp_path / "real/deep").mkdir(parents=True)
    (tmp_path / "link").symlink_to("real")
    folders = Folders(tmp_path / "link/b", (tmp_path / "link",))
    assert folders.path(f"{tmp_path}/real/deep/x") == f"{tmp_path}/link/deep/x"
    assert folders.path(f"{tmp_path}/link/deep/x") == f"{tmp_path}/link/deep/x"
    assert folders.path(f"{tmp_path}/real") == f"{tmp_path}/link"
    assert folders.path(f"{tmp_path}/realx") is None
