"""Parse the MAKEFLAGS of a parent make or the user, and format them for child tools; pure."""

from __future__ import annotations

import re

from forge.base.frozen import frozen

AUTH = "--jobserver-auth="
_FORMER_AUTH = "--jobserver-fds="
_LETTERS = re.compile(r"[A-Za-z]+(\d+(\.\d+)?)?")
_VALUE = {"--jobs": "j", "--load-average": "l", "--max-load": "l"}
_WHOLE = re.compile(r"[0-9]{1,9}")
_NUMBER = re.compile(r"\d+(\.\d+)?")


@frozen
class MakeFlags:
    """The parsed flags of MAKEFLAGS.

    `jobs` and `load` are None if absent or not a number; `auth` is the jobserver's address, either 'R,W' (two
    descriptors) or 'fifo:PATH'. `rest` are all other flags: make writes its one-letter flags first, without a
    dash, and variables last, after '--'.
    """

    jobs: int | None = None
    load: float | None = None
    auth: str | None = None
    rest: tuple[str, ...] = ()

    def line(self, jobs: int | None = None, auth: str | None = None) -> str:
        """Return the MAKEFLAGS value for child tools, with only these job settings."""
        own = [f"-j{jobs}"] if jobs else []
        own += [AUTH + auth] if auth else []
        # make interprets a first word without a dash as one-letter flags.
        first = 1 if self.rest and not self.rest[0].startswith("-") and "=" not in self.rest[0] else 0
        return " ".join((*self.rest[:first], *own, *self.rest[first:]))


def read_make_flags(text: str) -> MakeFlags:
    """Parse MAKEFLAGS; the last of repeated flags wins, as in make."""
    options, separator, variables = re.sub(r"^--\s", " -- ", text).partition(" -- ")
    flags = options.split()
    values: dict[str, str] = {}
    rest: list[str] = []
    while flags:
        flag = flags.pop(0)
        name, equals, value = flag.partition("=")
        if flag.startswith((AUTH, _FORMER_AUTH)):
            values["auth"] = value
        elif name in _VALUE:
            values[_VALUE[name]] = value if equals else _next_number(flags)
        elif (match := _jobs_or_load(flag, first=not rest)) is not None:
            letters, letter, number = match
            values[letter] = number or _next_number(flags)
            rest += [letters] if letters else []
        else:
            rest.append(flag)
    rest = [word for flag in rest if (word := _without_pretence(flag))]
    if separator:
        rest += ["--", *variables.split()]
    count, load = values.get("j", ""), values.get("l")
    # '-j' alone means unlimited.
    jobs = int(count) or None if _WHOLE.fullmatch(count) else None
    return MakeFlags(jobs, float(load) if load else None, values.get("auth"), tuple(rest))


def _jobs_or_load(flag: str, *, first: bool) -> tuple[str, str, str] | None:
    """Split '-kj8' into ('-k', 'j', '8'); return None if the flag contains neither j nor l."""
    dash = flag.startswith("-") and not flag.startswith("--")
    letters = flag[1:] if dash else flag
    if not (dash or first) or not _LETTERS.fullmatch(letters):
        return None
    match = re.fullmatch(r"([A-Za-z]*?)([jl])(\d+(?:\.\d+)?)?", letters)
    if not match:
        return None
    letters, letter, number = match.groups()
    return (("-" if dash and letters else "") + letters, letter, number or "")


def _without_pretence(flag: str) -> str:
    """Return a flag without -n, -q and -t, with which make does not build its targets."""
    if flag in {"--dry-run", "--just-print", "--recon", "--question", "--touch"}:
        return ""
    if flag.startswith("--") or not _LETTERS.fullmatch(flag.removeprefix("-")):
        return flag
    return re.sub("[nqt]", "", flag).removesuffix("-")


def _next_number(flags: list[str]) -> str:
    return flags.pop(0) if flags and _NUMBER.fullmatch(flags[0]) else ""
