"""Options from files: precedence, messages, profiles and mixins."""

import json
from pathlib import Path
from typing import Any

import pytest

from forge import __version__
from forge.base.formats import read_toml
from forge.workspace import forge_toml
from tests.conftest import Forge, Tree
from tests.packages import manifest_text


@pytest.fixture
def root(tree: Tree) -> Path:
    """Return a workspace of packages a and b, and the user's folder 'home'."""
    return tree(
        {"src/a/package.xml": manifest_text("a"), "src/b/package.xml": manifest_text("b"), "home/x": ""}
    )


def listed(forge: Forge, root: Path, *argv: str, **env: str) -> str:
    """Return the names that `forge list -n` prints, and what it tells."""
    ran = forge("list", "-n", *argv, cwd=root, env={"COLCON_HOME": str(root / "home"), **env})
    return " ".join(ran.out.split()) + ran.err


def test_nearer_files_and_the_command_line_take_precedence(forge: Forge, root: Path) -> None:
    assert listed(forge, root) == "a b"
    (root / "home/defaults.yaml").write_text("list: {packages-select: [a]}")
    assert listed(forge, root) == "a"
    (root / "colcon_defaults.yaml").write_text("list: {packages-select: [b]}")
    assert listed(forge, root) == "b"
    (root / "forge.toml").write_text(
        '[list]\npackages-select = []\n[profiles.one.list]\npackages-select = ["a"]\n'
    )
    assert listed(forge, root) == ""
    assert listed(forge, root, "--profile", "one") == "a"
    assert listed(forge, root, FORGE_PROFILE="one") == "a"
    assert listed(forge, root, "--profile", "one", "--packages-select", "b") == "b"


def test_a_different_defaults_file_can_be_selected(forge: Forge, root: Path) -> None:
    (root / "mine.yaml").write_text("list: {packages-skip: [a]}")
    assert listed(forge, root, COLCON_DEFAULTS_FILE=str(root / "mine.yaml")) == "b"


def test_paths_on_the_command_line_replace_those_of_files(forge: Forge, root: Path) -> None:
    (root / "colcon_defaults.yaml").write_text("list: {base-paths: [src/b]}")
    assert listed(forge, root) == "b"
    assert listed(forge, root, "--paths", "src/*") == "a b"
    assert listed(forge, root, "--paths", "src/a", "--base-paths", "src/b") == "a b"
    (root / "colcon_defaults.yaml").write_text("list: {paths: [src/b]}")
    assert listed(forge, root, "--base-paths", "src/a") == "a"


def test_misspelt_tables_of_forge_toml_are_reported(forge: Forge, root: Path) -> None:
    tables = (
        "biuld",
        "profile.fast.build",
        "profiles.fast.tets",
        "my_plugin",
        "packages.a",
        "profiles.biuld.build",
    )
    (root / "forge.toml").write_text("".join(f"[{each}]\n" for each in tables))
    assert listed(forge, root) == "a b" + "".join(
        f"{root}/forge.toml: warning: no command reads the table [{table}]\nhint: did you mean '{near}'?\n"
        for table, near in (("biuld", "build"), ("profile", "profiles"), ("profiles.fast.tets", "test"))
    )


def test_two_definitions_in_one_argument_are_reported_with_the_package(forge: Forge, root: Path) -> None:
    (root / "forge.toml").write_text("[packages.a]\ncmake-args = ['-DA=1 -DB=2']\n")
    told = forge("build", "--dry-run", cwd=root).err
    assert "src/a: warning: --cmake-args contains '-DA=1 -DB=2' as one argument" in told


def test_invalid_settings_are_reported_and_ignored(forge: Forge, root: Path) -> None:
    (root / "colcon_defaults.yaml").write_text(
        "list: {packages-selekt: [a], packages-skip: a, names-only: 1, metas: [2]}\n"
        "build: {parallel-workers: many, executor: none, jobs: 2, build-base: 1}"
    )
    told = listed(forge, root)
    assert told.startswith("a b")
    assert "'forge list' has no option 'packages-selekt'\nhint: did you mean 'packages-select'?" in told
    assert "option 'packages-skip' of 'forge list' expects a list, not 'a'" in told
    assert "option 'names-only' of 'forge list' expects true or false, not 1" in told
    assert "option 'metas' of 'forge list' expects a list in which each element is a string, not [2]" in told
    told = forge("build", "--packages-select", cwd=root).err
    assert "option 'parallel-workers' of 'forge build': 'many' is not a number of packages" in told
    assert "option 'executor' of 'forge build' expects one of parallel, sequential, dask, not 'none'" in told
    assert "option 'build-base' of 'forge build' expects a string, not 1" in told


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("colcon_defaults.yaml", "a: [", "colcon_defaults.yaml:1:5: error: not well-formed YAML"),
        ("colcon_defaults.yaml", "- a", "error: the file is not a mapping"),
        ("colcon_defaults.yaml", "list: 1", "error: 'list' is not a table of options"),
        ("forge.toml", "a = ", "error: not well-formed TOML"),
        ("forge.toml", "packages = 1", "error: 'packages' is not a table of options"),
        ("colcon.meta", "names: [a]", "error: 'names' is not a mapping of names to options"),
    ],
)
def test_an_unreadable_configuration_file_is_an_error(
    forge: Forge, root: Path, file: str, text: str, message: str
) -> None:
    (root / file).write_text(text)
    assert message in listed(forge, root)


def test_an_empty_file_sets_nothing(forge: Forge, root: Path) -> None:
    (root / "colcon_defaults.yaml").write_text("")
    assert listed(forge, root) == "a b"


def test_a_missing_profile_is_an_error(forge: Forge, root: Path) -> None:
    (root / "forge.toml").write_text("[profiles.debug.build]\n")
    assert "unknown profile 'debg'\nhint: did you mean 'debug'?" in listed(forge, root, "--profile", "debg")
    assert "write a table [profiles.zzz.build]" in listed(forge, root, "--profile", "zzz")


def test_mixins_are_overridden_by_the_command_line(forge: Forge, root: Path) -> None:
    (root / "home/mixin/.hidden").mkdir(parents=True)
    (root / "home/mixin/.hidden/no.mixin").write_text("- nonsense")
    (root / "home/mixin/my.mixin").write_text(
        "list:\n  only-a: {packages-skip: [b], since: v1}\n  both: {mixin: [only-a], packages-skip: [c]}\n"
        "  round: {mixin: [round]}\n"
    )
    assert listed(forge, root, "--mixin", "only-a") == "a"
    told = listed(forge, root, "--mixin", "both", "--packages-skip", "a", "--strict")
    assert "no package named 'c'" in told
    assert listed(forge, root, "--mixin", "only-a", "--packages-skip", "a", "--since", "v2") == ""
    assert "mixins include each other: round -> round" in listed(forge, root, "--mixin", "round")
    told = listed(forge, root, "--mixin", "only-b")
    assert "unknown mixin 'only-b' for 'forge list'\nhint: did you mean 'only-a'?" in told
    (root / "colcon_defaults.yaml").write_text("list: {mixin: [only-a]}")
    assert listed(forge, root) == "a"


def test_mixin_files_extend_the_mixins_of_the_user(forge: Forge, root: Path) -> None:
    (root / "one.mixin").write_text("list: {x: {packages-select: [b]}}")
    assert listed(forge, root, "--mixin-files", "one.mixin", "--mixin", "x") == "b"
    assert "cannot read mixin file: No such file" in listed(
        forge, root, "--mixin-files", "no", "--mixin", "x"
    )
    (root / "one.mixin").write_text("list: {x: 1}")
    assert "'list' is not a mapping of names to options" in listed(
        forge, root, "--mixin-files", "one.mixin", "--mixin", "x"
    )


def test_an_environment_variable_adds_mixin_folders(forge: Forge, root: Path) -> None:
    for name in ("one", "two"):
        (root / name / "deep").mkdir(parents=True)
        (root / name / "deep/x.mixin").write_text(f"list: {{{name}: {{packages-select: [b]}}}}")
    folders = f"{root}/one:{root}/two:"
    assert listed(forge, root, "--mixin", "two", COLCON_MIXIN_PATH=folders) == "b"
    assert "unknown mixin 'two'" in listed(forge, root, "--mixin", "two")


def test_package_options_come_from_four_sources(forge: Forge, root: Path) -> None:
    (root / "src/a/colcon.pkg").write_text("{cmake-args: [-D1], name: a, dependencies: [x], hooks: [h.sh]}")
    (root / "home/metadata").mkdir()
    (root / "home/metadata/my.meta").write_text("{names: {a: {cmake-args: [-D2]}}}")
    (root / "colcon.meta").write_text(
        "paths: {src/a: {cmake-args: [-D3], run-dependencies: [y], vendor: {k: 1}}}"
    )
    (root / "forge.toml").write_text('[packages.a]\ncmake-args = ["-D4"]\nctest-args = ["-V"]\n')
    env = {"COLCON_HOME": str(root / "home")}
    (said,) = json.loads(forge("info", "--json", "a", cwd=root, env=env).out)["packages"]
    assert said["metadata"]["cmake-args"] == ["-D1", "-D2", "-D4", "-D3"]
    assert said["metadata"]["ctest-args"] == ["-V"]
    assert said["metadata"]["vendor"] == {"k": 1}
    assert said["dependencies"] == {"build": ["x"], "run": ["x", "y"], "test": ["x"]}
    assert said["hooks"] == ["h.sh"]
    ran = forge("info", "--json", "a", "--ignore-user-meta", cwd=root, env=env)
    (said,) = json.loads(ran.out)["packages"]
    assert "-D2" not in said["metadata"]["cmake-args"]
    paragraph = forge("info", "a", cwd=root, env=env).out
    assert "  hooks: h.sh\n  metadata:\n    cmake-args: [" in paragraph


def test_global_options_can_be_set_in_files(forge: Forge, root: Path) -> None:
    (root / "colcon_defaults.yaml").write_text("'': {log-level: nonsense, other: 1}")
    assert "unknown log level 'nonsense'" in forge("build", "--packages-select", cwd=root).err
    ran = forge("--log-level", "error", "build", "--packages-select", cwd=root)
    assert "nonsense" not in ran.err


def test_configuration_tables_are_printed(forge: Forge) -> None:
    shown = forge("extensions").out
    assert shown.startswith("commands (entry points 'forge.commands'):\n  add ")
    assert "\nbuild types (entry points 'forge.build_types'):\n  ament_cargo   ros-forge " in shown
    assert "\ninterface targets (entry points 'forge.interfaces.targets'):\n  arrow " in shown
    assert "\nexecutors (entry points 'forge.executors'):\n  dask        ros-forge " in shown
    assert f"\nshells:\n  bash  ros-forge {__version__}\n" in shown


def test_forge_toml_is_read_once_until_it_changes(
    forge: Forge, root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reads = []

    def read(content: bytes, path: Path) -> dict[str, Any]:
        reads.append(path)
        return read_toml(content, path)

    monkeypatch.setattr(forge_toml, "read_toml", read)
    for number, text in enumerate(("[list]\npackages-skip = ['a']\n", "[list]\npackages-skip = ['b']\n")):
        (root / "forge.toml").write_text(text)
        assert listed(forge, root) == "ba"[number]
        assert len(reads) == number + 1


def test_a_file_named_by_a_variable_is_read_once(forge: Forge, root: Path) -> None:
    (root / "colcon_defaults.yaml").write_text("list: {no-such-option: 1}")
    ran = forge("list", cwd=root, env={"COLCON_DEFAULTS_FILE": "./colcon_defaults.yaml"})
    assert ran.err.count("has no option 'no-such-option'") == 1
