"""The documentation's runner: a block that is not as told must be found."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.snippets import Command, blocks, commands, run

if TYPE_CHECKING:
    from tests.conftest import Tree

DOCUMENT = """# Title
```console
$ printf 'one\\ntwo\\nthree [1.5s]\\n'
one
three [...]
$ cd /
```
<!-- write: a.txt -->
```text
start
end
```
"""


def commands_of(text: str) -> tuple[Command, ...]:
    """Return the commands of a whole text."""
    return tuple(command for block in blocks(text) for command in commands(block))


def test_commands_and_what_they_print_are_told_apart() -> None:
    first, second, _ = commands_of(DOCUMENT)
    assert (first.line, first.expected) == (3, ("one", "three [...]"))
    assert (second.text, second.expected) == ("cd /", ())


def test_a_block_that_is_not_run_has_no_commands() -> None:
    assert commands_of("<!-- not run: no -->\n```console\n$ false\n```\n") == ()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("```console\n$ echo a\n$ false\n```\n", "case.md:3: false\nended with 1, not 0"),
        ("```console\n$ echo a\nb\n```\n", "did not print 'b', but:\na"),
        ("<!-- fails with 2 -->\n```console\n$ true\n```\n", "ended with 0, not 2"),
        ("```bash\nexit 3\n```\n", "ended with none, not 0"),
    ],
)
def test_what_is_not_as_told_is_named(tree: Tree, text: str, complaint: str) -> None:
    root = tree({"case.md": text, "in/x": ""})
    with pytest.raises(AssertionError) as caught:
        run(root / "case.md", root / "in")
    assert complaint in str(caught.value)


def test_files_are_written_where_the_marks_say(tree: Tree) -> None:
    marks = ("write: d/a", "append: d/a", "insert: d/a before: two")
    text = "".join(
        f"<!-- {mark} -->\n```text\n{body}```\n"
        for mark, body in zip(marks, ("one\n", "two\n", "1.5\n"), strict=True)
    )
    root = tree({"case.md": text + "```console\n$ cat d/a\none\n1.5\ntwo\n```\n", "in/x": ""})
    run(root / "case.md", root / "in")
    assert (root / "in/d/a").read_text(encoding="utf-8") == "one\n1.5\ntwo\n"
