"""The architecture of docs/explanation/architecture.md: packages, imports, start-up time."""

from __future__ import annotations

import ast
import graphlib
import itertools
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pytest

from forge.base.extensions import OWN
from forge.base.formats import read_toml
from tests.packages import manifest_text
from tests.without_plugins import GROUPS, PLUGINS

ROOT = Path(__file__).parents[1]

PACKAGES = (
    *(
        "base",
        "interfaces",
        "environment",
        "workspace",
        "toolchain",
        "engine",
        "build",
        "cache",
        "execution",
        "testing",
    ),
    *("output", "cli", "plugins"),
)
"""The packages of forge/; each may import those before it. What lies in none of them starts the command."""

IMPURE = frozenset({"os", "subprocess", "threading", "time", "logging"})
"""What a module that calls itself pure does not import."""
HEAVY = frozenset(
    {"fsspec", "jinja2", "lark", "lsprotocol", "networkx", "numpy", "pygls", "rich", "setuptools", "urllib3"}
    | {"watchfiles", "yaml"}
)


@dataclass(frozen=True, slots=True)
class Arrow:
    """An import, also one in a function: of which module, in which line, and if only type checkers see it."""

    target: str
    line: int
    for_types: bool


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


def floor_of(module: str) -> int:
    """Return the position of a module's package; what lies in none comes last."""
    package = module.partition(".")[0]
    return PACKAGES.index(package) if package in PACKAGES else len(PACKAGES)


@cache
def all_arrows() -> tuple[tuple[str, Arrow], ...]:
    """Return all imports with the module that has them, forge's own ones as names below forge."""
    return tuple(
        (module, arrow) for module, tree in modules().items() for arrow in _arrows(tree, for_types=False)
    )


def _arrows(node: ast.AST, *, for_types: bool) -> Iterator[Arrow]:
    for child in ast.iter_child_nodes(node):
        match child:
            case ast.Import(names=names):
                yield from (Arrow(_below_forge(name.name), child.lineno, for_types) for name in names)
            case ast.ImportFrom(module=str(module), names=names, level=0):
                for name in names:
                    whole = _below_forge(f"{module}.{name.name}")
                    target = whole if whole in modules() else _below_forge(module)
                    yield Arrow(target, child.lineno, for_types)
            case ast.ImportFrom():
                yield Arrow("a relative import", child.lineno, for_types)
            case _:
                yield from _arrows(child, for_types=for_types or _for_types(child))


def _is_pure(tree: ast.Module) -> bool:
    return "pure." in (ast.get_docstring(tree) or "").partition("\n")[0]


def _for_types(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def _below_forge(name: str) -> str:
    """Return forge.x.y as 'x.y', forge as '.', and what is not ours with a colon in front."""
    if name == "forge":
        return "."
    return name.removeprefix("forge.") if name.startswith("forge.") else f":{name}"


def test_forge_contains_only_the_listed_packages() -> None:
    files = {"__init__.py", "__main__.py", "py.typed", "embedded"}
    entries = [path for path in (ROOT / "forge").iterdir() if not path.is_dir() or any(path.rglob("*.*[!c]"))]
    assert {path.name for path in entries} - {"_templates"} == files.union(PACKAGES)


def test_every_package_is_documented() -> None:
    page = (ROOT / "docs/explanation/architecture.md").read_text(encoding="utf-8")
    assert [name for name in PACKAGES if f"`{name}`" not in page] == []


def test_imports_point_to_the_same_or_a_lower_layer() -> None:
    assert not [
        f"{module}:{arrow.line}: {arrow.target}"
        for module, arrow in all_arrows()
        if not arrow.target.startswith(":")
        and floor_of(arrow.target) > floor_of(module)
        and arrow.target != "."
    ]


def test_pure_modules_do_not_access_the_machine() -> None:
    assert not [
        (module, arrow)
        for module, arrow in all_arrows()
        if _is_pure(modules()[module]) and arrow.target.removeprefix(":").split(".")[0] in IMPURE
    ]


def test_the_interface_compiler_does_not_import_the_build() -> None:
    assert not [
        (module, arrow)
        for module, arrow in all_arrows()
        if module.startswith("interfaces")
        and not arrow.target.startswith((":", "base", "interfaces"))
        and arrow.target != "."
    ]


def test_building_does_not_import_the_interface_compiler() -> None:
    assert not [
        (module, arrow)
        for module, arrow in all_arrows()
        if not module.startswith(("interfaces", "cli.commands", "plugins"))
        and arrow.target.startswith("interfaces")
    ]


def plugin_of(module: str) -> str | None:
    """Return the plugin that a module belongs to, None for the core."""
    return module.split(".")[1] if module.startswith("plugins.") else None


def test_plugins_are_imported_neither_by_the_core_nor_by_each_other() -> None:
    assert not [
        (module, arrow)
        for module, arrow in all_arrows()
        if plugin_of(arrow.target) not in {None, plugin_of(module)}
    ]


def public_modules(package: str) -> Iterator[str]:
    """Yield the modules in `__all__` of a package, and for packages among them, those in theirs."""
    for node in modules()[package].body if package in modules() else ():
        match node:
            case ast.Assign(targets=[ast.Name("__all__")], value=value):
                for name in ast.literal_eval(value):
                    module = f"{package}.{name}"
                    yield from list(public_modules(module)) or [module]


def test_plugins_import_only_public_modules_of_the_core() -> None:
    public = {module for package in PACKAGES[:-1] for module in public_modules(package)}
    assert public - modules().keys() == {"interfaces.Types", "interfaces.load"}
    assert not [
        f"{module}:{arrow.line}: {arrow.target}"
        for module, arrow in all_arrows()
        if plugin_of(module)
        and not arrow.target.startswith((":", ".", "plugins."))
        and arrow.target not in public
    ]


def test_no_module_imports_private_names_of_another() -> None:
    assert not [
        (module, name.name)
        for module, tree in modules().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("forge")
        for name in node.names
        if name.name.startswith("_") and not name.name.endswith("__")
    ]


@pytest.mark.parametrize("folder", ["unit", *(f"plugins/{plugin}" for plugin in PLUGINS)])
def test_quick_tests_import_only_their_own_plugin(folder: str) -> None:
    texts = [path.read_text(encoding="utf-8") for path in (ROOT / "tests" / folder).rglob("*.py")]
    named = {name for text in texts for name in re.findall(r"\b(?:forge|tests)\.plugins\.(\w+)", text)}
    assert named <= {folder.partition("/")[2]}


def test_for_each_pair_of_plugins_a_group_has_only_the_first() -> None:
    groups = [set(group) for group in GROUPS.values()]
    pairs = {pair for group in groups for pair in itertools.product(group, set(PLUGINS) - group)}
    assert pairs == set(itertools.permutations(PLUGINS, 2))


def test_pyproject_lists_all_plugins() -> None:
    project = read_toml((ROOT / "pyproject.toml").read_bytes(), ROOT / "pyproject.toml")["project"]
    assert project["entry-points"] == OWN


def test_forge_does_not_import_its_embedded_packages() -> None:
    assert not [module for module, arrow in all_arrows() if "embedded" in arrow.target]


def test_imports_are_acyclic() -> None:
    graph: dict[str, set[str]] = {}
    for module, arrow in all_arrows():
        if not arrow.for_types:
            graph.setdefault(module, set()).add(arrow.target)
    graphlib.TopologicalSorter(graph).prepare()


def test_only_the_command_line_imports_argparse() -> None:
    importing = {module for module, arrow in all_arrows() if arrow.target == ":argparse"}
    assert not [module for module in importing if not module.startswith(("cli.", "plugins."))]


def test_every_module_has_a_docstring() -> None:
    assert not [module for module, tree in modules().items() if not (ast.get_docstring(tree) or "").strip()]


@pytest.mark.parametrize(
    "argv",
    [
        *(("--help",), ("--version",), ("list",), ("list", "--help"), ("pkg", "list"), ("run", "a", "b")),
        *(("build", "--help"), ("info",), ("graph",)),
        *(("test", "--help"), ("test-result", "--help"), ("clean", "--help"), ("completion", "--help")),
    ],
)
def test_light_commands_import_no_heavy_modules(argv: tuple[str, ...], tmp_path: Path) -> None:
    script = (
        "import sys\nfrom forge.cli.main import main\n"
        f"try:\n    main({argv!r})\nexcept SystemExit:\n    pass\n"
        f"print('heavy:', sorted({set(HEAVY)!r} & sys.modules.keys()))\n"
    )
    for name, need in (("a", ""), ("b", "<depend>a</depend>")):
        (tmp_path / "src" / name).mkdir(parents=True)
        (tmp_path / "src" / name / "package.xml").write_text(manifest_text(name, need), encoding="utf-8")
    env = {"PYTHONPATH": str(ROOT), "AMENT_PREFIX_PATH": str(tmp_path)}
    ran = subprocess.run(
        [sys.executable, "-c", script], env=env, cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert ran.stdout.endswith("heavy: []\n")
