from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from forge.environment.dsv import Edit, PackageEdits, Script
from forge.environment.scripts import local_setup, package_setup, render_dsv, setup
from forge.environment.shells import SHELLS

if TYPE_CHECKING:
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


def installed(*packages: tuple[str, tuple[Edit | Script, ...]], merged: bool = False) -> list[PackageEdits]:
    """Return packages in prefixes of their own, or in one."""
    return [PackageEdits(name, "" if merged else name, edits) for name, edits in packages]


@pytest.mark.parametrize(
    ("case", "packages"),
    [
        ("empty", []),
        ("isolated", installed(("library", LIBRARY), ("programs", PROGRAMS))),
        ("merged", installed(("library", LIBRARY), ("programs", PROGRAMS), merged=True)),
        ("everything", installed(("library", LIBRARY), ("odd", EVERYTHING), ("programs", PROGRAMS))),
    ],
)
def test_local_setup_reads_as_written_by_hand(
    case: str, packages: list[PackageEdits], golden: Golden
) -> None:
    """One statement for each variable, until an operation or a script comes between."""
    texts = {f"local_setup.{shell}": local_setup(shell, ROOT, packages) for shell in SHELLS}
    golden(f"scripts/{case}", texts)


def test_setup_sources_the_chain(golden: Golden) -> None:
    """Underlays by their scripts, then this workspace."""
    foreign = Path("/opt/ros/humble/local_setup.sh")
    golden(
        "scripts/chain",
        {
            f"setup.{shell}": setup(shell, ROOT, [foreign, Path(f"/home/a b/install/local_setup.{shell}")])
            for shell in SHELLS
        },
    )


@pytest.mark.parametrize(("name", "edits"), [("library", LIBRARY), ("odd", EVERYTHING)])
def test_package_scripts(name: str, edits: tuple[Edit | Script, ...], golden: Golden) -> None:
    """A package alone, in front of everything; a hook for PowerShell is a file that nobody sources."""
    package = PackageEdits(name, "", edits)
    texts = {f"package.{shell}": package_setup(shell, ROOT / name, package) for shell in SHELLS}
    golden(f"scripts/package-{name}", texts)


def test_a_dsv_file_is_its_lines() -> None:
    """No lines, no text."""
    assert render_dsv([]) == ""
    assert render_dsv(["set;A;b", "source;c"]) == "set;A;b\nsource;c\n"


@pytest.mark.parametrize(
    ("shell", "quoted"),
    [
        ("sh", "a \\\"b\\\" \\$c \\`d\\` \\\\e 'f' !g “h”"),
        ("fish", "a \\\"b\\\" \\$c `d` \\\\e 'f' !g “h”"),
    ],
)
def test_quoting_keeps_what_double_quotes_would_change(shell: str, quoted: str) -> None:
    """What means something between double quotes differs: fish takes a backquote as it is."""
    assert SHELLS[shell].quoted("a \"b\" $c `d` \\e 'f' !g “h”") == quoted
