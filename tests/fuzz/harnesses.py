"""One harness per parser: bytes in, nothing out, and no error but the documented one.

Whatever else escapes is a bug of forge. A harness goes as far as forge goes with what it has read: a
manifest that is good becomes CMake variables, a definition becomes code. Hypothesis calls them in
test_fuzz.py, atheris by `make fuzz-parsers`.
"""

from __future__ import annotations

import contextlib
import json
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge.base.errors import ForgeError, InterfaceError
from forge.base.files import write_if_changed
from forge.base.layout import Layout
from forge.build.build_dir import BuildDirInputs, FileChecks, prepare_build_dir
from forge.build.build_notes import read_last, start_time
from forge.build.compile_commands import merge_compile_commands
from forge.build.inputs.depfiles import external_inputs
from forge.build.inputs.fingerprints import FileTable
from forge.build.inputs.input_manifest import read_manifest
from forge.build.install_manifests import ManifestFiles
from forge.build.journal import Journal
from forge.build.recipes.initial_cache import manifest_variables
from forge.build.snapshot import find_changed_externals
from forge.build.wheels.backends import _build_system
from forge.build.wheels.install_wheel import _option
from forge.cache import action_result as action_results
from forge.cache import keys
from forge.cache.trees import decode_index, encode_index
from forge.cli.completion_words import _load
from forge.cli.config import configured
from forge.cli.main import Parser
from forge.cli.mixins import combined, read_mixins
from forge.environment import sourcing
from forge.environment.dsv import PackageEdits
from forge.environment.install_state import recorded_python, recorded_underlays
from forge.environment.prefixes import installed_packages
from forge.environment.scripts import local_setup, package_setup
from forge.environment.shells import SHELLS
from forge.execution.jobserver import join_pool
from forge.execution.makeflags import read_make_flags
from forge.interfaces.hashing import hashes
from forge.interfaces.idl.target import idl_text
from forge.interfaces.model import Source, TypeName
from forge.interfaces.read.parsing import Parsed, parse, parse_all
from forge.interfaces.read.sources import Library, read_source
from forge.interfaces.resolve.resolution import resolve
from forge.interfaces.schema import read_schema
from forge.interfaces.writing import read_states
from forge.testing.collecting import collect
from forge.workspace import conditions
from forge.workspace.discovery import ROS_DEFAULTS, discover
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import Package
from forge.workspace.overrides import read_overrides
from forge.workspace.resolve import unmet_versions

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterable

    Harness = Callable[[bytes], None]

HARNESSES: dict[str, Harness] = {}
_INPUTS = BuildDirInputs("base", "shape", {}, {})
_NOTHING_KNOWN = FileChecks(
    lambda *_: None, lambda paths: dict.fromkeys(paths, ""), lambda _: False, lambda *_: False
)
"""Each harness by the name of what it reads."""

_XML = Path("package.xml")
_LAYOUT = Layout(Path("/ws/build"), Path("/ws/install"), None)


def harness(function: Harness) -> Harness:
    """Put a harness into the table, under its own name with dashes."""
    HARNESSES[function.__name__.replace("_", "-")] = function
    return function


@cache
def room() -> Path:
    """Return the folder in which harnesses put the bytes that forge reads from files."""
    folder = tempfile.TemporaryDirectory(prefix="forge-fuzz-")
    _ROOMS.append(folder)
    return Path(folder.name)


_ROOMS: list[tempfile.TemporaryDirectory[str]] = []
"""Kept, so that they are removed when the program ends."""


def place(folder: str, name: str, data: bytes) -> Path:
    """Write a file into a folder of the room and return the folder."""
    path = room() / folder / name
    if not path.parent.is_dir():
        path.parent.mkdir(parents=True)
    path.write_bytes(data)
    return room() / folder


def text_of(data: bytes) -> str:
    """Return bytes as text that a caller has read already."""
    return data.decode("utf-8", "surrogateescape")


@harness
def manifest(data: bytes) -> None:
    """Read package.xml, and what CMake and the check of versions make of it."""
    with contextlib.suppress(ForgeError):
        found = parse_manifest(data, _XML, ROS_DEFAULTS)
        manifest_variables(found)
        package = Package(Path("src/p"), found)
        needed = {
            need.name: replace(package, manifest=replace(found, name=need.name))
            for need in found.dependencies
        }
        list(unmet_versions({**needed, found.name: package}))


@harness
def condition(data: bytes) -> None:
    """Read a condition attribute of package.xml."""
    with contextlib.suppress(conditions.ConditionError):
        conditions.holds(text_of(data), ROS_DEFAULTS)


def definition(data: bytes, relative: str) -> None:
    """Read a definition and go on to its IDL and its hash, as far as it is good."""
    with contextlib.suppress(ForgeError):
        source = read_source("fuzzed", place("definitions", relative, data), relative)
        interface = parse(source)
        catalog = resolve("fuzzed", [Parsed(source, interface)], Library())
        hashes(catalog)
        parse(Source("fuzzed", "msg/X.idl", Path("X.idl"), idl_text(interface, relative)))


@harness
def message(data: bytes) -> None:
    """Read a .msg file."""
    definition(data, "msg/X.msg")


@harness
def service(data: bytes) -> None:
    """Read a .srv file."""
    definition(data, "srv/X.srv")


@harness
def action(data: bytes) -> None:
    """Read an .action file."""
    definition(data, "action/X.action")


@harness
def idl(data: bytes) -> None:
    """Read an .idl file."""
    definition(data, "msg/X.idl")


@harness
def schema(data: bytes) -> None:
    """Read the text of a schema as recordings store it."""
    with contextlib.suppress(InterfaceError):
        parse_all(read_schema(text_of(data), TypeName("fuzzed", "msg", "X")))


@cache
def _actions() -> Iterable[argparse.Action]:
    from forge.cli.commands import build

    parser = Parser(prog="forge build")
    build.register(parser)
    return tuple(parser._actions)


def configuration(folder: str, name: str, data: bytes, **given: object) -> None:
    """Read a file with options for `forge build`."""
    root = place(folder, name, data)
    with contextlib.suppress(ForgeError):
        configured("build", _actions(), given, root, {"FORGE_HOME": str(root / "home")})


@harness
def defaults(data: bytes) -> None:
    """Read colcon_defaults.yaml."""
    configuration("defaults", "colcon_defaults.yaml", data)


@harness
def forge_toml(data: bytes) -> None:
    """Read forge.toml, with a profile."""
    configuration("toml", "forge.toml", data, profile="fast")
    with contextlib.suppress(ForgeError):
        read_overrides(room() / "toml", (), None)


@harness
def metas(data: bytes) -> None:
    """Read a *.meta file, and the package that it speaks of."""
    root = place("metas", "colcon.meta", data)
    place("metas", "p/package.xml", PLAIN)
    with contextlib.suppress(ForgeError):
        workspace(root, read_overrides(root, ("colcon.meta",), None))


@harness
def colcon_pkg(data: bytes) -> None:
    """Read a colcon.pkg beside a package.xml."""
    place("colcon_pkg", "p/package.xml", PLAIN)
    workspace(place("colcon_pkg", "p/colcon.pkg", data))


@harness
def mixin(data: bytes) -> None:
    """Read a *.mixin file, and all its mixins together."""
    root = place("mixins", "a.mixin", data)
    with contextlib.suppress(ForgeError):
        mixins = read_mixins((), (str(root / "a.mixin"),))
        for verb, name in mixins:
            with contextlib.suppress(ForgeError):
                combined([name], verb, mixins)


def workspace(root: Path, overrides: Any = None) -> None:
    """Look at a folder's packages, and at each as `forge info` shows it; discovery raises nothing."""
    found = discover(root, ["."], {}, overrides=overrides)
    for package in found.packages.values():
        package.option_values("cmake-args")
        json.dumps(package.settings, default=str)
        manifest_variables(package.manifest)
    for problem in (*found.problems, *found.notes):
        problem.render()


@harness
def cmake_lists(data: bytes) -> None:
    """Read a CMakeLists.txt without a package.xml."""
    workspace(place("cmake", "CMakeLists.txt", data))


@harness
def setup_py(data: bytes) -> None:
    """Read a setup.py, which is read and never run."""
    workspace(place("setup_py", "setup.py", data))


@harness
def setup_cfg(data: bytes) -> None:
    """Read a setup.cfg, for what it says of the package and of where programs go."""
    place("setup_cfg", "setup.py", b"from setuptools import setup\nsetup()\n")
    folder = place("setup_cfg", "setup.cfg", data)
    workspace(folder)
    with contextlib.suppress(ForgeError):
        _option(folder / "setup.cfg", "install", "install_scripts")


@harness
def pyproject(data: bytes) -> None:
    """Read a pyproject.toml, for what it says of the package and of its backend."""
    folder = place("pyproject", "pyproject.toml", data)
    workspace(folder)
    with contextlib.suppress(ForgeError):
        _build_system(folder)


@harness
def journal(data: bytes) -> None:
    """Read the record of earlier builds, which a crash or another version may have left in any state."""
    folder = place("journal", "forge_journal.jsonl", data)
    found = Journal(folder / "forge_journal.jsonl")
    found.read(text_of(data))
    find_changed_externals(found, FileTable(folder / "none.json"))
    for name, record in sorted(found.records.items()):
        found.set_record(name, record)
    found.close()


@harness
def tables(data: bytes) -> None:
    """Read tables and notes in JSON that forge keeps for itself, none of which it may trust."""
    build = place("tables", "forge_files.json", data)
    table = FileTable(build / "forge_files.json")
    table.digest(str(room() / "tables" / "forge_files.json"), (build / "forge_files.json").stat())
    for name in ("begun", "ended", "sources", "externals"):
        place("tables", f"p/.forge/{name}.json", data)
    place("tables", "p/forge_installed.json", data)
    place("tables", ".forge.json", data)
    start_time(build / "p")
    read_last(build / "p")
    read_manifest(build / "p" / ".forge" / "sources.json")
    prepare_build_dir(build / "p", _INPUTS, _NOTHING_KNOWN, can_reuse=True, reconfigure=False)
    with contextlib.suppress(ForgeError):
        recorded_underlays(build)
        recorded_python(build)
    place("tables", ".forge/p.json", data)
    read_states(build)
    _load(build / "forge_files.json")


@harness
def dsv(data: bytes) -> None:
    """Read a dsv file of an installed package, and the scripts that come of it."""
    prefix = place("dsv", "share/p/package.dsv", data)
    sourcing._read_edits.cache_clear()
    with contextlib.suppress(ForgeError):
        edits = sourcing.package_edits("p", prefix)
        for shell in SHELLS:
            write_if_changed(
                room() / "local_setup", local_setup(shell, prefix, [PackageEdits("p", "p", edits)])
            )
            write_if_changed(room() / "package", package_setup(shell, prefix, PackageEdits("p", "", edits)))


@harness
def install_index(data: bytes) -> None:
    """Read the markers of an install tree: its layout, and what a package needs to run."""
    root = place("index", ".colcon_install_layout", b"merged\n")
    place("index", "share/colcon-core/packages/p", data)
    installed_packages(root)
    place("index", ".colcon_install_layout", data)
    installed_packages(root)


@harness
def build_logs(data: bytes) -> None:
    """Read what ninja, make and compilers leave in a build folder."""
    build = place("ninja", ".ninja_deps", b"# ninjadeps\n\x04\0\0\0" + data)
    place("ninja", "build.ninja", data)
    place("ninja", "CMakeFiles/rules.ninja", b"")
    external_inputs(build, Path("/ws/src/p"), [])
    made = place("make", "a.o.d", data)
    place("make", "CMakeFiles/a.dir/build.make", data)
    place("make", "CMakeFiles/Makefile.cmake", data)
    external_inputs(made, Path("/ws/src/p"), [])
    place("make", "p/install_manifest.txt", data)
    ManifestFiles(replace(_LAYOUT, build=made)).get("p")
    place("make", "p/compile_commands.json", data)
    merge_compile_commands(made, force=True)


@harness
def test_results(data: bytes) -> None:
    """Read JUnit files and CTest's, and the TAG that leads to the latter."""
    base = place("results", "p/result.xunit.xml", data)
    place("results", "q/Testing/TAG", b"run\n")
    place("results", "q/Testing/run/Test.xml", data)
    collect(base)
    tagged = place("tags", "p/Testing/TAG", data)
    collect(tagged)


@harness
def make_flags(data: bytes) -> None:
    """Read MAKEFLAGS, with the address of a jobserver in it."""
    flags = read_make_flags(text_of(data))
    flags.line(3, "fifo:/x")
    if flags.auth and "\0" not in flags.auth:
        pool = join_pool(flags.auth if "fifo" in flags.auth else f"1{flags.auth}")
        if pool:
            pool.close()


@harness
def generator_arguments(data: bytes) -> None:
    """Read the @FILE with the words of `forge interface generate`."""
    from forge.cli.main import main

    folder = place("arguments", "generate.args", data)
    argv = ["interface", "generate", f"@{folder}/generate.args", "--output", str(room() / "generated")]
    with (
        (room() / "said").open("w", errors="replace") as said,
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(said),
        contextlib.suppress(SystemExit),
    ):
        assert main(argv) in {0, 2}


@harness
def action_result(data: bytes) -> None:
    """Read what a cache on a server says that a key leads to; what was read can be written."""
    with contextlib.suppress(ValueError):
        found = action_results.decode(data)
        assert action_results.decode(action_results.encode(found)) == found


@harness
def cached_tree(data: bytes) -> None:
    """Read the index of a package in a cache, which a stranger may have written; no path leads out."""
    with contextlib.suppress(ValueError):
        tree = decode_index(data)
        assert decode_index(encode_index(tree)) == tree
        for path in (*(leaf.path for leaf in tree.leaves), *dict(tree.folders)):
            assert not Path(path).is_absolute()
            assert ".." not in Path(path).parts


@harness
def cached_inputs(data: bytes) -> None:
    """Read the lists of files that a key in a cache leads to."""
    found = keys.decode_lists(data)
    assert keys.decode_lists(keys.encode_lists(found)) == tuple(dict.fromkeys(found))


PLAIN = b"""<package format="3"><name>p</name><version>1.0.0</version><description>A</description>
<maintainer email="a@b.cc">A</maintainer><license>L</license></package>"""
