"""Interface pages in a real browser: search, links, and no errors."""

import time
from pathlib import Path

import pytest

from forge.base.distributions import EMBEDDED
from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library, read_folder
from forge.interfaces.resolve.resolution import dependency_catalogs, resolve
from forge.plugins.interface_pages.command import write_site
from forge.plugins.interface_pages.site import site
from tests.browser import Browser, Keys

pytestmark = pytest.mark.needs("chromium", "chromedriver")


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a site about one package and what it refers to."""
    library = Library()
    catalog = resolve("nav_msgs", parse_all(read_folder("nav_msgs", EMBEDDED / "nav_msgs")), library)
    out = tmp_path_factory.mktemp("site")
    write_site(site([catalog, *dependency_catalogs(catalog, library)], {}, "Interfaces"), out)
    return out


def arrive(browser: Browser, page: str) -> None:
    """Wait until a key or a click has led to a page."""
    end = time.monotonic() + 20
    while not browser.address.partition("?")[0].endswith(page):
        assert time.monotonic() < end, browser.address
        time.sleep(0.02)


def found(browser: Browser) -> list[str]:
    return browser.texts("#found dt")


def test_the_search_ranks_the_best_match_first(browser: Browser, pages: Path) -> None:
    browser.open(pages / "index.html")
    assert "nav_msgs" in browser.texts("#all h2 a")
    browser.write("input", "pose")
    assert found(browser)[0] == "geometry_msgs/msg/Pose"
    assert "nav_msgs/msg/Path" in found(browser)
    assert browser.all("#all") == []
    browser.write("input", "stamped pose")
    assert found(browser)[0] == "geometry_msgs/msg/PoseStamped"
    browser.write("input", "frame_id")
    assert found(browser)[0] == "std_msgs/msg/Header"
    browser.write("input", "no such thing")
    assert found(browser) == []
    assert browser.texts("#found p") == ["0 interfaces"]
    browser.write("input", " ")
    assert browser.all("#all") != []


def test_a_key_focuses_the_search_and_enter_opens_the_best_match(browser: Browser, pages: Path) -> None:
    browser.open(pages / "nav_msgs/msg/Path.html")
    browser.press("/")
    browser.press(*"occupancy", Keys.ENTER)
    arrive(browser, "/index.html")
    assert found(browser)[0] == "nav_msgs/msg/OccupancyGrid"
    browser.click("input")
    browser.press(Keys.ENTER)
    arrive(browser, "/nav_msgs/msg/OccupancyGrid.html")


def test_type_links_open_their_pages(browser: Browser, pages: Path) -> None:
    browser.open(pages / "nav_msgs/msg/Path.html")
    browser.click("[id='.poses'] a")
    arrive(browser, "/geometry_msgs/msg/PoseStamped.html")
    assert browser.texts("h1") == ["PoseStamped message"]
    browser.click("main nav a")
    arrive(browser, "/geometry_msgs/index.html")
    assert browser.texts("h1") == ["geometry_msgs"]
    browser.click("header a")
    arrive(browser, f"{pages.name}/index.html")
    assert browser.texts("h1") == ["Interfaces"]


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [360, 1280])
def test_pages_fit_their_window(browser: Browser, pages: Path, width: int, *, dark: bool) -> None:
    for page in (
        "index.html",
        "nav_msgs/index.html",
        "nav_msgs/msg/Odometry.html",
        "nav_msgs/srv/GetPlan.html",
    ):
        browser.open(pages / page, dark=dark, size=(width, 800))
        assert browser.run("return document.documentElement.scrollWidth") == width
