"""Templates are strict, and compiled templates may be cached."""

from __future__ import annotations

from typing import TYPE_CHECKING

import jinja2
import networkx as nx
import pytest

from forge.base import templating
from forge.base.env_vars import compiled_templates
from forge.output.charts.drawing import drawn
from forge.output.charts.graph_formats import PackageGraph

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

TEMPLATE = "cpp/interface.hpp.j2"
NAMES = {"source": "tour/msg/A", "guard": "TOUR__A_HPP_", "headers": ["a.hpp"]}


@pytest.fixture
def afresh() -> Iterator[None]:
    """Forget the environment that other tests share, before and after."""
    templating.environment.cache_clear()
    yield
    templating._COMPILED.clear()
    templating.environment.cache_clear()


def test_a_name_that_was_not_given_is_an_error() -> None:
    with pytest.raises(jinja2.UndefinedError):
        templating.render(TEMPLATE, guard="A")


@pytest.mark.parametrize("page", ["html/graph.svg.j2", "html/graph.html.j2"])
def test_in_pages_and_only_there_names_are_escaped(page: str) -> None:
    empty = drawn(PackageGraph((), {}, {}, frozenset()), nx.DiGraph(), {})
    text = templating.render(page, title="<b>&", picture=empty, facts=["</script>"])
    assert "<b>" not in text
    assert "&lt;b&gt;&amp;" in text
    assert text.count("</script>") == text.count("<script")
    assert '#include "<b>&"' in templating.render(TEMPLATE, **{**NAMES, "headers": ["<b>&"]})


@pytest.mark.usefixtures("afresh")
def test_compiled_templates_are_kept_and_used(tmp_path: Path) -> None:
    templating.keep_compiled(tmp_path / "deep/kept")
    text = templating.render(TEMPLATE, **NAMES)
    (kept,) = (tmp_path / "deep/kept").iterdir()
    templating.environment.cache_clear()
    before = kept.stat().st_mtime_ns
    assert templating.render(TEMPLATE, **NAMES) == text
    assert kept.stat().st_mtime_ns == before
    kept.write_bytes(b"broken")
    templating.environment.cache_clear()
    assert templating.render(TEMPLATE, **NAMES) == text


@pytest.mark.usefixtures("afresh")
def test_a_folder_that_is_gone_or_cannot_be_is_no_harm(tmp_path: Path) -> None:
    templating.keep_compiled(tmp_path / "gone")
    templating.environment()
    (tmp_path / "gone").rmdir()
    assert "a.hpp" in templating.render(TEMPLATE, **NAMES)
    assert not (tmp_path / "gone").exists()
    templating.environment.cache_clear()
    (tmp_path / "file").write_text("")
    templating.keep_compiled(tmp_path / "file/below")
    assert "a.hpp" in templating.render(TEMPLATE, **NAMES)


@pytest.mark.usefixtures("afresh")
def test_the_first_folder_that_can_be_is_taken(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    templating.keep_compiled(tmp_path / "file/below", tmp_path / "second", tmp_path / "third")
    templating.render(TEMPLATE, **NAMES)
    assert any((tmp_path / "second").iterdir())
    assert not (tmp_path / "third").exists()


def test_compiled_templates_are_the_users_own_whatever_a_team_shares(tmp_path: Path) -> None:
    other = tmp_path / "build/.forge_templates"
    shared = {"FORGE_CACHE_DIR": "/team/cache"}
    mine = compiled_templates({**shared, "XDG_CACHE_HOME": str(tmp_path / "cache")}, other)
    assert mine == (tmp_path / "cache/forge/templates", other)
    assert compiled_templates({**shared, "XDG_CACHE_HOME": "relative"}, other) == (other,)
