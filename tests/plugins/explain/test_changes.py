"""Changes of forge and of options are named."""

from forge.build.up_to_date import COMMON_OPTIONS
from forge.plugins.explain.changes import changed_options, forge_change


def test_another_version_or_interpreter_of_forge_is_named() -> None:
    assert forge_change("2\nx\n3.11\n/f", "1\nx\n3.11\n/f") == "forge changed from version 1 to 2"
    moved = "forge now runs in '/g' with Python 3.12, not in '/f' with Python 3.11"
    assert forge_change("1\nx\n3.12\n/g", "1\nx\n3.11\n/f") == moved
    assert forge_change("1\ny\n3.11\n/f", "1\nx\n3.11\n/f") == "forge itself changed"


def test_options_are_named_with_their_old_and_new_value() -> None:
    def change(now: str, then: str) -> str:
        return changed_options((*COMMON_OPTIONS, now), (*COMMON_OPTIONS, then)).text

    assert change("-DA=2", "-DA=1") == "the option '-DA=1' changed to '-DA=2'"
    assert change("-DB=1", "-DA=1") == "the option '-DB=1' was added"
    assert change("the recipe 'x' 1", "the recipe 'x' 2") == "the recipe 'x' changed"
