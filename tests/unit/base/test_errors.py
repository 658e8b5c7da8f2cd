"""Problems of one kind in many packages are grouped."""

import pytest

from forge.base.errors import GroupedProblems, Problem, WarningReporter, joined


def outdated(name: str) -> Problem:
    kind = GroupedProblems("{} are outdated", name, "update all")
    return Problem(f"'{name}' is outdated", hint=f"update {name}", group=kind)


def test_many_similar_problems_are_grouped_under_the_first() -> None:
    other = Problem("unrelated")
    found = joined([other, *map(outdated, "dbca"), other, Problem("last")])
    every = Problem("'a', 'b', 'c', 'd' are outdated", hint="update all")
    assert found == [other, other, every, Problem("last")]


def test_a_few_similar_problems_are_reported_one_by_one() -> None:
    few = [outdated("a"), outdated("b"), outdated("c")]
    assert joined(few) == few
    assert joined([*few, outdated("a")]) == [*few, outdated("a")], "names are counted once"


def test_watch_mode_groups_only_new_problems(capsys: pytest.CaptureFixture[str]) -> None:
    warn = WarningReporter()
    warn(map(outdated, "abcd"))
    assert capsys.readouterr().err == "warning: 'a', 'b', 'c', 'd' are outdated\nhint: update all\n"
    warn.start_next_build()
    warn(map(outdated, "abcde"))
    assert capsys.readouterr().err == "warning: 'e' is outdated\nhint: update e\n"
