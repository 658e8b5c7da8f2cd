"""MAKEFLAGS: what a make above us, or the user, says about jobs, and what we say to tools below; pure."""

from __future__ import annotations

import re

from forge.frozen import frozen

AUTH = "--jobserver-auth="
_FORMER_AUTH = "--jobserver-fds="
_LETTERS = re.compile(r"[A-Za-z]+(\d+(\.\d+)?)?")
_VALUE = {"--jobs": "j", "--load-average": "l", "--max-load": "l"}
_WHOLE = re.compile(r"[0-9]{1,9}")
_NUMBER = re.compile(r"\d+(\.\d+)?")


@frozen
class MakeFlags:
    """The words of MAKEFLAGS.

    `jobs` and `load` are None when nothing was said or no number; `auth` is the jobserver's address, either
    'R,W' (two descriptors) or 'fifo:PATH'. `rest` are all other words; make begins with its one-letter flags
    as a word without a dash, and variables come last, after '--'.
    """

    jobs: int | None = None
    load: float | None = None
    auth: str | None = None
    rest: tuple[str, ...] = ()

    def line(self, jobs: int | None = None, auth: str | None = None) -> str:
        """Return the text for tools below, which says of jobs only what is given here."""
        ours = [f"-j{jobs}"] if jobs else []
        ours += [AUTH + auth] if auth else []
        # make reads a first word without a dash as letters, whatever it is.
        first = 1 if self.rest and not self.rest[0].startswith("-") and "=" not in self.rest[0] else 0
        return " ".join((*self.rest[:first], *ours, *self.rest[first:]))


def read_make_flags(text: str) -> MakeFlags:
    """Return what MAKEFLAGS says; of what is said twice the last counts, as it does for make."""
    options, separator, variables = re.sub(r"^--\s", " -- ", text).partition(" -- ")
    words = options.split()
    said: dict[str, str] = {}
    rest: list[str] = []
    while words:
        word = words.pop(0)
        name, equals, value = word.partition("=")
        if word.startswith((AUTH, _FORMER_AUTH)):
            said["auth"] = value
        elif name in _VALUE:
            said[_VALUE[name]] = value if equals else _next_number(words)
        elif (short := _jobs_or_load(word, first=not rest)) is not None:
            others, letter, number = short
            said[letter] = number or _next_number(words)
            rest += [others] if others else []
        else:
            rest.append(word)
    if separator:
        rest += ["--", *variables.split()]
    return MakeFlags(_whole(said.get("j")), _number(said.get("l")), said.get("auth"), tuple(rest))


def _jobs_or_load(word: str, *, first: bool) -> tuple[str, str, str] | None:
    """Split '-kj8' into ('-k', 'j', '8'); None when the word says nothing of the kind."""
    dash = word.startswith("-") and not word.startswith("--")
    letters = word[1:] if dash else word
    if not (dash or first) or not _LETTERS.fullmatch(letters):
        return None
    found = re.fullmatch(r"([A-Za-z]*?)([jl])(\d+(?:\.\d+)?)?", letters)
    if not found:
        return None
    others, letter, number = found.groups()
    return (("-" if dash and others else "") + others, letter, number or "")


def _next_number(words: list[str]) -> str:
    return words.pop(0) if words and _NUMBER.fullmatch(words[0]) else ""


def _whole(text: str | None) -> int | None:
    """Return a number of jobs; '-j' alone means any number, which is none that we could keep to."""
    return int(text) if text and _WHOLE.fullmatch(text) and int(text) else None


def _number(text: str | None) -> float | None:
    return float(text) if text else None
