"""YAML and TOML text to plain values; their parsers are imported only when there is such a text.

No text is worth more than it is long: what nests too deep, or repeats itself by references until it is
too large, is refused before it is put together.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

from forge.errors import Place, Problem, WorkspaceError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

DEEPEST = 50
"""How many lists and mappings of a file may stand inside each other."""

LARGEST = 100_000
"""How many values a YAML file may come to when its references are followed."""

_DIGITS = 100
_DOTS = 500
"""How many parts a key of TOML may have: to read them takes the square of their number."""

_ODD = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)
"""What PyYAML's constructors raise for values such as '2001-99-99' or '!!bool x'."""


def read_yaml(content: bytes | str, path: Path) -> dict[str, Any]:
    """Return the mapping that a YAML text is, JSON included; nothing makes an empty one.

    Raises WorkspaceError with the place where it is malformed, or when it is no mapping.
    """
    import yaml  # noqa: PLC0415  (15 ms that most workspaces need not spend)

    try:
        value = _yaml_loader()(_text(content, path)).get_single_data()
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = Place(path, mark.line + 1, mark.column + 1) if mark else Place(path)
        message = getattr(error, "problem", None) or "something that YAML does not know"
        raise WorkspaceError(Problem(f"not well-formed YAML: {message}", place)) from None
    except _ODD:
        message = "not well-formed YAML: a value is not of the type that it looks like"
        raise WorkspaceError(Problem(message, Place(path), "put it between quotes")) from None
    if value is None:
        return {}
    if not isinstance(value, dict):
        raise WorkspaceError(Problem("the file holds no mapping of keys to values", Place(path)))
    return value


def read_toml(content: bytes | str, path: Path) -> dict[str, Any]:
    """Return the table that a TOML text is; raises WorkspaceError when it is malformed."""
    if sys.version_info >= (3, 11):
        import tomllib  # noqa: PLC0415  (10 ms, as above)
    else:
        import tomli as tomllib  # noqa: PLC0415

    text = _text(content, path)
    for number, line in enumerate(text.split("\n"), 1):
        if line.count(".") > _DOTS and line.partition("=")[0].count(".") > _DOTS:
            raise WorkspaceError(
                Problem("not well-formed TOML: a key has too many parts", Place(path, number))
            )
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise WorkspaceError(Problem("not well-formed TOML: it nests too deep", Place(path))) from None
    except _ODD as error:  # its own errors are ValueErrors, as is a number of too many digits
        raise WorkspaceError(Problem(f"not well-formed TOML: {error}", Place(path))) from None


def _text(content: bytes | str, path: Path) -> str:
    """Return a file's text without its byte order mark; raises WorkspaceError when it is not UTF-8."""
    if isinstance(content, str):
        return content
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise WorkspaceError(Problem("the text is not UTF-8", Place(path, line))) from None


def _yaml_loader() -> Callable[[str], Any]:
    """Return PyYAML's safe loader with bounds: how deep, and how much, references followed."""
    import yaml  # noqa: PLC0415  (as above)

    class Loader(yaml.SafeLoader):
        """Counts what it composes; what an anchor stands for counts again at each reference."""

        depth = 0
        count = 0

        def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
            """Compose a node unless it stands too deep, or is one too many."""
            event: yaml.Event = self.peek_event()  # type: ignore[no-untyped-call]  # of the stubs
            mark: Any = event.start_mark
            if self.depth >= DEEPEST:
                raise yaml.composer.ComposerError(None, None, f"it nests more than {DEEPEST} deep", mark)
            alias = isinstance(event, yaml.AliasEvent)
            before = self.count
            self.depth += 1
            node = super().compose_node(parent, index)
            self.depth -= 1
            self.count += 1
            if alias:
                if id(node) not in self.weights:
                    raise yaml.composer.ComposerError(None, None, "it refers to itself", mark)
                self.count += self.weights[id(node)]
            if self.count > LARGEST:
                message = f"with its references it has more than {LARGEST} values"
                raise yaml.composer.ComposerError(None, None, message, mark)
            self.weights.setdefault(id(node), self.count - before)
            return node

        def __init__(self, text: str) -> None:
            super().__init__(text)
            self.weights: dict[int, int] = {}

    def integer(loader: Loader, node: yaml.ScalarNode) -> int:
        """Return a whole number of a sane length; those of base 60 take long to read otherwise."""
        if len(node.value) > _DIGITS:
            raise yaml.constructor.ConstructorError(None, None, "a number is too long", node.start_mark)
        return loader.construct_yaml_int(node)

    Loader.add_constructor("tag:yaml.org,2002:int", integer)
    return Loader
