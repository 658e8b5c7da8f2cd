"""Build types of other distributions, and packages whose build type is unknown."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text
from tests.snippets import ROOT, blocks

PAGE = (ROOT / "docs/how-to/build-types.md").read_text(encoding="utf-8")
PLUGIN = next(block.text for block in blocks(PAGE) if block.mark.endswith("forge_make.py"))
METADATA = "Metadata-Version: 2.1\nName: forge-make\nVersion: 1.0\n"
MAKEFILE = """all:
	echo made > greet
install: all
	install -D greet "$(DESTDIR)/lib/greeter/greet"
	ln -s greet "$(DESTDIR)/lib/greeter/link"
check:
	grep -q "$(WORD)" greet
"""


def wheel(folder: Path, plugin: str = PLUGIN) -> Path:
    """Write a wheel with the plugin."""
    path = folder / "forge_make-1.0-py3-none-any.whl"
    info = "forge_make-1.0.dist-info"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("forge_make.py", plugin)
        archive.writestr(f"{info}/METADATA", METADATA)
        archive.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr(
            f"{info}/entry_points.txt", "[forge.build_types]\nmake = forge_make\ncmake = forge_make\n"
        )
        archive.writestr(f"{info}/RECORD", "")
    return path


def install(monkeypatch: pytest.MonkeyPatch, folder: Path, plugin: str = PLUGIN) -> None:
    """Install the wheel into a folder of its own, which is searched for modules."""
    folder.mkdir()
    with zipfile.ZipFile(wheel(folder, plugin)) as archive:
        archive.extractall(folder / "site")
    monkeypatch.syspath_prepend(str(folder / "site"))
    monkeypatch.delitem(sys.modules, "forge_make", raising=False)


@pytest.fixture
def plugin(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Install the plugin of the page."""
    install(monkeypatch, tmp_path / "plugin")


@pytest.fixture
def greeter(tree: Tree) -> Path:
    """Return a workspace with one package that a Makefile builds."""
    return tree(
        {
            "src/greeter/package.xml": manifest_text("greeter", build_type="make"),
            "src/greeter/Makefile": MAKEFILE,
        }
    )


@pytest.mark.usefixtures("plugin")
@pytest.mark.parametrize("layout", ["isolated", "merged"])
def test_a_plugin_from_a_wheel_builds_installs_and_tests(forge: Forge, greeter: Path, layout: str) -> None:
    merged = ("--merge-install",) if layout == "merged" else ()
    ran = forge("build", *merged, cwd=greeter)
    assert ran.code == 0, ran.err
    prefix = greeter / "install" / ("" if merged else "greeter")
    assert (prefix / "lib/greeter/greet").read_text() == "made\n"
    assert (prefix / "lib/greeter/link").readlink() == Path("greet")
    assert (prefix / "share/ament_index/resource_index/packages/greeter").exists()
    assert (prefix / "share/greeter/package.xml").is_file()
    assert "AMENT_PREFIX_PATH" in (prefix / "share/greeter/hook/ament_prefix_path.dsv").read_text()
    assert "1 package unchanged" in forge("build", *merged, cwd=greeter).out
    makefile = greeter / "src/greeter/Makefile"
    makefile.write_text(
        MAKEFILE.replace("lib/greeter/greet", "lib/greeter/salute").replace("ln -s", "# ln -s")
    )
    assert forge("build", *merged, cwd=greeter).code == 0
    assert [path.name for path in (prefix / "lib/greeter").iterdir()] == ["salute"]


@pytest.mark.usefixtures("plugin")
def test_exit_codes_of_plugin_tests_are_interpreted(forge: Forge, greeter: Path) -> None:
    makefile = greeter / "src/greeter/Makefile"
    makefile.write_text(MAKEFILE.replace("$(WORD)", "made"))
    assert forge("build", cwd=greeter).code == 0
    passed = forge("test", "--return-code-on-test-failure", cwd=greeter)
    assert passed.code == 0
    makefile.write_text(MAKEFILE.replace("$(WORD)", "other"))
    ran = forge("test", "--return-code-on-test-failure", cwd=greeter)
    assert ran.code == 1
    assert "1 package had test failures: greeter" in ran.out
    assert " tests, " not in passed.out, "nobody knows how many"
    assert "test reported failed tests, but no result contains one" in ran.out


@pytest.mark.usefixtures("plugin")
def test_test_results_of_plugins_are_counted(forge: Forge, greeter: Path) -> None:
    """Packages that leave none do not change the sum."""
    results = '<testsuite tests="2" errors="0" failures="0" skipped="1"/>'
    makefile = MAKEFILE.replace('grep -q "$(WORD)" greet', f"echo '{results}' > test.xml")
    (greeter / "src/greeter/Makefile").write_text(makefile)
    (greeter / "src/other").mkdir()
    (greeter / "src/other/package.xml").write_text(manifest_text("other", build_type="make"))
    (greeter / "src/other/Makefile").write_text("all install check:\n")
    assert forge("build", cwd=greeter).code == 0
    tested = forge("test", cwd=greeter)
    assert "Summary: 2 packages finished" in tested.out
    assert "\n  2 tests, 0 errors, 0 failures, 1 skipped\n" in tested.out


@pytest.mark.usefixtures("plugin")
def test_a_plugin_upgrade_rebuilds_its_packages(forge: Forge, greeter: Path, tmp_path: Path) -> None:
    assert forge("build", cwd=greeter).code == 0
    with (tmp_path / "plugin/site/forge_make.py").open("a") as stream:
        stream.write("# version 2\n")
    assert "greeter: build, the build type 'make' changed\n" in forge("build", "--dry-run", cwd=greeter).out


TOOLCHAIN = """
def toolchain(packages, context, variables):
    from forge.base.errors import HostError, Problem
    if "MAKER" not in variables:
        raise HostError(Problem(f"no maker for {len(packages)} packages"))
    return "Make", variables["MAKER"]
"""


def test_the_toolchain_of_a_plugin_is_an_input(
    forge: Forge, greeter: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(monkeypatch, greeter / "plugin", PLUGIN + TOOLCHAIN)
    ran = forge("build", cwd=greeter)
    assert (ran.code, "error: no maker for 1 packages\n" in ran.err) == (2, True)
    assert forge("build", cwd=greeter, env={"MAKER": "1"}).code == 0
    ran = forge("build", "--dry-run", cwd=greeter, env={"MAKER": "2"})
    assert "greeter: build, the Make toolchain changed\n" in ran.out
    ran = forge("test", cwd=greeter)
    assert (ran.code, "error: no maker for 1 packages\n" in ran.err) == (2, True)


@pytest.mark.usefixtures("plugin")
@pytest.mark.parametrize(
    "named_by", [{"forge.toml": "build-types = ['make']"}, {"src/x/colcon.pkg": "type: make"}]
)
def test_a_plugin_finds_packages_without_manifest(forge: Forge, tree: Tree, named_by: dict[str, str]) -> None:
    root = tree({"src/x/Makefile": MAKEFILE, "src/y/text": "", **named_by})
    assert forge("list", cwd=root).out == "x\tsrc/x\t(make)\n"


def test_build_types_are_not_loaded_from_the_workspace(forge: Forge, tree: Tree) -> None:
    root = tree({"forge.toml": "build-types = ['make']", "src/x/Makefile": MAKEFILE})
    ran = forge("list", cwd=root)
    assert ran.code == 2
    assert "forge.toml: error: no installed distribution provides the build type 'make'\nhint: " in ran.err
    (root / "forge.toml").write_text("build-types = 'make'")
    assert "forge.toml: error: 'build-types' is not a list of names\n" in forge("list", cwd=root).err
    (root / "forge.toml").unlink()
    (root / "src/x/colcon.pkg").write_text("type: make")
    warning = "warning: the folder was assigned the type '{}', but is not a package: "
    absent = "no installed distribution provides this build type\n"
    assert warning.format("make") + absent in forge("list", cwd=root).err
    (root / "src/x/colcon.pkg").write_text("type: cmke")
    hinted = f"{warning.format('cmke')}{absent}hint: did you mean 'cmake'?\n"
    assert hinted in forge("list", cwd=root).err


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        (PLUGIN + "recipe = None\n", "cannot be loaded from 'forge_make': it has no function 'recipe'"),
        ("1 / 0\n", "cannot be loaded from 'forge_make': ZeroDivisionError: division by zero"),
        (PLUGIN + "recipe = lambda *_: {}['x']\n", "the build type 'make' failed: KeyError: 'x'\n"),
        (PLUGIN + "recipe = lambda *_: ()\n", "the build type 'make' returned tuple instead of a Recipe\n"),
        (PLUGIN + "options = lambda *_: 3\n", "the build type 'make' returned int instead of a tuple\n"),
        (
            PLUGIN + "identify = lambda _: 'x'\n",
            "the build type 'make' returned str instead of an Identity\n",
        ),
    ],
)
def test_plugin_errors_are_attributed_to_the_plugin(
    forge: Forge, greeter: Path, monkeypatch: pytest.MonkeyPatch, broken: str, message: str
) -> None:
    (greeter / "forge.toml").write_text("build-types = ['make']")
    (greeter / "src/other").mkdir()
    install(monkeypatch, greeter / "plugin", broken)
    ran = forge("build", cwd=greeter)
    assert ran.code == 2, ran.err
    assert message in ran.err
    assert "Traceback" not in ran.err


def test_packages_of_an_unknown_build_type_are_skipped(forge: Forge, tree: Tree) -> None:
    """With those that need them alone; the others are built."""
    root = tree(
        {
            "src/a/package.xml": manifest_text("a", build_type="catkin"),
            "src/b/package.xml": manifest_text("b", "<depend>a</depend>", build_type="catkin"),
            "src/c/package.xml": manifest_text("c", build_type="ament_pyton"),
        }
    )
    ran = forge("build", cwd=root)
    assert ran.code == 0
    for name, build_type in (("a", "catkin"), ("b", "catkin"), ("c", "ament_pyton")):
        assert (
            f"src/{name}/package.xml: warning: skipping '{name}': unknown build type '{build_type}'\n"
            in ran.err
        )
    assert "hint: did you mean 'ament_python'?" in ran.err
    assert "Summary: 0 packages finished" in ran.out


@pytest.mark.parametrize("options", [("--packages-select", "a"), ("--strict",), ("--packages-up-to", "b")])
def test_a_requested_package_of_an_unknown_build_type_is_an_error(
    forge: Forge, tree: Tree, options: tuple[str, ...]
) -> None:
    root = tree(
        {
            "src/a/package.xml": manifest_text("a", build_type="wierd"),
            "src/b/package.xml": manifest_text("b", "<depend>a</depend>", build_type="wierd"),
        }
    )
    ran = forge("build", *options, cwd=root)
    assert ran.code == 2
    assert "src/a/package.xml: error: unsupported build type 'wierd' of package 'a'\n" in ran.err
    assert "hint: supported build types: ament_cargo, ament_cmake, " in ran.err


def test_required_packages_of_unknown_build_types_are_errors(forge: Forge, tree: Tree) -> None:
    root = tree(
        {
            "src/a/package.xml": manifest_text("a", build_type="wierd"),
            "src/b/package.xml": manifest_text("b", "<depend>a</depend>", build_type="ament_python"),
            "src/b/setup.py": "from setuptools import setup\nsetup(name='b')",
        }
    )
    ran = forge("build", cwd=root)
    assert ran.code == 2
    assert "error: unsupported build type 'wierd' of package 'a'" in ran.err
    assert forge("build", "--dry-run", "--packages-skip", "b", cwd=root).code == 0


@pytest.mark.parametrize("words", [["build", "--dry-run"], ["list"]])
def test_unused_build_type_plugins_are_not_imported(tree: Tree, words: list[str]) -> None:
    root = tree(
        {
            "src/b/package.xml": manifest_text("b", build_type="ament_python"),
            "src/b/setup.py": "from setuptools import setup\nsetup(name='b')",
            "src/c/Makefile": "",
        }
    )
    script = (
        f"import sys\nfrom forge.cli.main import main\ncode = main({words})\n"
        "unused = {'importlib.metadata', 'forge.plugins.cargo', 'forge.plugins.pyproject'}\n"
        "print(code, sorted(unused & sys.modules.keys()))"
    )
    ran = subprocess.run(
        [sys.executable, "-c", script],
        cwd=root,
        env={"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert ran.stdout.endswith("0 []\n"), ran.stderr
