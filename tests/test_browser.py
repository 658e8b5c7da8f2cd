"""The browser that tests of pages drive sees what a user would see, and hears what goes wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.browser import Keys

if TYPE_CHECKING:
    from tests.browser import Browser
    from tests.conftest import Tree

pytestmark = pytest.mark.needs("chromium", "chromedriver")

PAGE = """<!doctype html><meta charset="utf-8"><title>A page</title>
<style>
  .dark {{ display: none }}
  @media (prefers-color-scheme: dark) {{ .dark {{ display: block }} .light {{ display: none }} }}
</style>
<p class="light">light</p><p class="dark">dark</p>
<input><output></output>
<script>
  document.querySelector("input").addEventListener("input", (event) => {{
    document.querySelector("output").textContent = event.target.value + location.hash;
  }});
  {more}
</script>
"""


def test_a_page_is_seen_as_the_user_has_set_it(browser: Browser, tree: Tree) -> None:
    path = tree({"a page.html": PAGE.format(more="")}) / "a page.html"
    for dark in (False, True):
        browser.open(path, dark=dark, size=(640, 480))
        assert browser.texts("p") == ["dark" if dark else "light"]
        assert browser.run("return [innerWidth, innerHeight]") == [640, 480]


def test_keys_reach_the_page(browser: Browser, tree: Tree) -> None:
    browser.open(tree({"page.html": PAGE.format(more="")}) / "page.html", anchor="there")
    browser.write("input", "abc")
    assert browser.focus.tag_name == "input"
    browser.press(Keys.BACKSPACE, "d")
    assert browser.texts("output") == ["abd#there"]


@pytest.mark.parametrize(
    ("script", "complaint"),
    [
        ("nobody.knows;", "nobody is not defined"),
        ("console.error('alas');", "alas"),
        ("new Image().src = 'http://example.com/a.png';", "example.com"),
        ("document.write('<script src=missing.js></' + 'script>');", "missing.js"),
    ],
)
def test_what_a_page_complains_of_is_told(browser: Browser, tree: Tree, script: str, complaint: str) -> None:
    browser.open(tree({"page.html": PAGE.format(more=script)}) / "page.html")
    browser.run("return new Promise(done => setTimeout(done, 100))")
    assert complaint in "".join(browser.complaints())
