"""ActionResult messages, compared with the protobuf package."""

import os

import pytest
from google.protobuf.message import DecodeError
from hypothesis import example, given
from hypothesis import strategies as st

from forge.cache.model import ActionResult, Digest, OutputFile
from forge.plugins.remote_cache import action_result
from forge.plugins.remote_cache.action_result import decode, encode
from tests.actions import USED, WHOLE, as_message, as_result, is_storable, message_class

Used, Whole = message_class(USED), message_class(WHOLE)

HASH = "0123456789abcdef" * 4
EMPTY = ActionResult()

_TEXTS = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1, max_size=20)
_PATHS = _TEXTS.filter(lambda text: not text.startswith("/") and ".." not in text.split("/"))
_DIGESTS = st.builds(
    Digest,
    st.binary(min_size=32, max_size=32).map(bytes.hex),
    st.integers(0, 2**63 - 1) | st.integers(0, 300),
)
RESULTS = st.builds(ActionResult, st.lists(st.builds(OutputFile, _PATHS, _DIGESTS)).map(tuple), st.binary())


@given(RESULTS)
@example(EMPTY)
def test_messages_are_encoded_as_by_protobuf(result: ActionResult) -> None:
    assert encode(result) == as_message(result, Used).SerializeToString(deterministic=True)


@given(RESULTS, st.binary(), st.lists(_TEXTS))
def test_unknown_fields_are_skipped(result: ActionResult, junk: bytes, texts: list[str]) -> None:
    message = as_message(result, Whole)
    message.stderr_raw = junk
    message.stdout_digest.hash = "any"
    message.execution_metadata.worker = "10.0.0.1"
    for text in texts:
        message.output_directories.add(path=text).tree_digest.size_bytes = -1
        message.output_symlinks.add(path=text, target=text)
    for file in message.output_files:
        file.contents = junk
        file.is_executable = True
    assert decode(message.SerializeToString()) == result


@given(RESULTS)
def test_bazel_remote_accepts_the_message(result: ActionResult) -> None:
    assert is_storable(Whole.FromString(encode(result)))


def _varint(value: int) -> bytes:
    return b"".join(
        bytes([value >> shift & 0x7F | (0x80 if value >> shift + 7 else 0)])
        for shift in range(0, max(value.bit_length(), 1), 7)
    )


_FIELDS = st.recursive(
    st.builds(
        lambda number, kind, value, data: (
            _varint(number << 3 | kind)
            + {0: _varint(value), 1: data[:8], 2: _varint(len(data)) + data, 5: data[:4]}.get(kind, b"")
        ),
        st.integers(0, 7) | st.integers(0, 2**29 + 1),
        st.integers(0, 7),
        st.integers(0, 300) | st.integers(0, 2**70),
        st.binary(max_size=9) | st.just(HASH.encode()) | st.just(b"12345678"),
    )
    | st.just(b"\n\x40" + HASH.encode())
    | st.just(b"\x0a\x01a")
    | st.just(b"\x80\x80\x00"),
    lambda inner: st.builds(
        lambda number, parts: _varint(number << 3 | 2) + _varint(len(b"".join(parts))) + b"".join(parts),
        st.integers(1, 5),
        st.lists(inner, max_size=3),
    ),
    max_leaves=8,
)


@given(st.lists(_FIELDS, max_size=4).map(b"".join) | st.binary(max_size=40))
@example(b"\x12" + b"\x0f" + b"\n\x01a\x12\x0a\n\x08" + b"12345678")
def test_messages_are_decoded_as_by_protobuf(data: bytes) -> None:
    try:
        expected = Used.FromString(data)
    except DecodeError:
        with pytest.raises(ValueError, match=r"."):
            decode(data)
        return
    if is_storable(expected) and expected.exit_code == 0 and _has_good_names(expected):
        assert decode(data) == as_result(expected)
    else:
        with pytest.raises(ValueError, match=r"."):
            decode(data)


def _has_good_names(message: object) -> bool:
    result = as_result(message)
    return not any(".." in file.path.split("/") or "\0" in file.path for file in result.files)


@given(RESULTS, st.data())
def test_a_corrupt_byte_is_decoded_as_by_protobuf(result: ActionResult, data: st.DataObject) -> None:
    spoilt = bytearray(encode(result))
    if spoilt:
        spoilt[data.draw(st.integers(0, len(spoilt) - 1))] = data.draw(st.integers(0, 255))
    test_messages_are_decoded_as_by_protobuf.hypothesis.inner_test(bytes(spoilt))  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (b"\x12\x00", "not a valid file name"),
        (encode(ActionResult((OutputFile("/etc/passwd", Digest(HASH, 1)),))), "not a valid file name"),
        (encode(ActionResult((OutputFile("a/../../b", Digest(HASH, 1)),))), "not a valid file name"),
        (encode(ActionResult((OutputFile("a\0b", Digest(HASH, 1)),))), "not a valid file name"),
        (encode(ActionResult((OutputFile("a", Digest(HASH.upper(), 1)),))), "not a SHA-256"),
        (encode(ActionResult((OutputFile("a", Digest("", 1)),))), "not a SHA-256"),
        (encode(ActionResult((OutputFile("a", Digest(HASH, 2**64 - 1)),))), "negative size"),
        (b"\x20\x01", "failed"),
        (b"\x20\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01", "failed"),
        (b"\x2a\x05abc", "ends in the middle of a field"),
        (b"\x2a\xff\xff\xff\xff\xff\xff\xff\xff\x7f", "ends in the middle of a field"),
        (b"\x2a", "unterminated varint"),
        (b"\x80" * 11, "unterminated varint"),
        (b"\x00\x00", "invalid field number"),
        (b"\x0b", "in the middle of a group"),
        (b"\x0b\x14", "invalid wire type"),
        (b"\x0e", "invalid wire type"),
        (b"\x0b" * 101 + b"\x0c" * 101, "invalid wire type"),
        (b"<html>", "invalid wire type"),
    ],
)
def test_invalid_messages_are_explained(data: bytes, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        decode(data)


def test_oversized_messages_are_rejected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(action_result, "MAX_SIZE", 10)
    assert decode(b"\x2a\x08" + b"a" * 8).stdout == b"a" * 8
    with pytest.raises(ValueError, match="11 bytes, more than 10"):
        decode(b"\x2a\x09" + b"a" * 9)


def test_a_path_that_is_not_utf8_is_rejected() -> None:
    with pytest.raises(ValueError, match="surrogates"):
        encode(ActionResult((OutputFile(os.fsdecode(b"\xff"), Digest(HASH, 1)),)))
