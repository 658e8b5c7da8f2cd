"""Trees of installed files: stored, restored, and checked for unsafe paths."""

import json
import os
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from forge.base.files import tree_below
from forge.base.layout import Layout
from forge.build.model import BuildInputs, BuildRecord
from forge.plugins.package_cache.relocation import Relocator
from forge.plugins.package_cache.trees import (
    LARGE,
    CachedTree,
    Tree,
    TreeWriter,
    Uncacheable,
    decode_index,
    encode_index,
    scan_tree,
)

HASH = "0" * 64


def installed(root: Path, files: Mapping[str, bytes]) -> Layout:
    """Write files of the package 'a' below ROOT/install/a."""
    layout = Layout(root / "build", root / "install", None)
    for name, content in files.items():
        path = layout.prefix("a") / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    layout.prefix("a").mkdir(parents=True, exist_ok=True)
    return layout


def surveyed(layout: Layout, pack: Path, elsewhere: tuple[str, ...] = ()) -> Tree:
    """Return the tree of 'a', with its pack in a file."""
    files, folders = tree_below(str(layout.prefix("a")))
    with pack.open("wb") as stream:
        names = (*(path for path, _ in files), *elsewhere)
        record = BuildRecord(BuildInputs(), files=names, folders=tuple(f"{path}/" for path in folders))
        return scan_tree("a", layout, record, Relocator(layout.install.parent, layout), stream.write)


def planted(tree: Tree, pack: Path, source: Path, root: Path) -> Layout:
    layout = Layout(root / "build", root / "install", None)
    large = {
        leaf.hash: os.open(source / leaf.path, os.O_RDONLY)
        for leaf in tree.leaves
        if leaf.offset < 0 and leaf.hash
    }
    found = CachedTree(tree, os.open(pack, os.O_RDONLY), large)
    TreeWriter(layout.prefix("a"), Relocator(root, layout)).write_tree(found)
    found.close()
    return layout


def look(prefix: Path) -> dict[str, tuple[int, bytes]]:
    """Return mode and content of every file, link and folder below a prefix."""
    found = {}
    for path in sorted(prefix.rglob("*")):
        status = path.lstat()
        if path.is_symlink():
            content = bytes(path.readlink())
        else:
            content = path.read_bytes() if path.is_file() else b""
        found[str(path.relative_to(prefix))] = (stat.S_IMODE(status.st_mode), content)
    return found


def test_a_stored_tree_is_restored_unchanged(tmp_path: Path) -> None:
    """Rights, also of folders, links, empty files and folders, large files; names that are no UTF-8."""
    layout = installed(tmp_path / "one", {"lib/small": b"x", "lib/large": b"y" * LARGE, "share/empty": b""})
    prefix = layout.prefix("a")
    (prefix / "lib/small").chmod(0o755)
    (prefix / "lib/linked").symlink_to("small")
    (prefix / "hollow/within").mkdir(parents=True)
    (prefix / "locked/within").mkdir(parents=True)
    (prefix / "locked/within").chmod(0o700)
    (prefix / "locked").chmod(0o500)
    (prefix / "share").chmod(0o700)
    Path(os.fsdecode(bytes(prefix) + b"/share/\xff")).write_bytes(b"odd")
    tree = surveyed(layout, tmp_path / "pack")
    again = decode_index(encode_index(tree))
    assert again == tree
    assert again.empty_folders == ("hollow/within", "locked/within")
    other = planted(again, tmp_path / "pack", prefix, tmp_path / "two")
    assert look(other.prefix("a")) == look(prefix)
    assert surveyed(other, tmp_path / "pack2").digest == tree.digest


def test_paths_are_adjusted_on_restore(tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    times = LARGE // 10
    files = {"setup.sh": f"x={one}/install/a\n", "big.txt": f"{one}\n" * times}
    layout = installed(one, {name: text.encode() for name, text in files.items()})
    (layout.prefix("a") / "link").symlink_to(one / "install" / "a" / "setup.sh")
    tree = surveyed(layout, tmp_path / "pack")
    other = planted(tree, tmp_path / "pack", layout.prefix("a"), two).prefix("a")
    assert (other / "setup.sh").read_text() == f"x={two}/install/a\n"
    assert (other / "link").readlink() == two / "install" / "a" / "setup.sh"
    assert (other / "big.txt").read_text() == f"{two}\n" * times


@pytest.mark.parametrize("size", [10, LARGE])
def test_trees_with_different_binary_files_or_folders_differ(tmp_path: Path, size: int) -> None:
    roots = [tmp_path / name for name in ("one", "two")]
    paths = [b"\0" * size + bytes(root / "build") + b"\0" for root in roots]
    layouts = [installed(root, {"lib/p": path, "x": b""}) for root, path in zip(roots, paths, strict=True)]
    one, two = (surveyed(layout, tmp_path / "pack") for layout in layouts)
    assert one.difference(two) == two.difference(one) == "lib/p"
    (layouts[1].prefix("a") / "lib/p").write_bytes(paths[0])
    assert one.difference(surveyed(layouts[1], tmp_path / "pack")) == ""
    (layouts[1].prefix("a") / "hollow").mkdir()
    assert one.difference(surveyed(layouts[1], tmp_path / "pack")) == "hollow"


def test_unrestorable_results_are_not_stored(tmp_path: Path) -> None:
    layout = installed(tmp_path, {"bin/root": b""})
    (layout.prefix("a") / "bin/root").chmod(0o4755)
    with pytest.raises(Uncacheable, match="'bin/root' is not a regular file"):
        surveyed(layout, tmp_path / "pack")
    with pytest.raises(Uncacheable, match="outside its prefix"):
        surveyed(installed(tmp_path / "b", {}), tmp_path / "pack", ("/etc/passwd",))


def test_bytecode_caches_are_not_stored(tmp_path: Path) -> None:
    layout = installed(tmp_path, {"lib/m.py": b"", "lib/__pycache__/m.cpython-311.pyc": bytes(tmp_path)})
    assert [leaf.path for leaf in surveyed(layout, tmp_path / "pack").leaves] == ["lib/m.py"]


def index(*leaves: list[Any], **other: object) -> bytes:
    """Return an index as somebody else may write it."""
    said: dict[str, object] = {
        "forge_tree": 4,
        "leaves": leaves,
        "folders": [],
        "seconds": 0,
        "has_tests": True,
        "pack": {"hash": HASH, "size": 10},
    }
    return json.dumps({**said, **other}).encode()


def leaf(path: object, offset: int = 0, size: int = 1, target: object = None) -> list[Any]:
    return [path, 0o644, size, HASH, offset, False, target, ""]


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"[]",
        b"{}",
        b"\xff",
        b"[" * 100_000,
        index(forge_tree=2),
        index(leaf("../x")),
        index(leaf("/etc/passwd")),
        index(leaf("a/../../x")),
        index(leaf("a//x")),
        index(leaf("a/./x")),
        index(leaf("")),
        index(leaf("a\0b")),
        index(leaf(7)),
        index(leaf("x"), leaf("x")),
        index(leaf("x", target="/etc"), leaf("x/passwd")),
        index(leaf("x"), leaf("x/y")),
        index(leaf("x"), folders=[["x", 0]]),
        index(folders=[["../x", 0]]),
        index(folders=["x"]),
        index(folders=[["x", 0], ["x", 7]]),
        index(leaf("x", offset=10)),
        index(leaf("x", offset=-2)),
        index(leaf("x", size=-1)),
        index(leaf("x", offset=5, size=6)),
        index(leaf("x")[:-1]),
        index(pack={"hash": "X" * 64, "size": 1}),
        index(pack=None),
        index(seconds="soon"),
        index(seconds=float("nan")),
        index(seconds=10**400),
    ],
)
def test_invalid_or_unsafe_indexes_are_rejected(content: bytes) -> None:
    with pytest.raises(ValueError, match=r"."):
        decode_index(content)


def test_excessive_permissions_are_not_restored() -> None:
    entry = leaf("x")
    entry[1] = 0o104755
    assert decode_index(index(entry)).leaves[0].mode == 0o755


def test_no_files_are_written_through_a_link_out_of_the_prefix(tmp_path: Path) -> None:
    """In a merged prefix the link may be another package's."""
    prefix, outside = tmp_path / "two" / "install" / "a", tmp_path / "outside"
    outside.mkdir()
    prefix.mkdir(parents=True)
    (prefix / "lib").symlink_to(outside)
    tree = surveyed(installed(tmp_path / "one", {"lib/x": b"x"}), tmp_path / "pack")
    with pytest.raises(NotADirectoryError):
        planted(tree, tmp_path / "pack", prefix, tmp_path / "two")
    assert not any(outside.iterdir())


def test_unchanged_files_keep_times_and_hard_links(tmp_path: Path) -> None:
    """An equal file stays, so that nothing is recompiled. A different one is replaced, not overwritten."""
    tree = surveyed(installed(tmp_path / "one", {"same": b"same", "other": b"new"}), tmp_path / "pack")
    prefix = installed(tmp_path / "two", {"same": b"same", "other": b"old"}).prefix("a")
    os.utime(prefix / "same", ns=(1, 1))
    (tmp_path / "second").hardlink_to(prefix / "other")
    planted(tree, tmp_path / "pack", prefix, tmp_path / "two")
    assert (prefix / "same").stat().st_mtime_ns == 1
    assert (prefix / "other").read_bytes() == b"new"
    assert (tmp_path / "second").read_bytes() == b"old"
