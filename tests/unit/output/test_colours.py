"""The colours of pages meet the contrast requirements of WCAG, in light and dark mode."""

import re
from itertools import product

import pytest

from tests.snippets import ROOT

DAY, NIGHT = (
    dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6});", theme))
    for theme in (ROOT / "templates/html/colours.css").read_text(encoding="utf-8").split("@media")
)
_TEXTS = ("ink", "soft", "accent", "warm", "bad")
_TINTS = ("cmake-tint", "python-tint", "interfaces-tint", "other-tint")
_PAIRS = [*product(_TEXTS, ("page", "card")), *product(("ink", "soft"), _TINTS)]


@pytest.mark.parametrize("theme", [DAY, NIGHT], ids=["day", "night"])
@pytest.mark.parametrize(("text", "ground"), _PAIRS)
def test_text_has_sufficient_contrast(theme: dict[str, str], text: str, ground: str) -> None:
    light, dark = sorted((luminance(theme[text]), luminance(theme[ground])), reverse=True)
    assert (light + 0.05) / (dark + 0.05) >= 4.5


def luminance(colour: str) -> float:
    channels = (int(colour[start : start + 2], 16) / 255 for start in (1, 3, 5))
    linear = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels)
    return sum(weight * channel for weight, channel in zip((0.2126, 0.7152, 0.0722), linear, strict=True))
