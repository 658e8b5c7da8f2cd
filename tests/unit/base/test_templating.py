"""Templates are strict, and compiled templates may be cached."""

from collections.abc import Iterator
from pathlib import Path

import jinja2
import pytest

from forge.base import templating
from forge.base.env_vars import compiled_templates

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


def test_templates_of_code_do_not_escape_values() -> None:
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
