"""The end of every help text: two examples that work, and a page that exists."""

import argparse
import re
import shlex
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from forge.base.layout import docs_url
from forge.cli.main import help_endings, parser_of
from tests.reference import all_parsers

PARSERS = {f"forge {words}".strip(): parser for words, parser in all_parsers()}
EXAMPLES = help_endings()
NEED = "a command needs two examples and a page in templates/help/examples.txt"
WIDEST = 80


def test_every_command_has_examples() -> None:
    assert EXAMPLES.keys() == PARSERS.keys(), NEED


@pytest.mark.parametrize(("words", "parser"), PARSERS.items(), ids=PARSERS)
def test_the_help_ends_with_two_examples_and_a_url(words: str, parser: argparse.ArgumentParser) -> None:
    if words not in EXAMPLES:
        pytest.fail(NEED)
    end = parser.format_help().partition("\nexamples:\n")[2].splitlines()
    assert [line[:4] == "  # " for line in end] == [True, False, True, False, False, False]
    assert end[1] != end[3]
    assert re.fullmatch(r"documentation: file:///\S+\.md(#[a-z-]+)?", end[5])
    assert max(map(len, end[:4])) <= WIDEST


@pytest.mark.parametrize(
    ("words", "command"),
    [
        (words, line.strip())
        for words, (lines, _) in EXAMPLES.items()
        for line in lines.splitlines()
        if "  # " not in line
    ],
)
def test_examples_can_be_parsed(
    words: str, command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is of the command whose help it ends; for forge itself and a group of verbs, of one of them."""
    (tmp_path / "build").mkdir()
    monkeypatch.chdir(tmp_path)
    assert words in command
    typed = shlex.split(re.split(r" [|>]|\)", command.partition("$(")[2] or command)[0])
    assert typed[0] == "forge"
    parser_of(typed[1:]).parse_args(typed[1:])


@pytest.mark.parametrize("page", sorted({page for _, page in EXAMPLES.values()}))
def test_linked_sections_exist(page: str) -> None:
    url = urlsplit(docs_url(page))
    with open(unquote(url.path), encoding="utf-8") as file:  # noqa: PTH123  (a path of a URL)
        headings = re.findall(r"^#+ (.*)$", file.read(), re.MULTILINE)
    slugs = {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}
    assert not url.fragment or url.fragment in slugs


def test_example_urls_are_complete() -> None:
    assert re.fullmatch(r"[a-z]+://\S+/tutorial\.md", docs_url("tutorial.md"))
    assert PARSERS["forge run"].format_help().endswith(f"{docs_url('reference/commands.md')}#forge-run\n")
