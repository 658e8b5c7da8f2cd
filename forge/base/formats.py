"""Parses YAML and TOML into plain values; the parsers are imported on first use.

Deeply nested documents, and YAML aliases that expand to very large documents, are rejected before
construction.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

from forge.base.errors import Place, Problem, WorkspaceError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

DEEPEST = 50
"""Maximum nesting depth of lists and mappings."""

LARGEST = 100_000
"""Maximum number of values of a YAML document with aliases expanded."""

_DIGITS = 100
_DOTS = 500
"""Maximum number of parts of a TOML key, whose parsing takes quadratic time."""

_ODD = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)
"""Exceptions of PyYAML's constructors for values such as '2001-99-99' or '!!bool x'."""


def read_yaml(content: bytes | str, path: Path) -> dict[str, Any]:
    """Parse a YAML or JSON mapping; an empty document is an empty mapping.

    Raises WorkspaceError with the position if it is malformed or not a mapping.
    """
    import yaml  # noqa: PLC0415  (takes 15 ms, rarely needed)

    try:
        value = _yaml_loader()(_text(content, path)).get_single_data()
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = Place(path, mark.line + 1, mark.column + 1) if mark else Place(path)
        message = getattr(error, "problem", None) or "invalid syntax"
        raise WorkspaceError(Problem(f"not well-formed YAML: {message}", place)) from None
    except _ODD:
        message = "not well-formed YAML: a value does not have the type that its syntax implies"
        raise WorkspaceError(Problem(message, Place(path), "quote the value")) from None
    if value is None:
        return {}
    if not isinstance(value, dict):
        raise WorkspaceError(Problem("the file is not a mapping", Place(path)))
    return value


def read_toml(content: bytes | str, path: Path) -> dict[str, Any]:
    """Parse a TOML document; raises WorkspaceError if it is malformed."""
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
        raise WorkspaceError(Problem("not well-formed TOML: too deeply nested", Place(path))) from None
    except _ODD as error:  # includes TOMLDecodeError, a ValueError
        raise WorkspaceError(Problem(f"not well-formed TOML: {error}", Place(path))) from None


def _text(content: bytes | str, path: Path) -> str:
    """Return a file's text without byte order mark; raises WorkspaceError if it is not UTF-8."""
    if isinstance(content, str):
        return content
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise WorkspaceError(Problem("the text is not UTF-8", Place(path, line))) from None


def _yaml_loader() -> Callable[[str], Any]:
    """Return PyYAML's safe loader with limits for nesting and size."""
    import yaml  # noqa: PLC0415  (as above)

    class Loader(yaml.SafeLoader):
        """Counts composed nodes; those of an anchor count again at each alias."""

        depth = 0
        count = 0

        def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
            """Compose a node within the limits for nesting and number."""
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
