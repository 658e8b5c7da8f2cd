"""Typing errors on the command line get suggestions."""

from pathlib import Path

import pytest

from forge.output.handlers import HANDLERS
from tests.conftest import Forge

TOPIC = (
    "'ros2' has it: forge shell -- ros2 topic; it is part of a ROS installation, "
    "and of the packages that 'forge fetch ros2topic' fetches"
)
CD = "a program cannot change the folder of its shell; 'forge completion' defines 'forge_cd'"
SELECT = "did you mean '--packages-select'?"
ALL_OF_BUILD = "'forge build --help' lists all options"
CONSOLE = "--event-handlers expects names followed by '+' or '-', not 'console_cohesion'"
LINK = "'{}' is not '-': write '--symlink-install'"


@pytest.mark.parametrize(
    ("line", "error", "hint"),
    [
        ("biuld", "unknown command 'biuld'", "did you mean 'build'?"),
        ("xyz", "unknown command 'xyz'", "'forge --help' lists all commands"),
        ("pkg", "the following arguments are required: VERB", "'forge pkg --help' lists all verbs"),
        ("topic list", "unknown command 'topic'", TOPIC),
        ("cd talk", "unknown command 'cd'", CD),
        ("watch", "unknown command 'watch'", "did you mean 'forge build --watch'?"),
        ("build --package-select talk", "unrecognized arguments: --package-select talk", SELECT),
        ("build talk", "unrecognized arguments: talk", "to select packages: '--packages-select talk'"),
        (
            "build --release",
            "unrecognized arguments: --release",
            "to set the build type: '--cmake-args -DCMAKE_BUILD_TYPE=Release'",
        ),
        (
            "build -DA:STRING=1",
            "unrecognized arguments: -DA:STRING=1",
            "to define a variable of CMake: '--cmake-args -DA:STRING=1'",
        ),
        ("test --release", "unrecognized arguments: --release", "'forge test --help' lists all options"),
        ("build =x", "unrecognized arguments: =x", ALL_OF_BUILD),
        ("build --frobnicate", "unrecognized arguments: --frobnicate", ALL_OF_BUILD),
        ("build --jobs many", "argument -j/--jobs: 'many' is not a positive number of jobs", ALL_OF_BUILD),
        (
            "build --event-handlers console_cohesion",
            CONSOLE,
            "'console_cohesion+' enables it, 'console_cohesion-' disables it",
        ),
        (
            "build --event-handlers console_choesion-",
            "--event-handlers: unknown event handler 'console_choesion'",
            f"did you mean 'console_cohesion-'? event handlers: {', '.join(HANDLERS)}",
        ),
        (
            "build --event-handlers nosuch+",
            "--event-handlers: unknown event handler 'nosuch'",
            f"event handlers: {', '.join(HANDLERS)}",
        ),
        (
            "build \u2014-symlink-install",
            "unrecognized arguments: \u2014-symlink-install",
            LINK.format("\u2014"),
        ),
        ("build \u2013j", "unrecognized arguments: \u2013j", "'\u2013' is not '-': write '-j'"),
    ],
)
def test_misspelled_words_get_a_suggestion(
    line: str, error: str, hint: str, forge: Forge, tmp_path: Path
) -> None:
    ran = forge(*line.split(), cwd=tmp_path)
    assert (ran.code, ran.err) == (2, f"error: {error}\nhint: {hint}\n")
