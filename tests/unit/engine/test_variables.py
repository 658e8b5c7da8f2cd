"""The variables that texts and interpreters name, without a request that could be observed."""

import pytest

from forge.engine.variables import is_tracked, mentioned, of_interpreter

NAMING = (
    ("/usr/bin/perl", "print $ENV{MODE}, $ENV{'OTHER'}"),
    ("/usr/bin/tclsh", "puts $env(MODE)$env(OTHER)"),
    ("/bin/sh", '[ "${#MODE}" = 1 ] && echo "${!OTHER}"'),
    ("/usr/bin/python3", '<arg default="$(optenv MODE 1)"/><arg default="$(env OTHER)"/>'),
    ("/usr/bin/python3", "[a]\nx = %(MODE)s %(OTHER)s\n"),
    ("/usr/bin/awk", 'BEGIN { print ENVIRON["MODE"] ENVIRON["OTHER"] }'),
    ("/usr/bin/cmake", "set(x $ENV{MODE} $ENV{OTHER})"),
)


@pytest.mark.parametrize(("program", "text"), NAMING)
def test_variables_named_in_scripts_are_found(program: str, text: str) -> None:
    assert {"MODE", "OTHER"} <= mentioned(text, program)


def test_variables_that_shells_read_implicitly_are_inputs() -> None:
    assert "BASH_ENV" in of_interpreter("/bin/bash")
    assert not of_interpreter("/usr/bin/python3")


def test_variables_of_python_that_change_results_are_inputs() -> None:
    assert all(map(is_tracked, ("PYTHONHASHSEED", "PYTHONOPTIMIZE", "PYTHONUTF8", "PYTHONIOENCODING")))
    assert not any(map(is_tracked, ("PYTHONUNBUFFERED", "PYTHONDONTWRITEBYTECODE", "PYTHONWARNINGS")))
