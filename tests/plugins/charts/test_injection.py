"""Text from packages never becomes markup or script in charts."""

import json
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from hypothesis import example, given

from forge.base.templating import render
from forge.plugins.charts.drawing import drawn, facts
from forge.plugins.charts.graph_formats import PackageGraph, mermaid, printable, reduced_among
from forge.plugins.charts.reporter import timings_page, trace
from forge.plugins.charts.timings import read_build
from forge.plugins.charts.work import comparison
from tests.conftest import Forge, Tree
from tests.hostile import hostile
from tests.packages import manifest_text, package
from tests.sites import UNSEEN, elements, read_page, scripts
from tests.unit.test_injection import quick


def texts(value: object) -> set[str]:
    """Return all strings in a JSON value."""
    if isinstance(value, dict):
        return {found for each in value.values() for found in texts(each)}
    if isinstance(value, list):
        return {found for each in value for found in texts(each)}
    return {value} if isinstance(value, str) else set()


def chart_of(text: str, name: str) -> PackageGraph:
    """Return a graph of two packages, one called `name` with `text` in every field that is shown."""
    below, above = package("below"), package("above", "below")
    said = replace(below.manifest, name=name, version=text, description=text, build_type=text)
    packages = {name: replace(below, path=Path("src") / f"x{text}", manifest=said), "above": above}
    needs = {name: frozenset[str](), "above": frozenset({name})}
    return PackageGraph((name, "above"), needs, packages, frozenset(packages))


def picture_of(chart: PackageGraph, form: str) -> str:
    """Return the page or the picture of a graph whose packages took a second each."""
    seconds = dict.fromkeys(chart.ordered, 1.0)
    graph = reduced_among(chart.needs, chart.ordered, chart.selected)
    about: dict[str, object] = {"title": chart.ordered[0], "picture": drawn(chart, graph, seconds)}
    if form == "html":
        about["facts"] = facts(chart, graph, seconds)
    about["title"] = printable(chart.ordered[0])
    return render(f"charts/templates/graph.{form}.j2", **about)


named = hostile("/", "\0").filter(lambda text: text not in {"", ".", "..", "above"})


@quick
@given(hostile("/", "\0"), named)
def test_graph_pages_contain_no_foreign_elements(text: str, name: str) -> None:
    plain, found = picture_of(chart_of("x", "below"), "html"), picture_of(chart_of(text, name), "html")
    assert elements(found) == elements(plain)
    assert scripts(found)[0] == scripts(plain)[0]
    (block,) = scripts(found)[1]
    first, _ = json.loads(block)
    assert first["name"] == printable(name)
    assert first["version"] == printable(text)
    assert printable(name) in read_page(found).text


@quick
@given(named)
def test_graph_pictures_contain_no_foreign_elements(name: str) -> None:
    found, plain = (
        list(ET.fromstring(picture_of(chart_of("x", each), "svg")).iter()) for each in (name, "below")
    )
    assert [(each.tag, sorted(each.attrib)) for each in found] == [
        (each.tag, sorted(each.attrib)) for each in plain
    ]
    assert printable(name) in {each.text for each in found}


@pytest.mark.parametrize("form", ["--svg", "--html"])
def test_the_workspace_path_is_shown_as_text(form: str, forge: Forge, tree: Tree) -> None:
    folder = "<b>&\x0b\u202e"
    root = tree({f"{folder}/src/demo/package.xml": manifest_text("demo")}) / folder
    found = forge("graph", form, cwd=root)
    assert (found.code, found.err) == (0, "")
    assert not UNSEEN.search(found.out)
    assert "b" not in {tag for tag, _ in read_page(found.out).tags}
    assert printable(folder) in read_page(found.out).text


@quick
@given(named)
def test_flowcharts_contain_no_foreign_lines(name: str) -> None:
    lines = list(mermaid(chart_of("x", name)))
    assert [re.sub(r'"[^"\n]*"', "T", line) for line in lines] == [
        *("flowchart TD", "  p0[T]", "  p1[T]", "  p0 --> p1"),
    ]
    (said,) = re.findall(r'p1\["(.*)"\]$', lines[2])
    assert not re.search(r"[<>&`|(){}\[\]]", said)
    assert re.sub(r"#(\d+);", lambda code: chr(int(code[1])), said) == printable(name)


_TIMES = ("files", "failed", "total", "in_headers", "in_templates")


def events_of(text: str, name: str) -> list[str]:
    """Return the events of a build of package `name` with `text` in every field of free text."""
    about: Mapping[str, object] = {"package": name, "embedded": False}
    told: list[dict[str, object]] = [
        {"event": "Planned", **about, "reason": text, "conditional": False, "needs": [], "last": 9.0},
        {"event": "Started", **about, "reason": text},
        {"event": "StepStarted", **about, "step": text, "argv": [text], "cwd": text},
        {"event": "StepFinished", **about, "step": text, "code": 0},
        {"event": "Finished", **about, "code": 0, "seconds": 2.0, "log": text, "test_failures": False},
        {"event": "Commands", **about, "commands": [["compile", text, 2.0, 2.5]], "chain": [0]},
        {"event": "Headers", **dict.fromkeys(_TIMES, 1.0), "compiler": text, "headers": [[text, 1.0, 2]]},
        {"event": "Fresh", "package": f"fresh {name}", "embedded": False},
        {"event": "Skipped", "package": f"skipped {name}", "embedded": False, "because": text},
        {"event": "Summary", "code": 0, "seconds": 10.0, "log": text},
    ]
    return [json.dumps({**event, "time": float(time)}) for time, event in enumerate(told)]


def timings_of(text: str, name: str) -> str:
    """Return the page about such a build."""
    build = read_build(events_of(text, name))
    return timings_page("build", build, comparison(build, read_build(events_of("x", name)), text))


@quick
@given(hostile(), named)
@example("</script><script>alert(1)</script>", "x")
def test_build_pages_contain_no_foreign_elements(text: str, name: str) -> None:
    plain, found = timings_of("x", "demo"), timings_of(text, name)
    assert elements(found) == elements(plain)
    assert scripts(found)[0] == scripts(plain)[0]
    (block,) = scripts(found)[1]
    assert {printable(text), printable(name)} <= texts(json.loads(block))
    words = read_page(found).text
    assert printable(f"fresh {name}") in words
    assert printable(f"skipped {name}") in words
    assert {text, name} <= texts(json.loads(json.dumps(trace(read_build(events_of(text, name))))))


@pytest.mark.parametrize(
    "page", [f"charts/templates/{name}.j2" for name in ("graph.svg", "graph.html", "live.html")]
)
def test_templates_of_charts_escape_values(page: str) -> None:
    empty = drawn(PackageGraph((), {}, {}, frozenset()), {}, {})
    text = render(page, title="<b>&", picture=empty, facts=["</script>"])
    assert "<b>" not in text
    assert "&lt;b&gt;&amp;" in text
    assert text.count("</script>") == text.count("<script")
