"""YAML and TOML text to plain values; their parsers are imported only when there is such a text."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

from forge.errors import Place, Problem, WorkspaceError

if TYPE_CHECKING:
    from pathlib import Path


def read_yaml(text: str, path: Path) -> dict[str, Any]:
    """Return the mapping that a YAML text is, JSON included; nothing makes an empty one.

    Raises WorkspaceError with the place where it is malformed, or when it is no mapping.
    """
    import yaml  # noqa: PLC0415  (15 ms that most workspaces need not spend)

    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = Place(path, mark.line + 1, mark.column + 1) if mark else Place(path)
        message = getattr(error, "problem", None) or "something that YAML does not know"
        raise WorkspaceError(Problem(f"not well-formed YAML: {message}", place)) from None
    if value is None:
        return {}
    if not isinstance(value, dict):
        raise WorkspaceError(Problem("the file holds no mapping of keys to values", Place(path)))
    return value


def read_toml(text: str, path: Path) -> dict[str, Any]:
    """Return the table that a TOML text is; raises WorkspaceError when it is malformed."""
    if sys.version_info >= (3, 11):
        import tomllib  # noqa: PLC0415  (10 ms, as above)
    else:
        import tomli as tomllib  # noqa: PLC0415

    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise WorkspaceError(Problem(f"not well-formed TOML: {error}", Place(path))) from None
