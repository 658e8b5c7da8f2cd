"""The one door to the Jinja2 templates: strict, no escaping, no thinking inside."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import jinja2


def render(template: str, /, **names: object) -> str:
    """Return the text of `template` (a path below templates/) with `names` filled in.

    Raises jinja2.UndefinedError when the template uses a name that was not given: our bug.
    """
    return environment().get_template(template).render(names)


@cache
def environment() -> jinja2.Environment:
    """Return the environment all templates share."""
    import jinja2  # noqa: PLC0415  (30 ms that only writers of text should pay)

    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(folder()),
        undefined=jinja2.StrictUndefined,
        autoescape=False,  # noqa: S701  (no HTML is written from these; views finish every string)
        keep_trailing_newline=True,
        trim_blocks=True,
        lstrip_blocks=True,
        auto_reload=False,
    )


def folder() -> Path:
    """Return where the templates are: in the wheel, else in the checkout."""
    here = Path(__file__).parent
    packed = here / "_templates"
    return packed if packed.is_dir() else here.parent / "templates"
