"""The one door to the Jinja2 templates: strict, nothing escaped but in pages, no thinking inside."""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from forge.files import replace_file

if TYPE_CHECKING:
    import jinja2


def render(template: str, /, **names: object) -> str:
    """Return the text of `template` (a path below templates/) with `names` filled in.

    Raises jinja2.UndefinedError when the template uses a name that was not given: our bug.
    """
    return environment().get_template(template).render(names)


def keep_compiled(*where: Path) -> None:
    """Keep compiled templates in the first of the folders that can be, from the first `render` on.

    To compile one takes 3 ms, and what is kept is run: the folder has to be the user's own. It is made when
    there is something to keep; where none can be, every process compiles what it needs.
    """
    _COMPILED[:] = where


_COMPILED: list[Path] = []

_PAGES = ("html.j2", "svg.j2")
"""What templates of pages end with: there a name of a package must not become markup."""


@cache
def environment() -> jinja2.Environment:
    """Return the environment all templates share."""
    import jinja2  # noqa: PLC0415  (30 ms that only writers of text should pay)

    return jinja2.Environment(
        bytecode_cache=_compiled(),
        loader=jinja2.FileSystemLoader(folder()),
        undefined=jinja2.StrictUndefined,
        autoescape=jinja2.select_autoescape(_PAGES),
        keep_trailing_newline=True,
        trim_blocks=True,
        lstrip_blocks=True,
        auto_reload=False,
    )


def _compiled() -> jinja2.BytecodeCache | None:
    """Return what keeps compiled templates, if it is known where."""
    import jinja2  # noqa: PLC0415  (as above)

    class Kept(jinja2.BytecodeCache):
        """A file per template; a folder that has gone since is not made again."""

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
            return Kept()
    return None


def folder() -> Path:
    """Return where the templates are: in the wheel, else in the checkout."""
    here = Path(__file__).parent
    packed = here / "_templates"
    return packed if packed.is_dir() else here.parent / "templates"
