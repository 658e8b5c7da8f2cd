"""One harness per parser: it reads any bytes and raises only documented errors.

A harness also uses the result as forge does: the variables of CMake are computed from a valid manifest, and
the hash of a valid definition. test_fuzz.py runs all harnesses; `make fuzz-parsers` runs them with atheris.
"""

from __future__ import annotations

import contextlib
import json
import tempfile
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forge.base.errors import ForgeError, InterfaceError
from forge.base.files import write_if_changed
from forge.base.layout import Layout
from forge.build.build_dir import last_record, prepare_build_dir
from forge.build.inputs.fingerprints import FileTable
from forge.build.inputs.native_graph import read_native_graph, reported_inputs
from forge.build.installed_lists import InstalledStates, listed_files
from forge.build.journal import Journal
from forge.build.recipes.initial_cache import manifest_variables
from forge.build.records import FolderRecord
from forge.build.snapshot import find_changed_externals
from forge.build.wheels.install_wheel import build_system, setup_cfg_option
from forge.cli.config import configured
from forge.cli.main import Parser
from forge.environment import sourcing
from forge.environment.dsv import PackageEdits
from forge.environment.install_state import recorded_python, recorded_underlays
from forge.environment.prefixes import installed_packages
from forge.environment.scripts import local_setup, package_setup
from forge.environment.shells import SHELLS
from forge.execution.jobserver import join_pool
from forge.execution.makeflags import read_make_flags
from forge.interfaces.hashing import hashes
from forge.interfaces.idl import idl_text
from forge.interfaces.model import Source, TypeName
from forge.interfaces.read.parsing import Parsed, parse, parse_all
from forge.interfaces.read.sources import Library, read_source
from forge.interfaces.resolve.resolution import resolve
from forge.interfaces.schema import read_schema
from forge.interfaces.writing import read_states
from forge.plugins.compile_commands.merging import merge_compile_commands
from forge.plugins.mixins.mixins import combined, read_mixins
from forge.plugins.package_cache import keys
from forge.plugins.package_cache.folder_store import decode_result, encode_result
from forge.plugins.package_cache.trees import decode_index, encode_index
from forge.plugins.remote_cache import action_result as action_results
from forge.testing.collecting import collect
from forge.workspace.discovery import ROS_DEFAULTS, discover
from forge.workspace.manifest import ConditionError, holds, parse_manifest
from forge.workspace.model import Package
from forge.workspace.overrides import read_overrides
from forge.workspace.resolve import unmet_versions

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterable

    Harness = Callable[[bytes], None]

HARNESSES: dict[str, Harness] = {}
"""Each harness by the name of what it reads."""

_INPUTS = FolderRecord("base", "shape", {}, {})

_LAYOUT = Layout(Path("/ws/build"), Path("/ws/install"), None)
_FOLDER = tempfile.TemporaryDirectory(prefix="forge-fuzz-")
ROOM = Path(_FOLDER.name)
"""The folder for files that forge reads; it is removed when the program ends."""


def harness(function: Harness) -> Harness:
    """Put a harness into the table, under its own name with dashes."""
    HARNESSES[function.__name__.replace("_", "-")] = function
    return function


def place(folder: str, name: str, data: bytes) -> Path:
    """Write a file into a folder below ROOM and return the folder."""
    path = ROOM / folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    return ROOM / folder


@harness
def manifest(data: bytes) -> None:
    with contextlib.suppress(ForgeError):
        found = parse_manifest(data, Path("package.xml"), ROS_DEFAULTS)
        manifest_variables(found)
        package = Package(Path("src/p"), found)
        needed = {
            need.name: replace(package, manifest=replace(found, name=need.name))
            for need in found.dependencies
        }
        list(unmet_versions({**needed, found.name: package}))


@harness
def condition(data: bytes) -> None:
    with contextlib.suppress(ConditionError):
        holds(data.decode("utf-8", "surrogateescape"), ROS_DEFAULTS)


def definition(relative: str, data: bytes) -> None:
    """Read a definition, and convert it to IDL and a hash if it is valid."""
    with contextlib.suppress(ForgeError):
        source = read_source("fuzzed", place("definitions", relative, data), relative)
        interface = parse(source)
        catalog = resolve("fuzzed", [Parsed(source, interface)], Library())
        hashes(catalog)
        parse(Source("fuzzed", "msg/X.idl", Path("X.idl"), idl_text(interface, relative)))


for _name, _relative in {
    "message": "msg/X.msg",
    "service": "srv/X.srv",
    "action": "action/X.action",
    "idl": "msg/X.idl",
}.items():
    HARNESSES[_name] = partial(definition, _relative)


@harness
def schema(data: bytes) -> None:
    with contextlib.suppress(InterfaceError):
        parse_all(read_schema(data.decode("utf-8", "surrogateescape"), TypeName("fuzzed", "msg", "X")))


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
    configuration("defaults", "colcon_defaults.yaml", data)


@harness
def forge_toml(data: bytes) -> None:
    configuration("toml", "forge.toml", data, profile="fast")
    with contextlib.suppress(ForgeError):
        read_overrides(ROOM / "toml", (), None)


@harness
def metas(data: bytes) -> None:
    root = place("metas", "colcon.meta", data)
    place("metas", "p/package.xml", PLAIN)
    with contextlib.suppress(ForgeError):
        workspace(root, overrides=read_overrides(root, ("colcon.meta",), None))


@harness
def colcon_pkg(data: bytes) -> None:
    place("colcon_pkg", "p/package.xml", PLAIN)
    workspace(place("colcon_pkg", "p/colcon.pkg", data))


@harness
def mixin(data: bytes) -> None:
    root = place("mixins", "a.mixin", data)
    with contextlib.suppress(ForgeError):
        mixins = read_mixins((), (str(root / "a.mixin"),))
        for verb, name in mixins:
            with contextlib.suppress(ForgeError):
                combined([name], verb, mixins)


def workspace(root: Path, **overrides: Any) -> None:
    """Discover the packages of a folder, and read the settings of each; discovery raises no errors."""
    found = discover(root, ["."], {}, **overrides)
    for package in found.packages.values():
        package.option_values("cmake-args")
        json.dumps(package.settings, default=str)
        manifest_variables(package.manifest)
    for problem in (*found.problems, *found.notes):
        problem.render()


@harness
def cmake_lists(data: bytes) -> None:
    workspace(place("cmake", "CMakeLists.txt", data))


@harness
def setup_py(data: bytes) -> None:
    """Read a setup.py, which is never executed."""
    workspace(place("setup_py", "setup.py", data))


@harness
def setup_cfg(data: bytes) -> None:
    place("setup_cfg", "setup.py", b"from setuptools import setup\nsetup()\n")
    folder = place("setup_cfg", "setup.cfg", data)
    workspace(folder)
    with contextlib.suppress(ForgeError):
        setup_cfg_option(folder / "setup.cfg", "install", "install_scripts")


@harness
def pyproject(data: bytes) -> None:
    folder = place("pyproject", "pyproject.toml", data)
    workspace(folder)
    with contextlib.suppress(ForgeError):
        build_system(folder)


@harness
def journal(data: bytes) -> None:
    """Read the journal of earlier builds, which a crash or another version may have left in any state."""
    folder = place("journal", "forge_journal.jsonl", data)
    found = Journal(folder / "forge_journal.jsonl")
    found.read(data.decode("utf-8", "surrogateescape"))
    find_changed_externals(found, FileTable(folder / "none.json"))
    for name, record in sorted(found.records.items()):
        found.set_record(name, record)
    found.close()


@harness
def tables(data: bytes) -> None:
    """Read the JSON files that forge writes for itself."""
    build = place("tables", "forge_files.json", data)
    table = FileTable(build / "forge_files.json")
    table.digest(str(ROOM / "tables" / "forge_files.json"), (build / "forge_files.json").stat())
    place("tables", "p/.forge/record.json", data)
    place("tables", ".forge.json", data)
    states, last = InstalledStates(build), last_record(build / "p")
    prepare_build_dir(build / "p", last, _INPUTS, states, table, can_reuse=True, reconfigure=False)
    with contextlib.suppress(ForgeError):
        recorded_underlays(build)
        recorded_python(build)
    place("tables", ".forge/p.json", data)
    read_states(build)


@harness
def dsv(data: bytes) -> None:
    prefix = place("dsv", "share/p/package.dsv", data)
    sourcing._read_edits.cache_clear()
    with contextlib.suppress(ForgeError):
        edits = sourcing.package_edits("p", prefix)
        for shell in SHELLS:
            write_if_changed(
                ROOM / "local_setup", local_setup(shell, prefix, [PackageEdits("p", "p", edits)])
            )
            write_if_changed(ROOM / "package", package_setup(shell, prefix, PackageEdits("p", "", edits)))


@harness
def install_index(data: bytes) -> None:
    root = place("index", ".colcon_install_layout", b"merged\n")
    place("index", "share/colcon-core/packages/p", data)
    installed_packages(root)
    place("index", ".colcon_install_layout", data)
    installed_packages(root)


@harness
def build_logs(data: bytes) -> None:
    build = place("ninja", ".ninja_deps", b"# ninjadeps\n\x04\0\0\0" + data)
    place("ninja", "build.ninja", data)
    place("ninja", "CMakeFiles/rules.ninja", b"")
    reported_inputs(build, read_native_graph(build), [])
    made = place("make", "a.o.d", data)
    place("make", "CMakeFiles/a.dir/build.make", data)
    place("make", "CMakeFiles/Makefile.cmake", data)
    reported_inputs(made, read_native_graph(made), [])
    place("make", "p/install_manifest.txt", data)
    [*listed_files(made / "p")]
    place("make", "p/compile_commands.json", data)
    merge_compile_commands(made, force=True)


@harness
def test_results(data: bytes) -> None:
    base = place("results", "p/result.xunit.xml", data)
    place("results", "q/Testing/TAG", b"run\n")
    place("results", "q/Testing/run/Test.xml", data)
    collect(base)
    tagged = place("tags", "p/Testing/TAG", data)
    collect(tagged)


@harness
def make_flags(data: bytes) -> None:
    """Read MAKEFLAGS with the address of a jobserver."""
    flags = read_make_flags(data.decode("utf-8", "surrogateescape"))
    flags.line(3, "fifo:/x")
    if flags.auth and "\0" not in flags.auth:
        pool = join_pool(flags.auth if "fifo" in flags.auth else f"1{flags.auth}")
        if pool:
            pool.close()


@harness
def generator_arguments(data: bytes) -> None:
    from forge.cli.main import main

    folder = place("arguments", "generate.args", data)
    argv = ["interface", "generate", f"@{folder}/generate.args", "--output", str(ROOM / "generated")]
    with (
        (ROOM / "said").open("w", errors="replace") as said,
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(said),
        contextlib.suppress(SystemExit),
    ):
        assert main(argv) in {0, 2}


@harness
def action_result(data: bytes) -> None:
    """Read the entry of a key in a remote cache; encoding it again gives the same entry."""
    with contextlib.suppress(ValueError):
        found = action_results.decode(data)
        assert action_results.decode(action_results.encode(found)) == found


@harness
def stored_result(data: bytes) -> None:
    """Read the entry of a key in a cache folder; encoding it again gives the same entry."""
    with contextlib.suppress(ValueError):
        found = decode_result(data)
        assert decode_result(encode_result(found)) == found


@harness
def cached_tree(data: bytes) -> None:
    """Read the index of a cached package, which may be hostile; no path leads out of the folder."""
    with contextlib.suppress(ValueError):
        tree = decode_index(data)
        assert decode_index(encode_index(tree)) == tree
        for path in (*(leaf.path for leaf in tree.leaves), *dict(tree.folders)):
            assert not Path(path).is_absolute()
            assert ".." not in Path(path).parts


@harness
def cached_inputs(data: bytes) -> None:
    found = keys.decode_lists(data)
    assert keys.decode_lists(keys.encode_lists(found)) == tuple(dict.fromkeys(found))
    with contextlib.suppress(ValueError):
        origin = keys.decode_origin(data)
        assert keys.decode_origin(keys.encode_origin(origin)) == origin


PLAIN = b"""<package format="3"><name>p</name><version>1.0.0</version><description>A</description>
<maintainer email="a@b.cc">A</maintainer><license>L</license></package>"""
