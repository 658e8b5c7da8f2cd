"""Layouts of serialized messages."""

from collections.abc import Mapping

import pytest

from forge.interfaces.model import TypeName
from forge.interfaces.wire.layout import INLINE_LIMIT, START, LayoutBuilder, MessageLayout, Phase, Run
from tests.generated import catalog_of, embedded_catalog


def layout_of(definitions: Mapping[str, str], name: str = "X", start: Phase = START) -> MessageLayout:
    files = {f"msg/{stem}.msg": text for stem, text in definitions.items()}
    return LayoutBuilder(catalog_of("p", files).known).of(TypeName("p", "msg", name), start)


def test_a_message_of_large_messages_is_not_large_itself() -> None:
    large = "\n".join(f"string s{number}" for number in range(INLINE_LIMIT + 1))
    known = catalog_of("p", {"msg/Large.msg": large, "msg/X.msg": "Large a\nLarge b"}).known
    assert LayoutBuilder(known).is_large(TypeName("p", "msg", "Large"))
    assert not LayoutBuilder(known).is_large(TypeName("p", "msg", "X"))


@pytest.mark.parametrize(
    ("text", "size"),
    [
        ("", 1),
        ("int8 a\nint64 b", 9),
        ("string s", 4),
        ("string[3] s", 12),
        ("int32[] a", 4),
        ("int16[999] a", 1998),
    ],
)
def test_the_minimum_size_excludes_padding(text: str, size: int) -> None:
    assert layout_of({"X": text}).min_size == size


def test_every_embedded_message_has_a_layout_with_all_its_members_in_order() -> None:
    catalog = embedded_catalog("visualization_msgs")
    layouts = LayoutBuilder(catalog.known)
    for name, message in catalog.known.items():
        seen: dict[str, None] = {}
        for step in layouts.of(name).steps:
            paths = [m.path for m in step.members] if isinstance(step, Run) else [step.path]
            seen |= dict.fromkeys(path[0] for path in paths)
        assert list(seen) == [member.name for member in message.members]
