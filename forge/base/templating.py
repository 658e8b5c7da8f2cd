"""Renders the Jinja2 templates: strict, with escaping only in HTML and SVG, without logic in templates."""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING

from forge.base.files import replace_file
from forge.base.layout import PACKAGE, templates_folder

if TYPE_CHECKING:
    from pathlib import Path

    import jinja2


def render(template: str, /, **names: object) -> str:
    """Return the text of `template` (a path below templates/ or forge/plugins/) with the variables `names`.

    Raises jinja2.UndefinedError for undefined variables, which is a bug in forge.
    """
    return environment().get_template(template).render(names)


def keep_compiled(*where: Path) -> None:
    """Cache compiled templates in the first usable of these folders, from the first `render` on.

    Compiling a template takes 3 ms. Cached templates are executed, so the folder must be private to the user.
    """
    _COMPILED[:] = where


_COMPILED: list[Path] = []

_PAGES = ("html.j2", "svg.j2")
"""Suffixes of templates with automatic escaping."""


@cache
def environment() -> jinja2.Environment:
    import jinja2

    return jinja2.Environment(
        bytecode_cache=_bytecode_cache(),
        loader=jinja2.FileSystemLoader((templates_folder(), PACKAGE / "plugins")),
        undefined=jinja2.StrictUndefined,
        autoescape=jinja2.select_autoescape(_PAGES),
        keep_trailing_newline=True,
        trim_blocks=True,
        lstrip_blocks=True,
        auto_reload=False,
    )


def _bytecode_cache() -> jinja2.BytecodeCache | None:
    import jinja2

    class TemplateFiles(jinja2.BytecodeCache):
        """Stores a file per template; a folder that has been removed is not recreated."""

        def load_bytecode(self, bucket: jinja2.bccache.Bucket) -> None:
            with suppress(OSError):
                bucket.bytecode_from_string((where / bucket.key).read_bytes())

        def dump_bytecode(self, bucket: jinja2.bccache.Bucket) -> None:
            if where.is_dir():
                with suppress(OSError):
                    replace_file(where / bucket.key, bucket.bytecode_to_string())

    for where in _COMPILED:
        with suppress(OSError):
            where.mkdir(parents=True, exist_ok=True)
            return TemplateFiles()
    return None
