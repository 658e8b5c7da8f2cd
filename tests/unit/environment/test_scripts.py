from pathlib import Path

from forge.environment.dsv import Edit, PackageEdits, Script
from forge.environment.scripts import local_setup, package_setup, setup
from tests.conftest import Golden

ROOT = Path("/ws/install")

LIBRARY = (
    Edit("prepend", "CMAKE_PREFIX_PATH", "", below=True),
    Edit("prepend", "LD_LIBRARY_PATH", "lib", below=True),
    Edit("prepend", "AMENT_PREFIX_PATH", "", below=True),
)
PROGRAMS = (
    Edit("prepend", "PATH", "bin", below=True),
    Edit("prepend", "PYTHONPATH", "lib/python3.11/site-packages", below=True),
    Edit("prepend", "AMENT_PREFIX_PATH", "", below=True),
)
EVERYTHING = (
    Edit("prepend", "PATH", "/opt/odd $HOME", below=False),
    Edit("append", "PATH", "last", below=True),
    Edit("set", "ODD_MODEL", 'the "great" one', below=False),
    Edit("default", "ODD_HOME", "share/odd", below=True),
    Script(("share/odd/hook.sh", "share/odd/hook.zsh")),
    Script(("share/odd/only.bash", "share/odd/only.ps1")),
    Edit("prepend", "AMENT_PREFIX_PATH", "", below=True),
)


def test_local_setup_matches_the_expected_script(golden: Golden) -> None:
    """One statement for each variable, until an operation or a script comes between.

    tests/e2e/test_shells.py runs the scripts of all shells and layouts.
    """
    edits = {"library": LIBRARY, "odd": EVERYTHING, "programs": PROGRAMS}
    packages = [PackageEdits(name, name, each) for name, each in edits.items()]
    golden("scripts/everything", {"local_setup.sh": local_setup("sh", ROOT, packages)})


def test_setup_sources_all_underlays(golden: Golden) -> None:
    chain = [Path("/opt/ros/humble/local_setup.sh"), Path("/home/a b/install/local_setup.sh")]
    golden("scripts/chain", {"setup.sh": setup("sh", ROOT, chain)})


def test_package_setup_prepends_its_entries(golden: Golden) -> None:
    package = PackageEdits("odd", "", EVERYTHING)
    golden("scripts/package-odd", {"package.sh": package_setup("sh", ROOT / "odd", package)})
