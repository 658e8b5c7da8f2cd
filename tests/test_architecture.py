"""The house as docs/explanation/architecture.md draws it: floors, arrows, sizes, and a light front door."""

from __future__ import annotations

import ast
import graphlib
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parents[1]

FLOORS = {
    4: """
        __main__ cli cluster.joining cluster.telling commands commands.* manner options package_options
        preparation testing.preparing undertaking watching worker workspace caching.opening audit.opening
    """,
    3: """
        backend_inputs backend_tracer backends
        budget capacity digests discovery execution explaining externals feed folders installation
        installed interpreter jobs jobserver journal lending live occupancy prefixes records reporting results
        runner snapshot sourcing started steps toolchain tools transcript wheels configuration
        identification identity limits mixins overrides plain_packages testing testing.*
        worker_client workspace_root cleaning compile_commands completion_words interfaces
        interfaces.loading interfaces.records interfaces.sources interfaces.writing
        audience bundling fallback links ownership underlays saves interrupts config_search named_inputs
        program_lookup build_texts
        pictures.pages pictures.sampling
        examining.machine examining.naming examining.packages examining.programs
        examining.subject examining.surroundings
        needs.rosdep_files needs.system_packages scenes unfound pitfalls
        caching caching.* cluster cluster.* build build.* audit audit.*
        launching.accounts launching.farms launching.icecream
    """,
    2: """
        cmake_reading conditions constraints creation diagnosis environment formats freshness
        graph hooks makeflags manifest planning provision python_reading recipes recipes.* schedule settings
        scripts selection shells xml_tree interfaces.* testing.outcomes testing.recipes testing.showing
        completing hints progress source_names unused_variables
        named_variables assignments lengths places excerpts pictures pictures.* caching.action_result
        examining examining.* needs needs.* mistyped launching launching.*
        audit.accesses audit.comparison audit.untracked
    """,
    1: "model layout interfaces.model caching.model",
    0: ". deferred durations errors refusals frozen names files templating ament_index",
}
"""Each module below forge/ by its floor; '.' is the package itself, the most exact pattern counts."""

PURE = (1, 2)
IMPURE = frozenset({"os", "subprocess", "threading", "time", "logging"})
HEAVY = frozenset(
    {"fsspec", "jinja2", "lark", "networkx", "numpy", "rich", "setuptools", "urllib3", "watchfiles", "yaml"}
)
LONGEST_FUNCTION = 60
LONGEST_MODULE = 400


@dataclass(frozen=True, slots=True)
class Arrow:
    """An import: of a module, where, and whether it is followed when its module is imported."""

    target: str
    line: int
    at_start: bool


@cache
def modules() -> dict[str, ast.Module]:
    """Return forge's own modules by their dotted name below forge; what it brings along is data."""
    found = {}
    for path in sorted((ROOT / "forge").rglob("*.py")):
        relative = path.relative_to(ROOT / "forge")
        if relative.parts[0] not in {"embedded", "_templates"}:
            parts = (*relative.parts[:-1], *(() if relative.stem == "__init__" else (relative.stem,)))
            found[".".join(parts) or "."] = ast.parse(path.read_text(encoding="utf-8"))
    return found


@cache
def floor_of(module: str) -> int | None:
    """Return the floor of the longest pattern that fits a module."""
    fits = (
        (len(pattern), floor)
        for floor, patterns in FLOORS.items()
        for pattern in patterns.split()
        if pattern == module or (pattern.endswith(".*") and module.startswith(pattern[:-1]))
    )
    return max(fits, default=(0, None))[1]


@cache
def arrows(module: str) -> tuple[Arrow, ...]:
    """Return all imports of a module, forge's own ones as names below forge."""
    return tuple(_arrows(modules()[module], at_start=True))


def _arrows(node: ast.AST, *, at_start: bool) -> Iterator[Arrow]:
    for child in ast.iter_child_nodes(node):
        match child:
            case ast.Import(names=names):
                yield from (Arrow(_below_forge(name.name), child.lineno, at_start) for name in names)
            case ast.ImportFrom(module=str(module), names=names, level=0):
                for name in names:
                    whole = _below_forge(f"{module}.{name.name}")
                    target = whole if whole in modules() else _below_forge(module)
                    yield Arrow(target, child.lineno, at_start)
            case ast.ImportFrom():
                yield Arrow("a relative import", child.lineno, at_start)
            case _:
                deferred = isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef) or _for_types(child)
                yield from _arrows(child, at_start=at_start and not deferred)


def _for_types(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def _below_forge(name: str) -> str:
    """Return forge.x.y as 'x.y', forge as '.', and what is not ours with a colon in front."""
    if name == "forge":
        return "."
    return name.removeprefix("forge.") if name.startswith("forge.") else f":{name}"


@pytest.mark.parametrize("module", modules())
def test_every_module_has_a_floor(module: str) -> None:
    assert floor_of(module) is not None, "write it into FLOORS above and into the page on architecture"


def test_every_module_of_building_has_a_line_in_the_map() -> None:
    page = (ROOT / "docs/explanation/architecture.md").read_text(encoding="utf-8")
    rooms = {module for module in modules() if "." not in module} - {"__init__"}
    assert [name for name in sorted(rooms) if f"{name}.py" not in page and f"{name}/" not in page] == []


def test_every_name_on_a_floor_is_a_module() -> None:
    names = {name for patterns in FLOORS.values() for name in patterns.split() if not name.endswith("*")}
    assert names <= modules().keys()


@pytest.mark.parametrize("module", modules())
def test_arrows_point_down_or_sideways(module: str) -> None:
    up = [
        f"line {arrow.line}: {arrow.target}"
        for arrow in arrows(module)
        if not arrow.target.startswith(":") and (floor_of(arrow.target) or 0) > (floor_of(module) or 0)
    ]
    assert not up


@pytest.mark.parametrize("module", [module for module in modules() if floor_of(module) in PURE])
def test_pure_floors_meet_no_machine(module: str) -> None:
    impure = [arrow for arrow in arrows(module) if arrow.target.removeprefix(":").split(".")[0] in IMPURE]
    assert not impure


@pytest.mark.parametrize("module", [module for module in modules() if module.startswith("interfaces")])
def test_the_interface_compiler_knows_nothing_of_building(module: str) -> None:
    foreign = [
        arrow
        for arrow in arrows(module)
        if not arrow.target.startswith((":", "interfaces")) and floor_of(arrow.target) != 0
    ]
    assert not foreign


@pytest.mark.parametrize("module", [m for m in modules() if not m.startswith(("interfaces", "commands"))])
def test_building_does_not_import_the_interface_compiler(module: str) -> None:
    assert not [arrow for arrow in arrows(module) if arrow.target.startswith("interfaces")]


def test_nothing_imports_what_forge_brings_along() -> None:
    assert not [module for module in modules() for arrow in arrows(module) if "embedded" in arrow.target]


def test_no_import_leads_back_to_where_it_began() -> None:
    graph = {module: {arrow.target for arrow in arrows(module) if arrow.at_start} for module in modules()}
    graphlib.TopologicalSorter(graph).prepare()


@pytest.mark.parametrize("module", modules())
def test_every_module_opens_with_a_sentence(module: str) -> None:
    assert (ast.get_docstring(modules()[module]) or "").strip()


@pytest.mark.parametrize("module", modules())
def test_modules_and_functions_can_be_read_in_one_sitting(module: str) -> None:
    tree = modules()[module]
    lengths = {
        node.name: (node.end_lineno or 0) - node.lineno + 1
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    }
    assert not {name: lines for name, lines in lengths.items() if lines > LONGEST_FUNCTION}
    assert max((getattr(node, "end_lineno", 0) for node in tree.body), default=0) <= LONGEST_MODULE


@pytest.mark.parametrize(
    "argv",
    [
        *(("--help",), ("--version",), ("list", "--help"), ("pkg", "list"), ("run", "a", "b")),
        *(("test", "--help"), ("test-result", "--help"), ("clean", "--help"), ("completion", "--help")),
    ],
)
def test_a_light_command_imports_nothing_heavy(argv: tuple[str, ...], tmp_path: Path) -> None:
    script = (
        "import sys\nfrom forge.cli import main\n"
        f"try:\n    main({argv!r})\nexcept SystemExit:\n    pass\n"
        f"print('heavy:', sorted({set(HEAVY)!r} & sys.modules.keys()))\n"
    )
    env = {"PYTHONPATH": str(ROOT), "AMENT_PREFIX_PATH": str(tmp_path)}
    ran = subprocess.run(
        [sys.executable, "-c", script], env=env, cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert ran.stdout.endswith("heavy: []\n")
