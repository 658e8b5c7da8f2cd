"""Templates are strict, and compiled templates may be cached."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import jinja2
import networkx as nx
import pytest

from forge.base import templating
from forge.base.env_vars import compiled_templates
from forge.output.charts.drawing import drawn
from forge.output.charts.graph_formats import PackageGraph

TEMPLATE = "cpp/interface.hpp.j2"
NAMES = {"source": "tour/msg/A", "guard": "TOUR__A_HPP_", "headers": ["a.hpp"]}


@pytest.fixture
def afresh() -> Iterator[None]:
    """Forget the environment that other tests share, before and after."""
    templating.environment.cache_clear()
    yield
    templating._COMPILED.clear()
    templating.environment.cache_clear()


def test_an_undefined_variable_is_an_error() -> None:
    with pytest.raises(jinja2.UndefinedError):
        templating.render(TEMPLATE, guard="A")


@pytest.mark.parametrize("page", ["html/graph.svg.j2", "html/graph.html.j2"])
def test_only_html_and_svg_templates_escape_values(page: str) -> None:
    empty = drawn(PackageGraph((), {}, {}, frozenset()), nx.DiGraph(), {})
    text = templating.render(page, title="<b>&", picture=empty, facts=["</script>"])
    assert "<b>" not in text
    assert "&lt;b&gt;&amp;" in text
    assert text.count("</script>") == text.count("<script")
    assert '#include "<b>&"' in templating.render(TEMPLATE, **{**NAMES, "headers": ["<b>&"]})


@pytest.mark.usefixtures("afresh")
def test_a_missing_or_invalid_template_cache_is_ignored(tmp_path: Path) -> None:
    templating.keep_compiled(tmp_path / "gone")
    templating.environment()
    (tmp_path / "gone").rmdir()
    assert "a.hpp" in templating.render(TEMPLATE, **NAMES)
    assert not (tmp_path / "gone").exists()
    templating.environment.cache_clear()
    (tmp_path / "file").write_text("")
    templating.keep_compiled(tmp_path / "file/below")
    assert "a.hpp" in templating.render(TEMPLATE, **NAMES)


def test_compiled_templates_are_never_in_a_shared_cache(tmp_path: Path) -> None:
    other = tmp_path / "build/.forge_templates"
    shared = {"FORGE_CACHE_DIR": "/team/cache"}
    mine = compiled_templates({**shared, "XDG_CACHE_HOME": str(tmp_path / "cache")}, other)
    assert mine == (tmp_path / "cache/forge/templates", other)
    assert compiled_templates({**shared, "XDG_CACHE_HOME": "relative"}, other) == (other,)
