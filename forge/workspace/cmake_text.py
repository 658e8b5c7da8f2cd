"""Reads the commands of a CMake file from its text, without running it.

Comments, strings and bracket arguments are told apart by CMake's grammar. Variables, loops and conditions are
not evaluated, so that the commands of a text are advice: CMake may run each of them, or none.
"""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING

from forge.base.frozen import frozen

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

_GAP = re.compile(r"[ \t\r\n\f\v;\ufeff]*")
_LINE_COMMENT = re.compile(r"#[^\n]*")
_BRACKET = re.compile(r"\[(=*)\[")
_STRING = re.compile(r'"((?:[^"\\]|\\.)*)"', re.DOTALL)
_WORD = re.compile(r'(?:[^\s()#"\\;]|\\.)+(?:"(?:[^"\\]|\\.)*"(?:[^\s()#"\\;]|\\.)*)*', re.DOTALL)
_OPENING = frozenset({"block", "elseif", "else", "foreach", "function", "if", "macro", "while"})
_CLOSING = frozenset(
    {"elseif", "else", "endblock", "endforeach", "endfunction", "endif", "endmacro", "endwhile"}
)


@frozen
class Call:
    """A call of a command: its lower-case name, arguments, line, and the blocks around it.

    `conditions` are the arguments of the if(), loop, function or macro of each block.
    """

    command: str
    words: tuple[str, ...]
    line: int
    conditions: tuple[str, ...] = ()


def calls(text: str) -> Iterator[Call]:
    """Yield the calls in order, up to the first text that CMake cannot parse."""
    conditions: list[str] = []
    command, words, depth = "", [], 0
    line, counted, start = 1, 0, 0
    for kind, word, at in _tokens(text):
        if depth:
            depth += {"(": 1, ")": -1}.get(kind, 0)
            if depth:
                words.append(word)
                continue
            line += text.count("\n", counted, start)
            counted = start
            if command in _CLOSING and conditions:
                conditions.pop()
            yield Call(command, tuple(words), line, tuple(conditions))
            if command in _OPENING:
                conditions.append(" ".join(words))
            command = ""
        elif kind == "(" and command:
            words, depth = [], 1
        elif kind == "word" and not command:
            command, start = word.lower(), at
        else:
            return


def cmake_files(folder: Path) -> Iterator[str]:
    """Yield the paths of all CMakeLists.txt and .cmake files below a folder."""
    for place, _, names in os.walk(folder):
        for name in sorted(names):
            if name == "CMakeLists.txt" or name.endswith(".cmake"):
                yield f"{place}/{name}"


def _tokens(text: str) -> Iterator[tuple[str, str, int]]:
    """Yield kind, text and position: of words, of strings without their quotes, and of parentheses."""
    at = 0
    while (at := _gap(text, at)) < len(text):
        if text[at] in "()":
            yield text[at], text[at], at
            at += 1
        elif bracket := _BRACKET.match(text, at):
            end = text.find(f"]{bracket[1]}]", bracket.end())
            if end < 0:
                return
            yield "string", text[bracket.end() : end], at
            at = end + len(bracket[0])
        elif found := _STRING.match(text, at):
            yield "string", found[1], at
            at = found.end()
        elif found := _WORD.match(text, at):
            yield "word", found[0], at
            at = found.end()
        else:
            return


def _gap(text: str, at: int) -> int:
    """Return the position after blanks and comments, the end of the text in an unterminated comment."""
    while True:
        gap = _GAP.match(text, at)
        at = gap.end() if gap else at
        if not text.startswith("#", at):
            return at
        if bracket := _BRACKET.match(text, at + 1):
            end = text.find(f"]{bracket[1]}]", bracket.end())
            at = end + len(bracket[0]) if end >= 0 else len(text)
        elif found := _LINE_COMMENT.match(text, at):
            at = found.end()
