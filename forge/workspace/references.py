"""Finds variables, programs and packages outside of the workspace that build scripts refer to.

Texts are searched, not executed: computed names such as `$ENV{${name}}` are not found. False positives are
harmless: unset variables and unknown programs are not compared.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

LISTS = "CMakeLists.txt"

_NOBODY: frozenset[str] = frozenset()


@frozen
class References:
    """The references of a text.

    `words` are potential programs: bare words and absolute paths. `included` are other build scripts and
    folders as written; `scripts` are names of scripts that may run. The `exported` variables,
    packages and words also apply to dependents of the package.
    """

    variables: frozenset[str] = _NOBODY
    packages: frozenset[str] = _NOBODY
    words: frozenset[str] = _NOBODY
    scripts: frozenset[str] = _NOBODY
    included: frozenset[str] = _NOBODY
    exported: frozenset[str] = _NOBODY
    exported_packages: frozenset[str] = _NOBODY
    exported_words: frozenset[str] = _NOBODY

    def __or__(self, other: References) -> References:
        return References(
            self.variables | other.variables,
            self.packages | other.packages,
            self.words | other.words,
            self.scripts | other.scripts,
            self.included | other.included,
            self.exported | other.exported,
            self.exported_packages | other.exported_packages,
            self.exported_words | other.exported_words,
        )


def reader_of(name: str, *, top: bool) -> Callable[[str], References] | None:
    """Return the function to search a file that each build of a package may run, else None.

    `top` tells whether the file is directly in the package's folder.
    """
    if name == LISTS:
        return in_lists
    if name.endswith((".cmake", ".cmake.in")):
        return in_module
    if name.startswith(("Makefile", "makefile", "GNUmakefile")) or name.endswith(".mk"):
        return in_shell
    if top and name.endswith(".py"):
        return in_python
    return in_settings if top and name in {"setup.cfg", "pyproject.toml"} else None


def reader_of_script(name: str) -> Callable[[str], References] | None:
    """Return the function to search a script that another text refers to, else None."""
    return in_python if name.endswith(".py") else in_shell if _SCRIPT.fullmatch(name) else None


def in_lists(text: str) -> References:
    """Return the references of a CMakeLists.txt, including those in embedded shell commands."""
    packages = frozenset(_PACKAGE.findall(text))
    exports = (words.split() for words in _EXPORTED.findall(text))
    exported = frozenset(word for words in exports for word in words)
    return References(
        variables=_first_groups(_ENV, text) | _first_groups(_SHELL_IN_CMAKE, text),
        packages=packages | exported,
        words=frozenset(_words(_without_comments(text))),
        scripts=frozenset(_SCRIPT.findall(text)),
        included=frozenset(_INCLUDED.findall(text)),
        exported=_first_groups(_ESCAPED, text),
        exported_packages=exported,
    )


def in_module(text: str) -> References:
    """Return the references of a CMake file that may be installed and included by others."""
    found = in_lists(text)
    return found | References(
        exported=found.variables, exported_packages=found.packages, exported_words=found.words
    )


def in_find_module(text: str) -> References:
    """Return the references of a CMake find module; programs only from find_program."""
    calls = " ".join(_PROGRAM.findall(text))
    return References(variables=_first_groups(_ENV, text), words=frozenset(_words(calls)))


def in_python(text: str) -> References:
    """Return the references of a Python script; programs only if it starts any."""
    variables = _NOBODY
    if "environ" in text or "getenv" in text:
        variables = _first_groups(_PYTHON_ENV, text) | frozenset(_CAPITALS.findall(text))
    literals = (literal for _, literal in _LITERAL.findall(text)) if _STARTS_PROGRAMS.search(text) else ()
    words = frozenset(word for literal in literals for word in _words(literal))
    return References(variables=variables, words=words, scripts=frozenset(_SCRIPT.findall(text)))


def in_settings(text: str) -> References:
    """Return the references of setup.cfg or pyproject.toml, such as hatch's '{env:NAME}'."""
    return References(variables=frozenset(_CONTEXT.findall(text)), scripts=frozenset(_SCRIPT.findall(text)))


def in_shell(text: str) -> References:
    return References(
        variables=_first_groups(_SHELL, text),
        words=frozenset(_words(_without_comments(text))),
        scripts=frozenset(_SCRIPT.findall(text)),
    )


_ENV = re.compile(r"\bENV\s*\{\s*([A-Za-z_]\w*)|\bENV\s+([A-Za-z_]\w*)|\bprintenv\s+([A-Za-z_]\w*)")
_ESCAPED = re.compile(r"\\\$ENV\{([A-Za-z_]\w*)")
_SHELL_IN_CMAKE = re.compile(r"\$\$?([A-Za-z_]\w*)(?![\w{])|(?:\\\$|\$\$)\{([A-Za-z_]\w*)")
_PACKAGE = re.compile(
    r"\b(?:find_package|find_dependency|pkg_check_modules|pkg_search_module)\s*\(\s*([A-Za-z0-9_][\w.+-]*)",
    re.IGNORECASE,
)
_EXPORTED = re.compile(r"\bament_export_dependencies\s*\(([^()$]*)\)", re.IGNORECASE)
_INCLUDED = re.compile(r"\b(?:include|add_subdirectory)\s*\(\s*\"?([^\s\"()]+)", re.IGNORECASE)
_PROGRAM = re.compile(r"\bfind_program\s*\(([^()]*)\)", re.IGNORECASE)
_SCRIPT = re.compile(r"[\w+-][\w.+-]*\.(?:sh|bash|py|pl|awk|mk)\b")
_COMMENT = re.compile(r"#\[(=*)\[.*?\]\1\]|^[ \t]*#[^\n]*|[ \t]#[ \t][^\n\"'`]*$", re.DOTALL | re.MULTILINE)
_TOKEN = re.compile(r"""([^\s"'`()<>|;&=,:]+)(\s*\()?""")
_BARE = re.compile(r"[A-Za-z0-9_][\w.+-]*|/[^$@{}\\]+")
_PYTHON_ENV = re.compile(
    r"environb?\s*\[\s*[bru]*['\"](\w+)"
    r"|environb?\s*\.\s*\w+\s*\(\s*[bru]*['\"](\w+)"
    r"|getenvb?\s*\(\s*[bru]*['\"](\w+)"
    r"|['\"](\w+)['\"]\s+(?:not\s+)?in\s+(?:os\s*\.\s*)?environ"
)
_CAPITALS = re.compile(r"['\"]([A-Z][A-Z0-9_]+)['\"]")
"""Names looked up through an alias, as after `env = os.environ`."""
_LITERAL = re.compile(r"(['\"])((?:\\.|(?!\1)[^\\\n])*)\1")
_STARTS_PROGRAMS = re.compile(r"subprocess|system|popen|spawn|exec|which", re.IGNORECASE)
_CONTEXT = re.compile(r"\{env:(\w+)")
_SHELL = re.compile(r"\$[({]?([A-Za-z_]\w*)|\bENV\{([A-Za-z_]\w*)")


def _first_groups(pattern: re.Pattern[str], text: str) -> frozenset[str]:
    return frozenset(match.group(match.lastindex) for match in pattern.finditer(text) if match.lastindex)


def _without_comments(text: str) -> str:
    """Return the text without comments; a '#' within quotes may be part of a command."""
    return _COMMENT.sub(" ", text)


def _words(text: str) -> Iterator[str]:
    """Yield potential names or paths of programs, except CMake commands."""
    for token, call in _TOKEN.findall(text):
        word = token.rstrip("\\")
        if not call and _BARE.fullmatch(word):
            yield word
