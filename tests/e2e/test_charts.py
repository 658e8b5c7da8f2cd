"""Graph and timing pages in a real browser."""

import json
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

import pytest

from forge.plugins.charts.reporter import write_timings
from tests.browser import Browser, Keys
from tests.conftest import Forge
from tests.packages import manifest_text

CMAKE = """cmake_minimum_required(VERSION 3.18)
project({name} NONE)
install(FILES package.xml DESTINATION share/{name})
"""
NEEDS = {
    "base": (),
    "msgs": ("base",),
    "driver": ("base", "msgs"),
    "map": ("msgs",),
    "planner": ("map", "driver"),
    "lone": (),
}
NASTY = "a <b>bold</b> &amp; </script><img src=x onerror=boom()> word"


def write_workspace(root: Path) -> Path:
    """Write packages that do nothing but need each other; one says nasty things."""
    for name, needs in NEEDS.items():
        text = manifest_text(name, *(f"<depend>{need}</depend>" for need in needs), build_type="cmake")
        if name == "driver":
            text = text.replace("A package of the tests", NASTY.replace("&", "&amp;").replace("<", "&lt;"))
        folder = root / "src" / name
        folder.mkdir(parents=True)
        (folder / "package.xml").write_text(text)
        (folder / "CMakeLists.txt").write_text(CMAKE.format(name=name))
    return root


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a workspace for all tests of this file, the first of which builds it."""
    return write_workspace(tmp_path_factory.mktemp("pictures") / "my ws")


@pytest.fixture
def timings(forge: Forge, workspace: Path) -> Path:
    """Return the page about a build of the workspace."""
    path = workspace / "log/latest_build/timings.html"
    if not path.exists():
        ran = forge("build", "--timings", cwd=workspace)
        assert ran.code == 0, ran.err
        assert ran.out.endswith("timings: log/latest_build/timings.html\n")
    return path


@pytest.fixture
def graph(forge: Forge, workspace: Path, timings: Path) -> Path:
    """Return the picture of the workspace, which is built."""
    assert timings.exists()
    ran = forge("graph", "--html", "-o", "graph.html", cwd=workspace)
    assert (ran.code, ran.out) == (0, ""), ran.err
    return workspace / "graph.html"


browsing = pytest.mark.needs("chromium", "chromedriver", "cmake")


@browsing
def test_the_chart_has_a_bar_for_each_package(browser: Browser, timings: Path) -> None:
    browser.open(timings)
    events = [json.loads(line) for line in timings.with_name("events.jsonl").read_text().splitlines()]
    started = [event["package"] for event in events if event["event"] == "Started"]
    assert sorted(started) == sorted(NEEDS)
    assert sorted(browser.texts("#bars .name")) == sorted(started)
    assert browser.texts("h1")[0].startswith("6 packages in ")
    lefts = browser.run(
        "return [...document.querySelectorAll('.bar')].map(bar => bar.getBoundingClientRect().left)"
    )
    assert isinstance(lefts, list)
    assert lefts == sorted(lefts)
    # With /proc there is something to see of the machine, too.
    assert browser.texts(".strip .name")[0].startswith("packages at work")
    path = browser.texts("#critical .go")
    assert path[0] == "base"
    assert path[-1] == "planner"
    assert browser.texts("#bars .critical .name") == path


@browsing
def test_selecting_a_package_shows_its_steps_and_waiting_time(browser: Browser, timings: Path) -> None:
    browser.open(timings)
    browser.click("#bars [data-number='0'] .bar")
    assert browser.texts("#card h2") == ["base"]
    assert [row.split()[0] for row in browser.texts("#steps tr")] == ["cmake", "build", "install"]
    browser.click("#users .go")
    assert browser.texts("#card h2") == ["msgs"]
    assert browser.texts("#needs .go") == ["base"]
    assert sorted(browser.texts("#users .go")) == ["driver", "map"]
    assert browser.texts("#bars .need .name") == ["base"]
    assert sorted(browser.texts("#bars .user .name")) == ["driver", "map"]
    browser.press(Keys.ESCAPE)
    assert browser.texts("#card") == []


@browsing
def test_the_chart_can_be_searched_zoomed_and_navigated_by_keyboard(browser: Browser, timings: Path) -> None:
    browser.open(timings)
    browser.press("/", "m")
    assert sorted(browser.texts("#bars .name")) == ["map", "msgs"]
    assert browser.texts("#count") == ["2 of 6"]
    assert sorted(browser.texts("#packages-table tbody th")) == ["map", "msgs"]
    browser.press(Keys.ESCAPE)
    assert len(browser.texts("#bars .name")) == len(NEEDS)
    width = "return document.querySelector('#axis .track').getBoundingClientRect().width"
    before = browser.run(width)
    browser.click("#closer")
    browser.press("+")
    after = browser.run(width)
    assert isinstance(before, int | float)
    assert isinstance(after, int | float)
    assert after > 1.8 * before
    browser.press("0")
    assert browser.run(width) == before
    browser.run("document.querySelector('#bars .bar').focus()")
    browser.press(Keys.ARROW_DOWN, Keys.ARROW_DOWN)
    assert (browser.focus.get_attribute("aria-label") or "").startswith(browser.texts("#bars .name")[2] + ",")
    browser.click("#only")
    assert browser.texts("#bars .name") == browser.texts("#critical .go")


@browsing
def test_the_table_sorts_by_any_column(browser: Browser, timings: Path) -> None:
    browser.open(timings)
    browser.click("#packages-table thead th:first-child button")
    assert browser.texts("#packages-table tbody th") == sorted(NEEDS)
    browser.click("#packages-table thead th:first-child button")
    assert browser.texts("#packages-table tbody th") == sorted(NEEDS, reverse=True)


@browsing
def test_the_graph_shows_all_packages_and_can_be_searched(browser: Browser, graph: Path) -> None:
    browser.open(graph)
    assert sorted(browser.texts(".node text:first-of-type")) == sorted(NEEDS)
    assert (
        len(browser.all(".line")) == 5
    )  # base-msgs-driver-planner, msgs-map-planner: base-driver is implied
    browser.write("#search", "P")
    assert browser.texts("#found button") == ["planner", "map"]
    assert browser.texts("#count") == ["2 of 6"]
    browser.press(Keys.ENTER)
    assert browser.texts("#card h2") == ["planner"]
    assert browser.address.endswith("#planner")


@browsing
def test_a_click_highlights_dependencies_and_dependents(browser: Browser, graph: Path) -> None:
    browser.open(graph)
    browser.click(f".node[data-number='{number_of(browser, 'map')}']")
    assert sorted(browser.texts(".node.below text:first-of-type")) == ["base", "msgs"]
    assert browser.texts(".node.above text:first-of-type") == ["planner"]
    assert len(browser.all(".line.below")) == 2
    assert len(browser.all(".line.above")) == 1
    assert browser.texts("#needs-title") == ["Dependencies: 2 (1 direct)"]
    assert browser.texts("#needs .direct") == ["msgs"]
    assert browser.texts("#layer") == ["3 of 4"]
    browser.click("#users button")
    assert browser.texts(".node.chosen text:first-of-type") == ["planner"]
    browser.press(Keys.ARROW_LEFT)
    assert browser.texts("#card h2")[0] in {"map", "driver"}
    browser.click("#close")
    assert browser.all(".node.below, .node.above, .node.chosen") == []
    assert not browser.address.endswith("planner")


@browsing
def test_a_url_with_a_package_name_shows_that_package(browser: Browser, graph: Path) -> None:
    browser.open(graph, anchor="driver", dark=True)
    assert browser.texts("#card h2") == ["driver"]
    assert browser.texts("#about") == [NASTY]
    assert browser.all("#about *, img") == []
    assert browser.texts("#needs .direct") == ["base", "msgs"]


@browsing
@pytest.mark.parametrize("dark", [False, True])
def test_narrow_screens_show_a_list_of_packages(browser: Browser, graph: Path, dark: bool) -> None:
    browser.open(graph, size=(400, 900), dark=dark)
    assert browser.all("#graph") == []
    assert sorted(browser.texts("#list .name")) == sorted(NEEDS)
    assert browser.run("return document.documentElement.scrollWidth") == 400
    browser.write("#search", "ma")
    assert browser.texts("#list .name") == ["map"]
    browser.click("#list li:not([hidden]) button")
    assert browser.texts("#card h2") == ["map"]
    browser.click("#needs button")
    assert browser.texts("#card h2") == [browser.texts("#list .chosen .name")[0]]
    assert browser.texts("#list .above .name")


@browsing
@pytest.mark.parametrize("dark", [False, True])
def test_timings_fit_narrow_screens_and_show_whole_names(
    browser: Browser, tmp_path: Path, dark: bool
) -> None:
    names = ["depot_planner_interfaces_cpp", "depot_lib0"]
    write_run(tmp_path, {names[0]: (), names[1]: (names[0],)})
    browser.open(tmp_path / "timings.html", size=(400, 900), dark=dark)
    assert browser.run("return document.documentElement.scrollWidth") == 400
    # In each list and table, a name is on one line and not cut.
    whole = """return [...document.querySelectorAll("#bars .name, .go")].map((element) => {
      const range = document.createRange();
      range.selectNodeContents(element);
      return range.getClientRects().length === 1 && element.scrollWidth <= element.clientWidth + 1
        || getComputedStyle(element).display === "inline" && range.getClientRects().length === 1;
    })"""
    found = browser.run(whole)
    assert isinstance(found, list)
    assert len(found) > 6
    assert all(found)


@browsing
def test_the_graph_can_be_panned_and_zoomed(browser: Browser, graph: Path) -> None:
    browser.open(graph)
    place = "const box = document.querySelector('.node').getBoundingClientRect();"
    place += "return [box.x, box.y, box.width]"
    before = browser.run(place)
    browser.drag("#graph", 50, 30)
    moved = browser.run(place)
    assert isinstance(before, list)
    assert isinstance(moved, list)
    assert (round(moved[0] - before[0]), round(moved[1] - before[1])) == (50, 30)
    browser.press("+")
    closer = browser.run(place)
    assert isinstance(closer, list)
    assert closer[2] == pytest.approx(1.25 * before[2])
    browser.click("#whole")
    assert browser.run(place) == before


@browsing
def test_package_output_is_shown_as_text_on_the_build_page(browser: Browser, tmp_path: Path) -> None:
    names = [NASTY, "'\"`${boom()}", "__proto__"]
    write_run(tmp_path, dict.fromkeys(names, ()))
    browser.open(tmp_path / "timings.html")
    assert browser.texts("#bars .name") == names
    assert browser.texts("#critical .go") == [names[-1]]
    assert browser.texts("#packages-table tbody th") == [names[2], names[1], names[0]]
    browser.click(".bar")
    assert browser.texts("#card h2") == [NASTY]
    assert browser.texts("#reason") == [f"Built because: {NASTY} changed"]
    assert browser.all("img, b") == []


@browsing
def test_a_thousand_packages_can_be_searched_and_navigated(browser: Browser, tmp_path: Path) -> None:
    names = [f"package_{number:04}" for number in range(1000)]
    before = ((), *((name,) for name in names))
    write_run(tmp_path, dict(zip(names, before, strict=False)))
    browser.open(tmp_path / "timings.html")
    assert browser.run("return document.querySelectorAll('#bars .bar').length") == len(names)
    browser.write("#search", "_0777")
    assert browser.texts("#bars li:not([hidden]) .name") == ["package_0777"]
    browser.click("#bars li:not([hidden]) .bar")
    browser.click("#users .go")
    assert browser.texts("#card h2") == ["package_0778"]
    assert (browser.focus.get_attribute("aria-label") or "").startswith("package_0778,")
    assert browser.run("return bars[778].getBoundingClientRect().top < innerHeight")


def write_run(folder: Path, needs: Mapping[str, tuple[str, ...]]) -> None:
    """Write the page about a build in which each package took a second longer than the one before."""
    lines: list[dict[str, object]] = []
    now = 0.0
    for number, (name, wanted) in enumerate(needs.items(), 1):
        about = {"package": name, "embedded": False}
        lines += [
            {"event": "Planned", "time": 0.0, **about, "reason": "", "conditional": False, "needs": wanted},
            {"event": "Started", "time": now, **about, "reason": f"{NASTY} changed"},
            {"event": "StepStarted", "time": now, **about, "step": "build", "argv": [], "cwd": "/"},
            {"event": "StepFinished", "time": now + number, **about, "step": "build", "code": 0},
            {"event": "Finished", "time": now + number, **about, "code": 0, "seconds": number},
        ]
        now += number
    (folder / "events.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    write_timings(folder)


def number_of(browser: Browser, name: str) -> int:
    return browser.texts(".node text:first-of-type").index(name)


def test_pictures_are_reproducible(forge: Forge, tmp_path: Path) -> None:
    root = write_workspace(tmp_path / "ws")
    first = forge("graph", "--svg", cwd=root)
    assert first.code == 0, first.err
    assert forge("graph", "--svg", cwd=root).out == first.out
    drawing = ET.fromstring(first.out)
    names = [text.text for text in drawing.iter("{http://www.w3.org/2000/svg}text")]
    assert {*NEEDS} < set(names)
    # Only what is selected, and lines over what is not.
    some = forge("graph", "--svg", "--packages-select", "planner", "base", cwd=root).out
    assert some.count('<path class="line"') == 1


def test_mermaid_draws_only_dependencies_that_are_not_implied(forge: Forge, tmp_path: Path) -> None:
    root = write_workspace(tmp_path / "ws")
    lines = forge("graph", "--mermaid", "--packages-skip", "lone", cwd=root).out.splitlines()
    assert lines[0] == "flowchart TD"
    names = {line.split("[")[0].strip(): line.split('"')[1] for line in lines if "[" in line}
    arrows = {
        tuple(names[end] for end in line.split(" --> "))
        for line in (x.strip() for x in lines)
        if "-->" in line
    }
    assert arrows == {
        *(("msgs", "base"), ("driver", "msgs"), ("map", "msgs")),
        *(("planner", "map"), ("planner", "driver")),
    }


def test_timings_need_a_log_folder_and_a_built_package(forge: Forge, workspace: Path, timings: Path) -> None:
    assert timings.exists()
    ran = forge("build", "--timings", "--log-base", "/dev/null", cwd=workspace)
    assert ran.code == 2
    assert "log folder" in ran.err
    ran = forge("build", "--timings", cwd=workspace)
    assert ran.code == 0
    assert "nothing was built" in ran.err


COMPILED = """cmake_minimum_required(VERSION 3.18)
project(depot C)
add_library(depot src/fast.c src/slow.c)
install(TARGETS depot DESTINATION lib)
"""


@pytest.mark.needs("cmake", "ninja")
def test_the_page_names_slow_files_and_compares_builds(forge: Forge, tmp_path: Path) -> None:
    folder = tmp_path / "my ws/src/depot"
    (folder / "src").mkdir(parents=True)
    (folder / "package.xml").write_text(manifest_text("depot", build_type="cmake"))
    (folder / "CMakeLists.txt").write_text(COMPILED)
    (folder / "src/fast.c").write_text("int fast;\n")
    (folder / "src/slow.c").write_text("int slow;\n")
    root = tmp_path / "my ws"
    first = forge("build", "--timings", cwd=root)
    assert first.code == 0, first.err
    assert "slowest: " in first.out
    (log,) = (path for path in (root / "log").glob("build_*"))

    def commands() -> list[tuple[str, str]]:
        lines = (root / "log/latest_build/events.jsonl").read_text().splitlines()
        events = [json.loads(line) for line in lines]
        found = [event["commands"] for event in events if event["event"] == "Commands"]
        return sorted((kind, name) for each in found for kind, name, _, _ in each)

    assert commands() == [("compile", "src/fast.c"), ("compile", "src/slow.c"), ("link", "libdepot.a")]
    (folder / "src/slow.c").write_text("int slow, slower;\n")
    second = forge("build", "--timings-compare", f"../log/{log.name}", cwd=root / "src")
    assert second.code == 0, second.err
    assert commands() == [("compile", "src/slow.c"), ("link", "libdepot.a")]
    page = (root / "log/latest_build/timings.html").read_text()
    assert f"Compared with {log.name}" in page
    assert "only then" in page  # fast.c
    (folder / "src/fast.c").write_text("int fast, faster;\n")
    assert forge("build", "--timings-compare", cwd=root).code == 0
    assert "Compared with build_" in (root / "log/latest_build/timings.html").read_text()
    assert commands() == [("compile", "src/fast.c"), ("link", "libdepot.a")]


def test_a_build_that_does_not_exist_is_not_compared(forge: Forge, tmp_path: Path) -> None:
    root = write_workspace(tmp_path / "ws")
    ran = forge("build", "--timings-compare", "build_1", cwd=root)
    assert ran.code == 2
    assert "error: --timings-compare: there is no log of a build in 'build_1'" in ran.err


def test_json_mode_prints_the_page_path_on_stderr_and_the_machine_as_an_event(
    forge: Forge, workspace: Path, timings: Path
) -> None:
    page = timings.read_text()
    ran = forge(
        "build", "--timings", "--json", "--force", "--packages-select", "lone", cwd=workspace / "src/lone"
    )
    assert ran.code == 0, ran.err
    assert "timings: ../../log/latest_build/timings.html\n" in ran.err
    *_, usage, summary = (json.loads(line) for line in ran.out.splitlines())
    assert (usage["event"], summary["event"]) == ("Usage", "Summary")
    assert all(0 <= busy <= usage["processors"] for _, busy, _ in usage["samples"])
    # The run of before keeps its own page, and this one knows how long the package took then.
    assert page in {path.read_text() for path in workspace.glob("log/build_*/timings.html")}
    assert json.loads(timings.with_name("trace.json").read_text())["traceEvents"]
    assert "than in their previous builds" in timings.read_text()


def test_a_failed_build_has_a_page(forge: Forge, tmp_path: Path) -> None:
    root = write_workspace(tmp_path / "ws")
    (root / "src/msgs/CMakeLists.txt").write_text("cmake_minimum_required(VERSION 3.18)\nproject(")
    ran = forge("build", "--timings", "--packages-up-to", "map", cwd=root)
    assert ran.code == 1
    text = (root / "log/latest_build/timings.html").read_text()
    assert "1 built, 1 failed, 1 not started." in text
    assert 'class="row failed' in text
