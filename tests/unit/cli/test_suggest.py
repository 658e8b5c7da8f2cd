"""Typing errors on the command line get suggestions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Forge

TOPIC = (
    "error: unknown command 'topic'\nhint: 'ros2 topic' is part of a ROS installation: source that first\n"
)


@pytest.mark.parametrize(
    ("argv", "told"),
    [
        (("biuld",), "error: unknown command 'biuld'\nhint: did you mean 'build'?\n"),
        (("xyz",), "error: unknown command 'xyz'\nhint: 'forge --help' lists all options\n"),
        (
            ("topic", "list"),
            TOPIC,
        ),
        (
            ("build", "--package-select", "talk"),
            "error: unrecognized arguments: --package-select talk\nhint: did you mean '--packages-select'?\n",
        ),
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
def test_what_was_meant(argv: tuple[str, ...], told: str, forge: Forge, tmp_path: Path) -> None:
    ran = forge(*argv, cwd=tmp_path)
    assert (ran.code, ran.err) == (2, told)
