"""The picture of the terminal shows what a program printed on one."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING

import pytest

from tests.screenshot import PICTURE, Run, picture, screen, session

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
    drawn = ET.fromstring(picture(lines[1:]))
    assert [(text.get("class"), text.text) for text in drawn.iter(_TEXT)] == [
        ("red", "error:"),
        (None, "/home/me/ws"),
    ]


@pytest.mark.needs("bash", "cmake", "ninja", "c++")
def test_the_picture_in_the_readme_shows_what_forge_prints_now(tmp_path: Path) -> None:
    """But for times and dates, and for the order in which packages finish."""
    now = picture(session(tmp_path / "robot_ws"))
    assert shown(now) == shown(PICTURE.read_text(encoding="utf-8")), "make it: python -m tests.screenshot"


def shown(svg: str) -> list[str]:
    """Return the sorted lines of a picture without times and dates."""
    rows: dict[str, list[str]] = {}
    for text in ET.fromstring(svg).iter(_TEXT):
        rows.setdefault(text.get("y", ""), []).append(text.text or "")
    return sorted(
        re.sub(r"\d+(?:\.\d+)?s\b|[\d-]{10}_[\d-]{8}", "TIME", " ".join(row)) for row in rows.values()
    )
