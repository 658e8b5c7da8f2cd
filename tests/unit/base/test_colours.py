"""Which streams are coloured."""

import io

import pytest

from forge.base.colours import Palette, palette_of
from forge.base.errors import Location, Problem


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("variables", "on_terminal", "in_pipe"),
    [
        ({"TERM": "xterm"}, True, False),
        ({"TERM": "dumb"}, False, False),
        ({}, False, False),
        ({"TERM": "xterm", "NO_COLOR": "1"}, False, False),
        ({"TERM": "xterm", "NO_COLOR": ""}, True, False),
        ({"TERM": "xterm", "CLICOLOR": "0"}, False, False),
        ({"CLICOLOR_FORCE": "1"}, True, True),
        ({"FORCE_COLOR": "1"}, True, True),
        ({"TERM": "xterm", "FORCE_COLOR": "0"}, True, False),
        ({"FORCE_COLOR": "1", "NO_COLOR": "1"}, False, False),
    ],
)
def test_colours_follow_the_environment_variables(
    variables: dict[str, str], *, on_terminal: bool, in_pipe: bool
) -> None:
    assert palette_of(Terminal(), variables).enabled is on_terminal
    assert palette_of(io.StringIO(), variables).enabled is in_pipe


def test_colours_do_not_change_the_text_of_a_problem() -> None:
    problem = Problem("no \x1b[2Jsuch type", Location("A.msg", 1, 3, "a b"), hint="did you mean 'c'?")
    assert problem.render("warning", Palette(enabled=True)) == (
        "A.msg:1:3: \x1b[1;33mwarning:\x1b[0m no \N{REPLACEMENT CHARACTER}[2Jsuch type\n"
        "    a b\n      \x1b[1;33m^\x1b[0m\n\x1b[1;36mhint:\x1b[0m did you mean 'c'?"
    )
    assert problem.render().splitlines()[-2:] == ["      ^", "hint: did you mean 'c'?"]
