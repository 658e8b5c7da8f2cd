"""What a CMakeLists.txt says about its project, as far as its text alone tells; nothing is run, pure."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

_NAME = r"""("?)([a-zA-Z0-9_-]+)\1"""
_COMMENT = re.compile(r"""("[^"\n]*")|#[^\n]*""")
_PROJECT = re.compile(rf"(?i:project)\s*\(\s*{_NAME}(\s+[^)]*)?\)")
_ANY_PROJECT = re.compile(r"(?i:\bproject)\s*\(")
# Wrappers, such as catkin_find_package, count as what they wrap.
_FIND_PACKAGE = re.compile(rf"(?i:find_package)\s*\(\s*{_NAME}(\s+[^)]*)?\)")
_PKG_CONFIG = re.compile(
    r"(?i:pkg_check_modules|pkg_search_module)\s*\(\s*(\"?)[a-zA-Z0-9_]+\1"
    r"(?:\s+(?:REQUIRED|QUIET|NO_CMAKE_PATH|NO_CMAKE_ENVIRONMENT_PATH))*([^)]+)\)"
)


def project_name(text: str) -> str | None:
    """Return the name that the first project() with a literal one gives, else None."""
    match = _PROJECT.search(_without_comments(text))
    return match[2] if match else None


def names_no_literal(text: str) -> bool:
    """Tell if there is a project() whose name is a variable or otherwise not to be read."""
    return _ANY_PROJECT.search(_without_comments(text)) is not None


def is_catkin_toplevel(text: str) -> bool:
    """Tell if this is the file that catkin_make puts above a source folder."""
    return project_name(text) == "Project" and "catkin_workspace()" in text.splitlines()


def cmake_dependencies(texts: Iterable[str]) -> frozenset[str]:
    """Return what find_package and pkg-config are asked for by a literal name."""
    content = "\n".join(map(_without_comments, texts))
    found = {match[2] for match in _FIND_PACKAGE.finditer(content)}
    for match in _PKG_CONFIG.finditer(content):
        found.update(re.split("[<>=]", module, maxsplit=1)[0] for module in match[2].split())
    return frozenset(filter(None, found))


def _without_comments(text: str) -> str:
    """Return the text up to its last ')': where one is still to come, no pattern looks for it in vain."""
    plain = _COMMENT.sub(lambda match: match[1] or "", text)
    return plain[: plain.rfind(")") + 1]
