"""The picture of the terminal shows what a program printed on one."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING

import pytest

from tests.screenshot import PICTURE, Run, picture, screen

if TYPE_CHECKING:
    from pathlib import Path

_TEXT = "{http://www.w3.org/2000/svg}text"


@pytest.mark.needs("bash")
def test_a_picture_has_what_was_printed_and_how(tmp_path: Path) -> None:
    """What a later line replaced is gone, colours stay, and the path of the folder is another."""
    red = r"\033[31merror:\033[0m"
    lines = list(screen((f"printf 'working\\r{red} %s\\n' \"$PWD\"",), tmp_path))
    assert lines[1][0] == Run(0, 48, "error:", "red")
    assert [run.text for run in lines[1]] == ["error:", "/home/me/ws"]
    drawn = ET.fromstring(picture(lines[1:]))  # noqa: S314  (made a moment ago)
    assert [(text.get("class"), text.text) for text in drawn.iter(_TEXT)] == [
        ("red", "error:"),
        (None, "/home/me/ws"),
    ]


def test_the_picture_in_the_readme_was_made_this_way() -> None:
    text = PICTURE.read_text(encoding="utf-8")
    assert "$ forge build" in text
    assert "/home/me/ws" in text
    assert "tmp" not in text
