"""Generates shell completion scripts for bash, zsh and fish.

The scripts contain options and fixed words; names, such as those of packages, are queried when completing.
"""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING

from forge.base.frozen import frozen
from forge.base.templating import render
from forge.cli.colcon_options import PASSED_ON

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

SHELLS = ("bash", "zsh", "fish")

PACKAGES, INSTALLED, RUNNABLE, INTERFACES, INTERFACE_PACKAGES = (
    *("packages", "installed", "runnable"),
    *("interfaces", "interface_packages"),
)
MIXINS, REPOSITORIES, PROFILES, WORDS, FOLDERS, FILES, ANYTHING = (
    *("mixins", "repositories", "profiles", "words"),
    *("folders", "files", "anything"),
)
"""Kinds of values: queried names, fixed words, and paths that shells complete themselves."""


@frozen
class Expected:
    """The value of an option or positional argument: its kind, whether it repeats, and words.

    These are the values themselves, or what completion_words.py needs besides the kind.
    """

    kind: str
    several: bool = False
    words: tuple[str, ...] = ()
    passed_on: bool = False
    """Whether the values are arguments of another program."""


@frozen
class CompletionOption:
    """An option with all its spellings; `expected` is None for flags."""

    flags: tuple[str, ...]
    summary: str
    expected: Expected | None = None


@frozen
class CompletionContext:
    """Completions after the words `path`: subcommands with summaries, options, positional values."""

    path: tuple[str, ...]
    words: tuple[tuple[str, str], ...] = ()
    options: tuple[CompletionOption, ...] = ()
    expected: Expected | None = None
    ends_list: frozenset[str] = frozenset()
    """The options that end a list of arguments for another program."""


def completion(shell: str, contexts: Sequence[CompletionContext], answer: Sequence[str]) -> str:
    """Return the script for a shell; `answer` is the command that prints names."""
    program = shlex.join(answer)
    if shell == "fish":
        return render(
            "completion/fish.j2",
            answer=program,
            lines=list(_fish(contexts)),
            paths=" ".join(_fish_quoted(" ".join(context.path)) for context in contexts if context.path),
            one=_valued(contexts, several=False),
            many=_valued(contexts, several=True),
            passed=" ".join(sorted(PASSED_ON)),
            ends=[
                _Row(_pattern(context), " ".join(sorted(context.ends_list)))
                for context in contexts
                if context.ends_list
            ],
        )
    return render(
        f"completion/{shell}.j2",
        answer=program,
        offers=[
            _Row(_pattern(context), " ".join(map(shlex.quote, _offered(context)))) for context in contexts
        ],
        words=[
            _Row(_pattern(context), "|".join(map(shlex.quote, (word for word, _ in context.words))))
            for context in contexts
            if context.words
        ],
        ends=[
            _Row(_pattern(context), "|".join(sorted(context.ends_list)))
            for context in contexts
            if context.ends_list
        ],
        values=[row for context in contexts for row in _values(context)],
        rest=[_Row(_pattern(context), _kind(context.expected)) for context in contexts if context.expected],
    )


@frozen
class _Row:
    """A branch of a shell `case`: its pattern and words."""

    pattern: str
    words: str


def _pattern(context: CompletionContext) -> str:
    return shlex.quote(" ".join(context.path))


def _offered(context: CompletionContext) -> Iterator[str]:
    """Yield words and options; short options only if they have no long spelling."""
    yield from (word for word, _ in context.words)
    for option in context.options:
        yield from [flag for flag in option.flags if flag.startswith("--")] or option.flags


def _values(context: CompletionContext) -> Iterator[_Row]:
    for option in context.options:
        if option.expected:
            pattern = "|".join(shlex.quote(" ".join((*context.path, flag))) for flag in option.flags)
            yield _Row(pattern, _kind(option.expected))


def _kind(expected: Expected) -> str:
    """Return the specification that the shell functions parse: one, many or passed, the kind, and words."""
    number = "passed" if expected.passed_on else "many" if expected.several else "one"
    return shlex.quote(" ".join((number, expected.kind, *expected.words)))


def _valued(contexts: Sequence[CompletionContext], *, several: bool) -> str:
    options = [option for context in contexts for option in context.options]
    found = (option for option in options if option.expected and option.expected.several is several)
    return " ".join(sorted({flag for option in found for flag in option.flags}))


def _fish(contexts: Sequence[CompletionContext]) -> Iterator[str]:
    """Yield a `complete` line for each word, option and value."""
    for context in contexts:
        where = _fish_quoted(" ".join(context.path))
        at = f"complete -c forge -n {_fish_quoted(f'__forge_at {where}')}"
        for word, summary in context.words:
            yield f"{at} -f -a {_fish_quoted(word)} -d {_fish_quoted(summary)}"
        for option in context.options:
            spellings = " ".join(map(_fish_flag, option.flags))
            follows = f" {_fish_expected(option.expected)}" if option.expected else " -f"
            ends_list = not context.ends_list or not context.ends_list.isdisjoint(option.flags)
            condition = _fish_quoted(f"{'__forge_at' if ends_list else '__forge_outside'} {where}")
            described = f"{follows} -d {_fish_quoted(option.summary)}"
            yield f"complete -c forge -n {condition} {spellings}{described}"
            if option.expected and option.expected.several:
                after = f"__forge_after {where} {' '.join(option.flags)}"
                yield f"complete -c forge -n {_fish_quoted(after)} {_fish_expected(option.expected)}"
        if context.expected:
            yield f"{at} {_fish_expected(context.expected)}"


def _fish_flag(flag: str) -> str:
    return f"-l {flag[2:]}" if flag.startswith("--") else f"-s {flag[1:]}"


_QUERIED = frozenset(
    {PACKAGES, INSTALLED, RUNNABLE, INTERFACES, INTERFACE_PACKAGES, MIXINS, REPOSITORIES, PROFILES}
)


def _fish_expected(expected: Expected) -> str:
    match expected.kind:
        case kind if kind in _QUERIED:
            return f"-x -a '(__forge_list_names {' '.join((expected.kind, *expected.words))})'"
        case "words":
            return f"-x -a {_fish_quoted(' '.join(expected.words))}"
        case "folders":
            return "-x -a '(__fish_complete_directories)'"
        case "files":
            return "-r -F"
        case _:
            return "-x"


def _fish_quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace("'", "\\'")
    return f"'{escaped}'"
