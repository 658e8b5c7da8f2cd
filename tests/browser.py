"""A real browser for tests of pages: Debian's chromium without a window, one for the whole test session.

    @pytest.mark.needs("chromium", "chromedriver")
    def test_a_search_finds_it(browser: Browser, tmp_path: Path) -> None:
        browser.open(tmp_path / "page.html")
        browser.write("#search", "nav")
        assert browser.texts("li") == ["nav_msgs"]

It has no network but this machine. After each test the fixture asserts that no page complained: no error or
warning in the console, nothing loaded but files, or from this machine.
"""

import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from selenium.webdriver import Chrome, ChromeOptions, ChromeService
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.ui import WebDriverWait

__all__ = ["Browser", "Keys", "started"]

_SWITCHES = (
    "--headless=new",
    "--no-sandbox",  # whose namespaces containers do not grant, and these pages are ours
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--disable-component-update",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
    "--no-first-run",
    "--force-color-profile=srgb",
    "--hide-scrollbars",
    "--lang=en",
)
_FOREIGN = """
const loaded = performance.getEntriesByType("resource").map((entry) => entry.name);
performance.clearResourceTimings();
return loaded.filter((name) => !/^(file|data|blob|http:[/]{2}127[.]0[.]0[.]1):/.test(name));
"""
"""What was loaded from elsewhere since the last time."""


class Browser:
    """A page at a time. Places on it are CSS selectors; all waiting is for the page's own scripts."""

    def __init__(self, driver: Chrome) -> None:
        """Drive a browser that runs."""
        self._driver = driver
        self._complaints: list[str] = []

    def open(
        self, path: Path | str, *, anchor: str = "", dark: bool = False, size: tuple[int, int] = (1280, 900)
    ) -> None:
        """Load a file, or an address of a test's server, anew, as a user with these settings sees it."""
        self._gather()
        width, height = size
        screen = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self._driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self._driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
        # Else a page that differs by its anchor alone would not be loaded again.
        self._driver.get("about:blank")
        address = path if isinstance(path, str) else path.resolve().as_uri()
        self._driver.get(address + (f"#{anchor}" if anchor else ""))
        # On a busy machine, the driver may take the blank page for the loaded one.
        self.wait(lambda: self.run("return document.readyState") == "complete")

    def find(self, place: str) -> WebElement:
        """Return the first element; raises selenium's NoSuchElementException when there is none."""
        return self._driver.find_element(By.CSS_SELECTOR, place)

    def all(self, place: str) -> list[WebElement]:
        """Return the elements that can be seen, in the order of the page."""
        return [found for found in self._driver.find_elements(By.CSS_SELECTOR, place) if found.is_displayed()]

    def texts(self, place: str) -> list[str]:
        """Return what the elements that can be seen say."""
        return [found.text for found in self.all(place)]

    def click(self, place: str) -> None:
        """Click with the mouse, where the element must be seen and nothing be in front of it."""
        self.find(place).click()

    def hover(self, place: str) -> None:
        """Move the mouse there."""
        ActionChains(self._driver).move_to_element(self.find(place)).perform()

    def drag(self, place: str, x: int, y: int) -> None:
        """Press the mouse on an element's middle, move it so many pixels, and let it go."""
        ActionChains(self._driver).click_and_hold(self.find(place)).move_by_offset(x, y).release().perform()

    def write(self, place: str, text: str) -> None:
        """Put a text in a field in place of the one that is there, key by key."""
        field = self.find(place)
        field.clear()
        field.send_keys(text)

    def press(self, *keys: str) -> None:
        """Press keys one after the other, wherever the focus is; `Keys` has those without a letter."""
        ActionChains(self._driver).send_keys(*keys).perform()

    def wait(self, condition: Callable[[], bool]) -> None:
        """Wait until the page shows what a server has told it; raises selenium's TimeoutException."""
        WebDriverWait(self._driver, 20, 0.05).until(lambda _: condition())

    @property
    def focus(self) -> WebElement:
        """The element that the next key goes to."""
        return self._driver.switch_to.active_element

    @property
    def address(self) -> str:
        """Where the page is, its anchor included."""
        return self._driver.current_url

    def run(self, script: str, *arguments: object) -> object:
        """Run JavaScript, in which `arguments` has the arguments, and return what it returns."""
        result: object = self._driver.execute_script(script, *arguments)
        return result

    def picture(self, path: Path) -> None:
        """Write what is seen as a PNG."""
        path.write_bytes(self._driver.get_screenshot_as_png())

    def complaints(self) -> list[str]:
        """Return what the pages complained of since the last time that somebody asked."""
        self._gather()
        found, self._complaints = self._complaints, []
        return found

    def _gather(self) -> None:
        log: list[dict[str, object]] = self._driver.get_log("browser")  # type: ignore[no-untyped-call]
        self._complaints += [f"{line['level']}: {line['message']}" for line in log]
        foreign = self.run(_FOREIGN)
        assert isinstance(foreign, list)
        self._complaints += [f"loaded {name}" for name in foreign]


@contextmanager
def started() -> Iterator[Browser]:
    """Run a browser with a profile of its own, and end it."""
    options = ChromeOptions()
    options.binary_location = shutil.which("chromium") or "chromium"
    with tempfile.TemporaryDirectory(prefix="forge-test-chromium-", ignore_cleanup_errors=True) as profile:
        for switch in (*_SWITCHES, f"--user-data-dir={profile}"):
            options.add_argument(switch)
        options.set_capability("goog:loggingPrefs", {"browser": "WARNING"})
        # With its path given, selenium looks for no driver of its own, least of all on the network.
        driver = Chrome(options, ChromeService(shutil.which("chromedriver") or "chromedriver"))
        try:
            yield Browser(driver)
        finally:
            driver.quit()
