"""Layouts of serialized messages, compared with a walk over the definitions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.interfaces.model import Array, Named, Primitive, Sequence, String, TypeName
from forge.interfaces.wire.flattening import INLINE_LIMIT, RUN_ARRAY_LIMIT, LayoutBuilder
from forge.interfaces.wire.layout import (
    SIZES,
    START,
    UNKNOWN,
    InlineArray,
    Length,
    Loop,
    MessageCall,
    Phase,
    PrimitiveElements,
    Run,
    Scalar,
    StringData,
)
from tests.generated import catalog_of, embedded_catalog

if TYPE_CHECKING:
    from collections.abc import Mapping

    from forge.interfaces.wire.layout import LayoutStep, MessageLayout

PHASES = st.builds(
    lambda modulus, remainder: Phase(modulus, remainder % modulus),
    st.sampled_from([1, 2, 4, 8]),
    st.integers(0, 7),
)
ALIGNMENTS = st.sampled_from([1, 2, 4, 8])
OFFSETS = st.integers(0, 1000)


def layout_of(definitions: Mapping[str, str], name: str = "X", start: Phase = START) -> MessageLayout:
    """Return the layout of a message of the package 'p'."""
    files = {f"msg/{stem}.msg": text for stem, text in definitions.items()}
    return LayoutBuilder(catalog_of("p", files).known).of(TypeName("p", "msg", name), start)


def steps_of(text: str) -> tuple[LayoutStep, ...]:
    return layout_of({"X": text}).steps


def _holds(phase: Phase, offset: int) -> bool:
    return offset % phase.modulus == phase.remainder


@given(PHASES, OFFSETS, ALIGNMENTS, st.integers(0, 20))
def test_a_phase_says_nothing_wrong(phase: Phase, offset: int, alignment: int, count: int) -> None:
    offset = offset * phase.modulus + phase.remainder
    aligned = offset + -offset % alignment
    assert _holds(phase.aligned(alignment), aligned)
    assert _holds(phase.after(count), offset + count)
    assert phase.padding(alignment) in {None, aligned - offset}


@given(PHASES, PHASES, OFFSETS)
def test_a_join_is_valid_for_both_phases(one: Phase, other: Phase, number: int) -> None:
    joined = one.join(other)
    for phase in (one, other):
        assert _holds(joined, number * phase.modulus + phase.remainder)
    assert joined == other.join(one)
    assert one.join(one) == one


def test_neighbours_of_fixed_size_are_one_run() -> None:
    (run,) = steps_of("uint8 a\nint64 b\nuint8 c\nint32 d\nuint8 e\nint16 f")
    assert isinstance(run, Run)
    (segment,) = run.segments
    assert (segment.alignment, segment.paddings, segment.size) == (1, (0, 7, 0, 3, 0, 1), 28)


def test_nested_messages_are_unfolded_into_the_run_around_them() -> None:
    layout = layout_of({"X": "uint8 p\nInner i\nuint8 q", "Inner": "uint8 a\nfloat64 b"})
    (run,) = layout.steps
    assert isinstance(run, Run)
    assert [member.path for member in run.members] == [("p",), ("i", "a"), ("i", "b"), ("q",)]
    assert [(inner.path, inner.name.name) for inner in layout.inlined] == [(("i",), "Inner")]


def test_lengths_belong_to_the_run_before() -> None:
    assert steps_of("int8 a\nstring s\nint8 b") == (
        Run((Scalar(("a",), Primitive("int8")), Length(("s",), String())), START),
        StringData(("s",), String(), START),
        Run((Scalar(("b",), Primitive("int8")),), UNKNOWN),
    )


def test_after_a_string_nothing_is_known_and_after_a_wstring_the_alignment_of_a_unit() -> None:
    assert layout_of({"X": "string s"}).end == UNKNOWN
    assert layout_of({"X": "wstring s"}).end == Phase(4, 0)


@pytest.mark.parametrize(
    ("type_", "end"),
    [("uint8[]", UNKNOWN), ("int16[]", Phase(2, 0)), ("float32[]", Phase(4, 0)), ("float64[]", Phase(4, 0))],
)
def test_a_sequence_may_be_empty_and_then_has_no_padding(type_: str, end: Phase) -> None:
    assert layout_of({"X": f"{type_} a"}).end == end


def test_a_run_is_cut_where_its_padding_depends_on_the_message() -> None:
    run = steps_of("string s\nuint8 a\nint32 b\nint16 c\nfloat64 d")[-1]
    assert isinstance(run, Run)
    assert [(p.alignment, [m.path for m in p.members], p.paddings) for p in run.segments] == [
        (1, [("a",)], (0,)),
        (4, [("b",), ("c",)], (0, 0)),
        (8, [("d",)], (0,)),
    ]
    assert not run.is_fixed(UNKNOWN)
    assert run.is_fixed(START)


def test_small_arrays_are_part_of_a_run_and_large_ones_stand_alone() -> None:
    (small,) = steps_of(f"uint8[{RUN_ARRAY_LIMIT}] a")
    assert small == Run(
        (InlineArray(("a",), Array(Primitive("uint8"), RUN_ARRAY_LIMIT), Primitive("uint8")),), START
    )
    (large,) = steps_of(f"uint8[{RUN_ARRAY_LIMIT + 1}] a")
    assert large == PrimitiveElements(
        ("a",), Array(Primitive("uint8"), RUN_ARRAY_LIMIT + 1), Primitive("uint8"), START
    )


def test_a_loop_starts_with_what_holds_for_its_first_element_and_all_others() -> None:
    layout = layout_of({"X": "Inner[] s", "Inner": "uint8 a\nfloat64 b"})
    (_, loop) = layout.steps
    assert isinstance(loop, Loop)
    assert (loop.start, loop.body.start, loop.body.end) == (Phase(8, 4), Phase(4, 0), START)
    assert layout.end == Phase(4, 0)


def test_strings_of_a_collection_are_a_loop_over_nameless_texts() -> None:
    (loop,) = steps_of("string[2] s")
    assert isinstance(loop, Loop)
    assert loop.body.steps == (Run((Length((), String()),), UNKNOWN), StringData((), String(), Phase(4, 0)))


def test_an_empty_message_is_one_hidden_byte_but_a_field_of_that_name_is_a_field() -> None:
    (run,) = layout_of({"X": "Nothing n", "Nothing": ""}).steps
    assert isinstance(run, Run)
    (value,) = run.members
    assert value == Scalar(("n", "structure_needs_at_least_one_member"), Primitive("uint8"), hidden=True)


def test_a_large_message_is_shared_by_those_around_it_and_unfolded_by_itself() -> None:
    large = "\n".join(f"string s{number}\nint8 n{number}" for number in range(INLINE_LIMIT))
    definitions = {"X": "int8 a\nLarge large\nint8 b", "Large": large}
    name = TypeName("p", "msg", "Large")
    assert layout_of(definitions).steps[1] == MessageCall(("large",), name, Phase(8, 1))
    assert len(layout_of(definitions, "Large").steps) > INLINE_LIMIT


def test_a_message_of_many_large_ones_is_not_large_itself() -> None:
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


def test_sequences_of_named_types_refer_to_them() -> None:
    (_, loop) = layout_of({"X": "Inner[<=3] s", "Inner": "int8 a"}).steps
    assert isinstance(loop, Loop)
    assert loop.type == Sequence(Named(TypeName("p", "msg", "Inner")), 3)
    assert loop.body.min_size == SIZES["int8"]
