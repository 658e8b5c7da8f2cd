"""Permissions of a local cache folder, and the results in it."""

import grp
import hashlib
import os
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from forge.base.errors import HostError
from forge.cache.model import ActionResult, Digest, OutputFile
from forge.plugins.package_cache.folder_store import FolderStore, decode_result
from forge.plugins.package_cache.maintenance import Counts, add_counts

KEY = "ab" * 32


@pytest.fixture(params=[0o000, 0o022, 0o077], ids=oct)
def mask(request: pytest.FixtureRequest) -> Iterator[int]:
    before = os.umask(request.param)
    yield request.param
    os.umask(before)


def fill(store: FolderStore, source: Path) -> None:
    """Put a result and both kinds of blobs into a store."""
    content = b"bytes"
    source.write_bytes(content)
    store.put(Digest(hashlib.sha256(content).hexdigest(), len(content)), source)
    draft = store.draft()
    draft.write_bytes(b"others")
    store.adopt(draft, Digest(hashlib.sha256(b"others").hexdigest(), 6))
    store.put_result(KEY, ActionResult())
    add_counts(store.folder, Counts(1, 1), store.rights)


def rights(folder: Path) -> dict[str, set[int]]:
    """Return the rights of the folders, and of the files, in a folder."""
    found: dict[str, set[int]] = {"folders": set(), "files": set()}
    for path in folder.rglob("*"):
        found["folders" if path.is_dir() else "files"].add(stat.S_IMODE(path.stat().st_mode))
    return found


@pytest.mark.usefixtures("mask")
def test_cached_files_are_private_to_their_owner(tmp_path: Path) -> None:
    store = FolderStore(tmp_path / "deep/cache")
    fill(store, tmp_path / "source")
    assert rights(tmp_path / "deep/cache") == {"folders": {0o700}, "files": {0o600}}
    assert stat.S_IMODE(store.folder.stat().st_mode) == 0o700


@pytest.mark.usefixtures("mask")
@pytest.mark.parametrize("mode", [0o755, 0o775, 0o777, 0o1777, 0o2755])
def test_world_readable_folders_are_not_group_folders(tmp_path: Path, mode: int) -> None:
    """It may be there for other things as well: its own rights stay as they are."""
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache").chmod(mode)
    fill(FolderStore(tmp_path / "cache"), tmp_path / "source")
    assert rights(tmp_path / "cache") == {"folders": {0o700}, "files": {0o600}}
    assert stat.S_IMODE((tmp_path / "cache").stat().st_mode) == mode


@pytest.mark.usefixtures("mask")
@pytest.mark.parametrize(("mode", "files"), [(0o2770, 0o660), (0o2775, 0o664)])
def test_a_setgid_folder_is_shared_with_its_group(tmp_path: Path, mode: int, files: int) -> None:
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache").chmod(mode)
    fill(FolderStore(tmp_path / "cache"), tmp_path / "source")
    assert rights(tmp_path / "cache") == {"folders": {mode}, "files": {files}}


def test_files_of_earlier_versions_are_made_private(tmp_path: Path) -> None:
    for name in ("ac/ab", "cas/ab"):
        (tmp_path / "cache" / name).mkdir(parents=True)
    (tmp_path / "cache/cas/ab/blob").write_text("open to all")
    fill(FolderStore(tmp_path / "cache"), tmp_path / "source")
    assert {stat.S_IMODE((tmp_path / "cache" / name).stat().st_mode) for name in ("ac", "cas")} == {0o700}


def test_a_cache_folder_removed_during_use_is_recreated(tmp_path: Path) -> None:
    store = FolderStore(tmp_path / "cache")
    fill(store, tmp_path / "source")
    (tmp_path / "cache").rename(tmp_path / "gone")
    fill(store, tmp_path / "source")
    assert store.result(KEY) == ActionResult()


@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o2777, 0o707, 0o2772])
def test_a_world_writable_folder_is_rejected(tmp_path: Path, mode: int) -> None:
    folder = tmp_path / "cache"
    folder.mkdir()
    folder.chmod(mode)
    with pytest.raises(HostError, match="other users can write to this cache folder"):
        FolderStore(folder).check()


@pytest.mark.parametrize("mode", [0o700, 0o755, 0o2770, 0o2775])
def test_a_private_folder_and_one_shared_with_a_group_are_accepted(tmp_path: Path, mode: int) -> None:
    folder = tmp_path / "cache"
    folder.mkdir()
    folder.chmod(mode)
    FolderStore(folder).check()
    FolderStore(tmp_path / "new").check()


def test_a_group_writable_folder_needs_the_setgid_bit(tmp_path: Path) -> None:
    folder = tmp_path / "cache"
    folder.mkdir()
    other = next(entry.gr_gid for entry in grp.getgrall() if entry.gr_gid != os.getgid())
    try:
        os.chown(folder, -1, other)
    except PermissionError:
        pytest.skip("needs root")
    folder.chmod(0o770)
    with pytest.raises(HostError):
        FolderStore(folder).check()
    folder.chmod(0o2770)
    FolderStore(folder).check()


def test_a_folder_of_another_user_is_rejected(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "cache"
    folder.mkdir()
    try:
        os.chown(folder, 12345, -1)
    except PermissionError:
        pytest.skip("needs root")
    monkeypatch.setattr(os, "geteuid", lambda: 12346)
    with pytest.raises(HostError):
        FolderStore(folder).check()


@pytest.mark.usefixtures("mask")
def test_a_world_writable_result_counts_as_missing(tmp_path: Path) -> None:
    store = FolderStore(tmp_path / "cache")
    store.put_result(KEY, ActionResult())
    assert store.result(KEY) is not None
    store.result_path(KEY).chmod(0o666)
    assert store.result(KEY) is None


@pytest.mark.usefixtures("mask")
def test_shared_cache_files_are_not_world_writable(tmp_path: Path) -> None:
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache").chmod(0o2777)
    fill(FolderStore(tmp_path / "cache"), tmp_path / "source")
    assert all(not mode & 0o002 for modes in rights(tmp_path / "cache").values() for mode in modes)


def test_stored_results_round_trip(tmp_path: Path) -> None:
    store = FolderStore(tmp_path / "cache")
    result = ActionResult((OutputFile("lib/\udcff", Digest("0a" * 32, 7)),), b'{"a": 1}\xff')
    store.put_result(KEY, result)
    assert store.result(KEY) == result


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"[]",
        b"{}",
        b'{"files": 1, "stdout": ""}',
        b'{"files": [], "stdout": 1}',
        b'{"files": [["a", "../../x", 1]], "stdout": ""}',
        b'{"files": [["a", 1, 1]], "stdout": ""}',
        b'{"files": [[1, "%s", 1]], "stdout": ""}' % (b"0a" * 32),
        b'{"files": [["a", "%s", -1]], "stdout": ""}' % (b"0a" * 32),
        b'{"files": [["a", "%s", true]], "stdout": ""}' % (b"0a" * 32),
        b"[" * 100_000,
    ],
)
def test_a_damaged_result_counts_as_missing(tmp_path: Path, data: bytes) -> None:
    store = FolderStore(tmp_path / "cache")
    store.put_result(KEY, ActionResult())
    store.result_path(KEY).write_bytes(data)
    assert store.result(KEY) is None
    with pytest.raises(ValueError, match=r"it is not a result|invalid|Expecting"):
        decode_result(data)
