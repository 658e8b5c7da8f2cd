"""Distributions beside forge extend the steps of CMake packages."""

from pathlib import Path

from tests.conftest import Tree
from tests.integration.test_plugins import PAGE, run_forge
from tests.packages import distribution, manifest_text
from tests.snippets import blocks

RECIPE = next(block.text for block in blocks(PAGE) if "def addition" in block.text)
CMAKE = """cmake_minimum_required(VERSION 3.15)
project(a NONE)
add_custom_target(show ALL COMMAND sh "${CMAKE_SOURCE_DIR}/show.sh")
"""


def workspace(tree: Tree, recipe: str = RECIPE) -> Path:
    """Make a workspace with one package, and a distribution with a recipe in its root."""
    return tree(
        {
            "src/a/package.xml": manifest_text("a", build_type="cmake"),
            "src/a/CMakeLists.txt": CMAKE,
            "src/a/show.sh": 'echo "$FORGE_GREETING from $(nice)"\n',
            "polite.py": recipe,
            **distribution("polite", "forge.recipes"),
        }
    )


def log(root: Path) -> str:
    """Return what the programs of the last build have printed."""
    return (root / "log/latest_build/a/stdout_stderr.log").read_text(encoding="utf-8")


def test_recipes_can_add_files_a_launcher_and_variables(tree: Tree) -> None:
    root = workspace(tree)
    ran = run_forge(root, "build", "--recipes", "polite", path=root)
    assert ran.returncode == 0, ran.stderr
    assert "configuring a\n" in log(root)
    assert "hello from 10\n" in log(root)
    assert "FORGE_GREETING" not in (root / "build/a/.forge/environment.sh").read_text(encoding="utf-8")
    assert "1 package unchanged" in run_forge(root, "build", "--recipes", "polite", path=root).stdout
    tree({"polite.py": RECIPE.replace("configuring", "preparing")})
    ran = run_forge(root, "build", "--recipes", "polite", "--explain", path=root)
    assert "the recipe 'polite' changed" in ran.stdout
    assert "preparing a\n" in log(root)


def test_recipes_are_used_only_if_named(tree: Tree) -> None:
    root = workspace(tree)
    assert run_forge(root, "build", path=root).returncode == 0
    assert "configuring" not in log(root)
    tree({"forge.toml": '[build]\nrecipes = ["polite"]\n'})
    assert run_forge(root, "build", path=root).returncode == 0
    assert "configuring a\n" in log(root)


def test_an_unknown_recipe_is_an_error(tree: Tree) -> None:
    root = workspace(tree)
    ran = run_forge(root, "build", "--recipes", "missing", path=root)
    assert (ran.returncode, ran.stderr) == (
        2,
        "error: no installed distribution provides the recipe 'missing'\n"
        "hint: install it beside forge, source its workspace, or remove 'missing' from '--recipes'\n",
    )


def test_an_error_in_a_recipe_has_a_location(tree: Tree) -> None:
    root = workspace(tree, RECIPE.replace("return nullcontext", "return missing_context"))
    ran = run_forge(root, "build", "--recipes", "polite", path=root)
    assert ran.returncode == 2
    assert "error: the recipe 'polite' failed: NameError: name 'missing_context' is not defined" in ran.stderr
