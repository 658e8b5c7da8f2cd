"""The command line: greedy options, exit codes, errors."""

import errno
import subprocess
import sys
from pathlib import Path

import pytest

from forge.base.errors import ForgeError, Location, Problem, raise_if_any, share_hints
from forge.cli import commands, main
from forge.cli.options import NoOptions
from tests.conftest import Forge


def test_consecutive_problems_share_one_hint() -> None:
    source = [Problem("a", hint="x"), Problem("b", hint="x"), Problem("c"), Problem("d", hint="x")]
    assert [problem.hint for problem in share_hints(source)] == [None, "x", None, "x"]
    assert share_hints([]) == []


def test_help_names_every_command(forge: Forge) -> None:
    ran = forge("--help")
    assert ran.code == 0
    assert all(word in ran.out for word in main.COMMANDS)


@pytest.mark.parametrize(
    ("argv", "jobs", "arguments"),
    [
        (["-j", "4"], 4, []),
        (["-j4", "--jobs", "3"], 3, []),
        (["--cmake-args", "-DX=1", "-j", "4"], None, ["-DX=1", "-j", "4"]),
        (["-j4", "--cmake-args", "-DX=1"], 4, ["-DX=1"]),
        (["--jobs", "2", "--ctest-args", "-R", "x", "-j", "4", "-V"], 2, ["-R", "x", "-j", "4", "-V"]),
        (["--ctest-args", "-j4", "--jobs", "2"], None, ["-j4", "--jobs", "2"]),
    ],
)
def test_jobs_has_the_usual_short_option(argv: list[str], jobs: int | None, arguments: list[str]) -> None:
    verb = "test" if "--ctest-args" in argv else "build"
    options = main.parser_of([verb]).parse_args([verb, *argv])
    assert options.jobs == jobs
    given = options.ctest_args if verb == "test" else options.cmake_args
    assert [argument.lstrip() for argument in given] == arguments


def test_all_spellings_of_help_work(forge: Forge) -> None:
    """Without words, forge prints its own help, as cargo does."""
    whole = forge("--help")
    assert whole.code == 0
    assert forge() == forge("help") == forge("-C", "/") == whole
    assert forge("help", "build") == forge("build", "--help")
    assert forge("help", "pkg", "create") == forge("pkg", "create", "--help")
    ran = forge("help", "biuld")
    assert (ran.code, ran.err) == (2, "error: unknown command 'biuld'\nhint: did you mean 'build'?\n")


class Failing:
    """A command that ends in a given way."""

    Options = NoOptions

    def __init__(self, error: BaseException) -> None:
        """Remember how."""
        self.error = error

    def run(self, _options: object) -> int:
        """Raise."""
        raise self.error


@pytest.mark.parametrize(
    ("error", "code", "text"),
    [
        (
            ForgeError(Problem("one"), Problem("two", hint="do it")),
            2,
            "error: one\nerror: two\nhint: do it\n",
        ),
        (KeyboardInterrupt(), 130, ""),
        (ValueError("surprise"), 70, "this is a bug in forge"),
        (OSError(errno.EINVAL, "surprise"), 70, "this is a bug in forge"),
        (
            PermissionError(13, "Permission denied", "/x"),
            2,
            "error: cannot read or write '/x': permission denied\nh",
        ),
        (OSError(errno.ENOSPC, "No space"), 2, "error: cannot write to the standard output: no space\n"),
    ],
)
def test_exit_codes_are_as_documented(
    forge: Forge, monkeypatch: pytest.MonkeyPatch, error: BaseException, code: int, text: str
) -> None:
    monkeypatch.setitem(sys.modules, "forge.cli.commands.list", Failing(error))
    monkeypatch.setattr(commands, "list", Failing(error), raising=False)
    ran = forge("list")
    assert ran.code == code
    assert text in ran.err


@pytest.mark.parametrize(
    ("command", "usage"),
    [
        (("build",), "usage: forge build [OPTION ...]\n"),
        (("info",), "usage: forge info [OPTION ...] [PKG ...]\n"),
        (
            ("interface", "generate"),
            "usage: forge interface generate [OPTION ...] --output DIR [SOURCE_DIR]\n",
        ),
        (("pkg", "prefix"), "usage: forge pkg prefix [-h] [--share] [--profile NAME] PACKAGE\n"),
    ],
)
def test_usage_is_one_line(forge: Forge, command: tuple[str, ...], usage: str) -> None:
    """What must be given is in it; the options that may be are listed below."""
    assert forge(*command, "--help").out.startswith(usage)


def test_a_closed_pipe_is_not_an_error() -> None:
    command = f"'{sys.executable}' -m forge list --base-paths forge/embedded | true; exit ${{PIPESTATUS[0]}}"
    home = Path(main.__file__).parents[2]
    ran = subprocess.run(["bash", "-c", command], cwd=home, capture_output=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, b"")


def test_a_problem_renders_place_source_caret_and_hint() -> None:
    problem = Problem("what", Location("a.msg", 3, 3, "\tx y"), "do this")
    assert problem.render("warning") == "a.msg:3:3: warning: what\n    \tx y\n    \t ^\nhint: do this"
    assert str(Location("a")) == "a"
    assert str(Location("a", 1)) == "a:1"
    raise_if_any(())
