"""Typing errors on the command line get suggestions."""

from __future__ import annotations

from pathlib import Path

import pytest

from forge.output.handlers import HANDLERS
from tests.conftest import Forge

TOPIC = (
    "error: unknown command 'topic'\nhint: 'ros2' has it: forge shell -- ros2 topic; "
    "it is part of a ROS installation, and of the packages that 'forge fetch ros2topic' fetches\n"
)
CD = (
    "error: unknown command 'cd'\nhint: a program cannot change the folder of its shell; "
    "'forge completion' defines 'forge_cd'\n"
)

BUILD_TYPES = "'cmake', 'ament_cmake', 'ament_python')\n"
AMENT = "did you mean 'ament_cmake'?"
ALL = "'forge clean --help' lists all options"


@pytest.mark.parametrize(
    ("argv", "told"),
    [
        (("biuld",), "error: unknown command 'biuld'\nhint: did you mean 'build'?\n"),
        (("xyz",), "error: unknown command 'xyz'\nhint: 'forge --help' lists all commands\n"),
        (
            ("pkg",),
            ("error: the following arguments are required: VERB\nhint: 'forge pkg --help' lists all verbs\n"),
        ),
        (
            ("topic", "list"),
            TOPIC,
        ),
        (
            ("cd", "talk"),
            CD,
        ),
        (
            ("build", "--package-select", "talk"),
            "error: unrecognized arguments: --package-select talk\nhint: did you mean '--packages-select'?\n",
        ),
        (
            ("build", "--release"),
            (
                "error: unrecognized arguments: --release\n"
                "hint: to set the build type: '--cmake-args -DCMAKE_BUILD_TYPE=Release'\n"
            ),
        ),
        (
            ("build", "-DA:STRING=1"),
            (
                "error: unrecognized arguments: -DA:STRING=1\n"
                "hint: to define a variable of CMake: '--cmake-args -DA:STRING=1'\n"
            ),
        ),
        (
            ("test", "--release"),
            "error: unrecognized arguments: --release\nhint: 'forge test --help' lists all options\n",
        ),
        (
            ("build", "--frobnicate"),
            "error: unrecognized arguments: --frobnicate\nhint: 'forge build --help' lists all options\n",
        ),
        (
            ("build", "--jobs", "many"),
            (
                "error: argument -j/--jobs: 'many' is not a positive number of jobs\n"
                "hint: 'forge build --help' lists all options\n"
            ),
        ),
        *(
            (argv, f"error: argument {at}: invalid choice: '{argv[-1]}' (choose from {among}hint: {hint}\n")
            for argv, at, among, hint in (
                (("pkg", "create", "a", "--build-type", "ament_cmak"), "--build-type", BUILD_TYPES, AMENT),
                (("env", "--format", "jsn"), "--format", "'sh', 'json', 'dotenv')\n", "did you mean 'json'?"),
                (("clean", "all"), "what", "'workspace', 'packages', 'stale')\n", ALL),
            )
        ),
        (
            ("pkg", "create", "talk", "--license-typ", "x"),
            "error: unrecognized arguments: --license-typ x\nhint: did you mean '--license'?\n",
        ),
        (
            ("build", "--event-handlers", "console_cohesion"),
            (
                "error: --event-handlers expects names followed by '+' or '-', not 'console_cohesion'\n"
                "hint: 'console_cohesion+' enables it, 'console_cohesion-' disables it\n"
            ),
        ),
        (
            ("build", "--event-handlers", "console_choesion-"),
            (
                "error: --event-handlers: unknown event handler 'console_choesion'\n"
                f"hint: did you mean 'console_cohesion-'? event handlers: {', '.join(HANDLERS)}\n"
            ),
        ),
        (
            ("build", "--event-handlers", "nosuch+"),
            (
                "error: --event-handlers: unknown event handler 'nosuch'\n"
                f"hint: event handlers: {', '.join(HANDLERS)}\n"
            ),
        ),
        (
            ("build", "\u2014-symlink-install"),
            (
                "error: unrecognized arguments: \u2014-symlink-install\n"
                "hint: '\u2014' is not '-': write '--symlink-install'\n"
            ),
        ),
        (
            ("build", "\u2013symlink-instal"),
            (
                "error: unrecognized arguments: \u2013symlink-instal\n"
                "hint: '\u2013' is not '-': write '--symlink-install'\n"
            ),
        ),
        (
            ("build", "\u2212j"),
            "error: unrecognized arguments: \u2212j\nhint: '\u2212' is not '-': write '-j'\n",
        ),
        (("watch",), "error: unknown command 'watch'\nhint: did you mean 'forge build --watch'?\n"),
        (
            ("build", "talk"),
            "error: unrecognized arguments: talk\nhint: to select packages: '--packages-select talk'\n",
        ),
        (
            ("env", "--formt", "sh"),
            "error: unrecognized arguments: --formt\nhint: did you mean '--format'?\n",
        ),
    ],
)
def test_misspelled_words_get_a_suggestion(
    argv: tuple[str, ...], told: str, forge: Forge, tmp_path: Path
) -> None:
    ran = forge(*argv, cwd=tmp_path)
    assert (ran.code, ran.err) == (2, told)
