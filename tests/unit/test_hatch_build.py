"""The README on a package index has no link that leads nowhere."""

import re

import pytest

from hatch_build import absolute
from tests.snippets import ROOT

SITE = "https://example.org/forge/"


@pytest.mark.parametrize(
    ("text", "with_site", "without"),
    [
        ("see [a page](docs/a.md#b).", "see [a page](https://example.org/forge/docs/a.md#b).", "see a page."),
        ("![a chart](docs/a.svg)\n", "![a chart](https://example.org/forge/docs/a.svg)\n", "\n"),
        ("[ROS](https://docs.ros.org), [below](#x)",) * 3,
    ],
)
def test_links_to_files_become_absolute_or_plain_text(text: str, with_site: str, without: str) -> None:
    assert absolute(text, SITE) == with_site
    assert absolute(text, "") == without


@pytest.mark.parametrize("site", [SITE, ""])
def test_the_published_readme_has_only_absolute_links(site: str) -> None:
    text = absolute((ROOT / "README.md").read_text(encoding="utf-8"), site)
    targets = re.findall(r"\]\(([^)]+)\)", text)
    assert targets
    assert [target for target in targets if not target.startswith(("https://", "#"))] == []
