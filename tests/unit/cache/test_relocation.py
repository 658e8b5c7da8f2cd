"""Paths of a workspace are replaced and restored; files that cannot be relocated are reported."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.base.layout import Layout
from forge.cache.relocation import NonRelocatable, QuotingClass, Relocator


def places(root: str) -> Relocator:
    """Return the places of a workspace with the usual folders."""
    path = Path(root)
    return Relocator(path, Layout(path / "build", path / "install", None))


HERE, THERE = places("/home/ann/ws"), places("/srv/ci/job 7/ws")

WORDS = st.sampled_from(
    [
        "/home/ann/ws",
        "/install",
        "/build",
        "/lib",
        " ",
        "\n",
        ":",
        '"',
        "-I",
        "x",
        "2",
        ".",
        "-",
        "@",
        "é",
        "\\",
    ]
)
TEXTS = st.lists(WORDS, max_size=12).map("".join)


@given(TEXTS)
def test_relocated_files_are_restored_unchanged(text: str) -> None:
    loose = HERE.relativize(text.encode())
    assert isinstance(loose, NonRelocatable) or HERE.absolutize(loose) == text.encode()


@given(TEXTS)
def test_stored_files_do_not_contain_the_workspace_path(text: str) -> None:
    """What is loose at another place names that place wherever it named this one."""
    loose = HERE.relativize(text.encode())
    if not isinstance(loose, NonRelocatable):
        assert not HERE.occur_in(THERE.absolutize(loose))


@pytest.mark.parametrize(
    ("text", "moved"),
    [
        ("prefix=/home/ann/ws/install/a\n", "prefix=/srv/ci/job 7/ws/install/a\n"),
        ("/home/ann/ws/install:/home/ann/ws/build", "/srv/ci/job 7/ws/install:/srv/ci/job 7/ws/build"),
        ("-I/home/ann/ws/src/a/include", "-I/srv/ci/job 7/ws/src/a/include"),
        ("file:///home/ann/ws", "file:///srv/ci/job 7/ws"),
        ("nothing of it", "nothing of it"),
        ("/home/ann/ws2/install is another's", "/home/ann/ws2/install is another's"),
        ("/home/ann/ws.old", "/home/ann/ws.old"),
        ("/home/ann/wsé", "/home/ann/wsé"),
        ("as in /home/ann/ws.", "as in /srv/ci/job 7/ws."),
    ],
)
def test_paths_in_text_files_are_rewritten(text: str, moved: str) -> None:
    loose = HERE.relativize(text.encode())
    assert not isinstance(loose, NonRelocatable)
    assert THERE.absolutize(loose).decode() == moved


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"\x7fELF\0/home/ann/ws/build/a/x.cpp\0", "the path of the build folder"),
        (b"\0A/home/ann/ws/src", "the path of the workspace"),
        (b"backup/home/ann/ws/install", "the path of the install folder"),
        (b"s@/home/ann/ws/install@/usr@", "the path of the install folder"),
        (b"@FORGE_ROOT@ and more", "a placeholder of forge"),
    ],
)
def test_files_that_cannot_be_relocated_bind_the_result_to_its_path(content: bytes, what: str) -> None:
    assert HERE.relativize(content) == NonRelocatable(what)


@pytest.mark.parametrize("spelled", [b"a\\ b", b"a$ b", b"a%20b", b"a\\040b"])
def test_other_spellings_of_the_path_are_found(spelled: bytes) -> None:
    assert isinstance(places("/ws/a b").relativize(b"cd /ws/" + spelled + b"/install"), NonRelocatable)


def test_the_target_of_a_link_counts_as_the_path(tmp_path: Path) -> None:
    real, link = tmp_path / "real", tmp_path / "link"
    real.mkdir()
    link.symlink_to(real)
    assert isinstance(places(str(link)).relativize(f"{real}/install".encode()), NonRelocatable)


@pytest.mark.parametrize(
    ("root", "kind"),
    [
        ("/ws", QuotingClass.PLAIN),
        ("/ärger/ws-1.0+x", QuotingClass.PLAIN),
        ("/a b/ws", QuotingClass.SPACED),
        ("/it's/ws", QuotingClass.ODD),
        ("/a$b", QuotingClass.ODD),
    ],
)
def test_paths_have_three_quoting_classes(root: str, kind: str) -> None:
    assert places(root).quoting == kind


def test_separate_folders_have_their_own_placeholders() -> None:
    apart = Relocator(Path("/ws"), Layout(Path("/fast/build"), Path("/opt/robot"), None))
    assert apart.relativize_word("/opt/robot/lib:/fast/build/x:/ws/src") == (
        "@FORGE_INSTALL@/lib:@FORGE_BUILD@/x:@FORGE_ROOT@/src"
    )
