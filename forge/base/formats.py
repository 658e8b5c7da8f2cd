"""Parses YAML and TOML into plain values; the parsers are imported on first use."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from forge.base.errors import Location, Problem, WorkspaceError

_INVALID_VALUES = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)
"""Exceptions of PyYAML's constructors for values such as '2001-99-99' or '!!bool x'."""


def read_yaml(content: bytes | str, path: Path) -> dict[str, Any]:
    """Parse a YAML or JSON mapping; an empty document is an empty mapping.

    Raises WorkspaceError with the position if it is malformed or not a mapping.
    """
    import yaml

    try:
        loader = yaml.SafeLoader(_text(content, path))
        loader.deep_construct = True  # rejects lists and mappings that contain themselves
        value = loader.get_single_data()
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = Location(path, mark.line + 1, mark.column + 1) if mark else Location(path)
        message = getattr(error, "problem", None) or "invalid syntax"
        raise WorkspaceError(Problem(f"not well-formed YAML: {message}", place)) from None
    except RecursionError:
        raise WorkspaceError(Problem("not well-formed YAML: too deeply nested", Location(path))) from None
    except _INVALID_VALUES:
        message = "not well-formed YAML: a value does not have the type that its syntax implies"
        raise WorkspaceError(Problem(message, Location(path), "quote the value")) from None
    if value is None:
        return {}
    if not isinstance(value, dict):
        raise WorkspaceError(Problem("the file is not a mapping", Location(path)))
    return value


def read_toml(content: bytes | str, path: Path) -> dict[str, Any]:
    """Parse a TOML document; raises WorkspaceError if it is malformed."""
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib

    try:
        return tomllib.loads(_text(content, path))
    except RecursionError:
        raise WorkspaceError(Problem("not well-formed TOML: too deeply nested", Location(path))) from None
    except _INVALID_VALUES as error:  # includes TOMLDecodeError, a ValueError
        raise WorkspaceError(Problem(f"not well-formed TOML: {error}", Location(path))) from None


def _text(content: bytes | str, path: Path) -> str:
    """Return a file's text without byte order mark; raises WorkspaceError if it is not UTF-8."""
    if isinstance(content, str):
        return content
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise WorkspaceError(Problem("the text is not UTF-8", Location(path, line))) from None


def yaml_text(value: Mapping[str, object]) -> str:
    import yaml

    text: str = yaml.safe_dump(value, default_flow_style=False)
    return text
