"""Paths of a workspace are replaced and restored."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from forge.base.layout import Layout
from forge.plugins.package_cache.relocation import Relocator


def places(root: str) -> Relocator:
    path = Path(root)
    return Relocator(path, Layout(path / "build", path / "install", None))


HERE, THERE = places("/home/ann/ws"), places("/srv/ci/job-7/ws")

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
    assert HERE.absolutize(HERE.relativize(text.encode())) == text.encode()


@given(TEXTS)
def test_stored_files_do_not_contain_the_workspace_path(text: str) -> None:
    """What is loose at another place names that place wherever it named this one."""
    if "@FORGE" not in text:
        assert not HERE.occur_in(THERE.absolutize(HERE.relativize(text.encode())))


@pytest.mark.parametrize(
    ("text", "moved"),
    [
        ("prefix=/home/ann/ws/install/a\n", "prefix=/srv/ci/job-7/ws/install/a\n"),
        ("/home/ann/ws/install:/home/ann/ws/build", "/srv/ci/job-7/ws/install:/srv/ci/job-7/ws/build"),
        ("-I/home/ann/ws/src/a/include", "-I/srv/ci/job-7/ws/src/a/include"),
        ("file:///home/ann/ws", "file:///srv/ci/job-7/ws"),
        ("nothing of it", "nothing of it"),
        ("/home/ann/ws2/install is another's", "/home/ann/ws2/install is another's"),
        ("/home/ann/ws.old", "/home/ann/ws.old"),
        ("/home/ann/wsé", "/home/ann/wsé"),
        ("as in /home/ann/ws.", "as in /srv/ci/job-7/ws."),
    ],
)
def test_paths_in_text_files_are_rewritten(text: str, moved: str) -> None:
    assert THERE.absolutize(HERE.relativize(text.encode())).decode() == moved


@pytest.mark.parametrize(
    "content", [b"\x7fELF\0/home/ann/ws/build/a/x.cpp\0", b"@FORGE_ROOT@ and /home/ann/ws"]
)
def test_binary_files_and_files_with_placeholders_are_unchanged(content: bytes) -> None:
    assert HERE.relativize(content) == content


@pytest.mark.parametrize("root", ["/a b/ws", "/it's/ws", "/a$b"])
def test_paths_with_special_characters_are_not_plain(root: str) -> None:
    assert not places(root).is_plain
    assert places("/ärger/ws-1.0+x").is_plain


def test_missing_files_in_home_have_user_independent_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", f"{tmp_path}/ann")
    here = places(f"{tmp_path}/ann/ws")
    monkeypatch.setenv("HOME", "/root")
    there = places("/srv/ws")
    (tmp_path / "ann").mkdir()
    (tmp_path / "ann/header.h").write_text("")
    for path, word, other in (
        (f"{tmp_path}/ann/.cmake", "~/.cmake", "/root/.cmake"),
        (f"{tmp_path}/ann/header.h", f"{tmp_path}/ann/header.h", f"{tmp_path}/ann/header.h"),
        (f"{tmp_path}/ann/ws/x", "@FORGE_ROOT@/x", "/srv/ws/x"),
        ("/home/anna/x", "/home/anna/x", "/home/anna/x"),
        ("$HOME", "$HOME", "$HOME"),
    ):
        assert here.relativize_input(path) == word
        assert there.absolutize_input(word) == other


def test_separate_folders_have_their_own_placeholders() -> None:
    apart = Relocator(Path("/ws"), Layout(Path("/fast/build"), Path("/opt/robot"), None))
    assert apart.relativize_word("/opt/robot/lib:/fast/build/x:/ws/src") == (
        "@FORGE_INSTALL@/lib:@FORGE_BUILD@/x:@FORGE_ROOT@/src"
    )
