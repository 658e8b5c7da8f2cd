"""The picture of a terminal in the README is up to date."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from tests.screenshot import PICTURE, picture, session

_TEXT = "{http://www.w3.org/2000/svg}text"


@pytest.mark.needs("bash", "cmake", "ninja", "c++")
def test_the_readme_picture_is_current(tmp_path: Path) -> None:
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
