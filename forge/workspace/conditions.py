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
_DEEPEST = 50


class ConditionError(ValueError):
    """An invalid condition; `column` counts from 1."""

    def __init__(self, message: str, column: int) -> None:
        super().__init__(message)
        self.column = column


def holds(condition: str, variables: Mapping[str, str]) -> bool:
    """Tell whether `condition` is true under `variables`; raises ConditionError if it is malformed."""
    tokens = _tokens(condition)[::-1]

    def expression(depth: int) -> bool:
        alternatives = [[atom(depth)]]
        while tokens[-1][:2] in {("word", "and"), ("word", "or")}:
            if tokens.pop()[1] == "or":
                alternatives.append([])
            alternatives[-1].append(atom(depth))
        return any(map(all, alternatives))

    def atom(depth: int) -> bool:
        kind, _, column = tokens[-1]
        if kind != "(":
            left = operand()
            compare = _COMPARISONS[take("comparison", "one of == != <= < >= >")]
            return compare(left, operand())
        if depth == _DEEPEST:
            raise ConditionError("too many nested parentheses", column)
        tokens.pop()
        value = expression(depth + 1)
        take(")", "a closing parenthesis")
        return value

    def operand() -> str:
        kind, text, column = tokens.pop()
        if kind == "quoted" or (kind == "word" and _WORD.fullmatch(text)):
            return text
        if kind == "word" and _VARIABLE.fullmatch(text):
            return variables.get(text[1:], "")
        raise ConditionError("expected a $VARIABLE, a word or a quoted string", column)

    def take(kind: str, description: str) -> str:
        found, text, column = tokens.pop()
        if found != kind:
            raise ConditionError(f"expected {description}", column)
        return text

    value = expression(0)
    take("end", "'and', 'or' or the end")
    return value


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
