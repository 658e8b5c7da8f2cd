"""Rules for names: valid package names, snake case, suggestions."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable

_PACKAGE = re.compile(r"[a-zA-Z0-9][a-zA-Z0-9_-]*")
_WORD = re.compile(r"\w[\w.+-]{0,199}")
_EMAIL = re.compile(r"[-a-zA-Z0-9_%+]+(\.[-a-zA-Z0-9_%+]+)*@[-a-zA-Z0-9%]+(\.[-a-zA-Z0-9%]+)*\.[a-zA-Z]{2,}")
_LOWER_THEN_WORD = re.compile(r"(.)([A-Z][a-z]+)")
_LOWER_THEN_UPPER = re.compile(r"([a-z0-9])([A-Z])")

TYPE_NAME = re.compile(r"[A-Z][A-Za-z0-9]*")
"""Names of interfaces."""
LOWER_NAME = re.compile(r"(?!.*__)(?!.*_$)[a-z][a-z0-9_]*")
"""Names of fields, and of packages of interfaces."""

CPP_KEYWORDS = frozenset(
    """
    alignas alignof and and_eq asm auto bitand bitor bool break case catch char char16_t
    char32_t class compl const const_cast constexpr continue decltype default delete do double
    dynamic_cast else enum explicit export extern false float for friend goto if inline int long
    mutable namespace new noexcept not not_eq nullptr operator or or_eq private protected public
    register reinterpret_cast return short signed sizeof static static_assert static_cast struct
    switch template this thread_local throw true try typedef typeid typename union unsigned
    using virtual void volatile wchar_t while xor xor_eq
    """.split()
)
"""The keywords of C++17."""
CPP20_KEYWORDS = frozenset("char8_t co_await co_return co_yield concept consteval constinit requires".split())


def is_package_name(text: str) -> bool:
    """Return whether a text is a valid package name (REP 127, 140, 149)."""
    return _PACKAGE.fullmatch(text) is not None


def is_safe_name(text: str) -> bool:
    """Return whether a name is safe in paths, scripts and CMake, as all valid names of packages are."""
    return _WORD.fullmatch(text) is not None


def is_safe_relative_path(path: str) -> bool:
    """Return whether a relative path has no line break and, without looking at links, stays in its folder."""
    return bool(path) and path.isprintable() and not path.startswith("/") and ".." not in path.split("/")


def is_email(text: str) -> bool:
    """Return whether a manifest accepts a text as an email address."""
    return _EMAIL.fullmatch(text) is not None


def snake_case(name: str) -> str:
    """Return rosidl's file name for an interface: 'UInt8' gives 'u_int8', 'ColorRGBA' 'color_rgba'."""
    return _LOWER_THEN_UPPER.sub(r"\1_\2", _LOWER_THEN_WORD.sub(r"\1_\2", name)).lower()


def project_name(name: str) -> str:
    """Return the spelling by which names of Python projects are compared (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def python_attribute(name: str) -> str:
    """Return the name of a field in Python code: keywords end with '_' there (PEP 8)."""
    return f"{name}_" if keyword.iskeyword(name) else name


def nearest(name: str, known: Iterable[str], nearness: float = 0.6) -> str | None:
    """Return the most similar known name, or None; `nearness` is between 0 and 1."""
    import difflib

    near = difflib.get_close_matches(name, list(known), n=1, cutoff=nearness)
    return near[0] if near else None


def did_you_mean(name: str, known: Iterable[str], nearness: float = 0.6) -> str | None:
    near = nearest(name, known, nearness)
    return f"did you mean '{near}'?" if near else None
