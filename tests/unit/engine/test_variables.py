"""The variables that texts and interpreters name, without a request that could be observed."""

import pytest

from forge.engine.variables import is_tracked, mentioned, of_interpreter

NAMING = (
    ("/usr/bin/perl", "print $ENV{MODE}, $ENV{'OTHER'}"),
    ("/usr/bin/tclsh", "puts $env(MODE)$env(OTHER)"),
    ("/bin/sh", '[ "${#MODE}" = 1 ] && echo "${!OTHER}"'),
    ("/usr/bin/python3", '<arg default="$(optenv MODE 1)"/><arg default="$(env OTHER)"/>'),
    ("/usr/bin/python3", "[a]\nx = %(MODE)s %(OTHER)s\n"),
    ("/bin/bash", "[[ -v MODE ]] && declare -p OTHER"),
    ("/usr/bin/make", "ifdef MODE\nx := $(origin OTHER)\nendif"),
    ("/usr/bin/awk", 'BEGIN { print ENVIRON["MODE"] ENVIRON["OTHER"] }'),
    ("/usr/bin/cmake", "set(x $ENV{MODE} $ENV{OTHER})"),
)


@pytest.mark.parametrize(("program", "text"), NAMING)
def test_variables_named_in_scripts_are_found(program: str, text: str) -> None:
    assert {"MODE", "OTHER"} <= mentioned(text, program)


@pytest.mark.parametrize("text", ["cat ~/x", "~/bin/x", "X=~", "for x in ~; do :; done", "ls ~"])
def test_shells_expand_the_home_folder(text: str) -> None:
    assert "HOME" in mentioned(text, "/bin/sh")


@pytest.mark.parametrize("text", ["# see ~/x", "cp x y~", "x=a~/b", "git log HEAD~ | head -n 1"])
def test_other_tildes_are_not_the_home_folder(text: str) -> None:
    assert "HOME" not in mentioned(text, "/bin/sh")


def test_functions_of_python_read_the_home_folder() -> None:
    assert "HOME" in mentioned("x = os.path.expanduser(y)", "/usr/bin/python3")
    assert "HOME" in mentioned("x = Path.home() / y", "/usr/bin/python3")
    assert "HOME" not in mentioned("# ~/.config", "/usr/bin/python3")


def test_variables_that_shells_read_implicitly_are_inputs() -> None:
    assert "BASH_ENV" in of_interpreter("/bin/bash")
    assert not of_interpreter("/usr/bin/python3")


def test_variables_of_python_that_change_results_are_inputs() -> None:
    assert all(map(is_tracked, ("PYTHONHASHSEED", "PYTHONOPTIMIZE", "PYTHONUTF8", "PYTHONIOENCODING")))
    assert not any(map(is_tracked, ("PYTHONUNBUFFERED", "PYTHONDONTWRITEBYTECODE", "PYTHONWARNINGS")))
