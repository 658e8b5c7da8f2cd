"""Conditions of package.xml format 3: `$ROS_VERSION == 2 and $ROS_DISTRO != "foxy"` (REP 149).

    expression := conjunction ('or' conjunction)*
    conjunction := atom ('and' atom)*
    atom       := '(' expression ')' | operand ('==' | '!=' | '<=' | '<' | '>=' | '>') operand
    operand    := $NAME | bare word | "quoted" | 'quoted'

Values are compared as strings; an unset variable is an empty string.
"""

from __future__ import annotations

import operator
import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

_TOKEN = re.compile(r"""\s*(?:(\()|(\))|(==|!=|<=|>=|<|>)|(\$?[\w-]+)|"([^"]*)"|'([^']*)')""", re.ASCII)
_COMPARISONS: dict[str, Callable[[str, str], bool]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<=": operator.le,
    "<": operator.lt,
    ">=": operator.ge,
    ">": operator.gt,
}
_WORD = re.compile(r"[A-Za-z0-9_-]+")
_VARIABLE = re.compile(r"\$[A-Za-z0-9_]+")


class ConditionError(ValueError):
    """An invalid condition; `column` counts from 1."""

    def __init__(self, message: str, column: int) -> None:
        super().__init__(message)
        self.column = column


def holds(condition: str, variables: Mapping[str, str]) -> bool:
    """Tell whether `condition` is true under `variables`; raises ConditionError if it is malformed."""
    reader = _Reader(condition, variables)
    value = reader.expression()
    reader.expect_end()
    return value


class _Reader:
    """A recursive descent parser; both sides of a connective are always parsed."""

    def __init__(self, text: str, variables: Mapping[str, str]) -> None:
        self.variables = variables
        self.tokens = _tokens(text)
        self.at = 0
        self.depth = 0

    def expression(self) -> bool:
        value = self.conjunction()
        while self.accept("or"):
            right = self.conjunction()
            value = value or right
        return value

    def conjunction(self) -> bool:
        value = self.atom()
        while self.accept("and"):
            right = self.atom()
            value = value and right
        return value

    def atom(self) -> bool:
        kind, _, column = self.tokens[self.at]
        if kind == "(":
            self.depth += 1
            if self.depth > 50:
                raise ConditionError("too many nested parentheses", column)
            self.at += 1
            value = self.expression()
            self.take(")", "a closing parenthesis")
            self.depth -= 1
            return value
        left = self.operand()
        compare = _COMPARISONS[self.take("comparison", "one of == != <= < >= >")]
        return compare(left, self.operand())

    def operand(self) -> str:
        kind, text, column = self.tokens[self.at]
        self.at += 1
        if kind == "quoted":
            return text
        if kind == "word" and _VARIABLE.fullmatch(text):
            return self.variables.get(text[1:], "")
        if kind == "word" and _WORD.fullmatch(text):
            return text
        raise ConditionError("expected a $VARIABLE, a word or a quoted string", column)

    def accept(self, word: str) -> bool:
        kind, text, _ = self.tokens[self.at]
        if kind == "word" and text == word:
            self.at += 1
            return True
        return False

    def take(self, kind: str, description: str) -> str:
        found, text, column = self.tokens[self.at]
        if found != kind:
            raise ConditionError(f"expected {description}", column)
        self.at += 1
        return text

    def expect_end(self) -> None:
        kind, _, column = self.tokens[self.at]
        if kind != "end":
            raise ConditionError("expected 'and', 'or' or the end", column)


def _tokens(text: str) -> list[tuple[str, str, int]]:
    """Return (kind, text, column) of each token, with a final 'end'."""
    found: list[tuple[str, str, int]] = []
    at = 0
    end = len(text.rstrip())
    while at < end:
        match = _TOKEN.match(text, at)
        if match is None:
            rest = text[at:].lstrip()
            raise ConditionError(f"unexpected {rest[:20].rstrip()!r}", len(text) - len(rest) + 1)
        column = match.start(match.lastindex or 0) + 1
        kind = ("(", ")", "comparison", "word", "quoted", "quoted")[(match.lastindex or 1) - 1]
        value = match.group(match.lastindex or 0)
        found.append((kind, value, column))
        at = match.end()
    found.append(("end", "", len(text) + 1))
    return found
