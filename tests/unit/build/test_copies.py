"""Files are compared by content."""

import os
from pathlib import Path

from forge.build.copies import is_same_file


def test_files_are_compared_again_if_one_was_changed_with_the_same_size_and_time(tmp_path: Path) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    for path in (one, other):
        path.write_text("1", encoding="utf-8")
    before = one.stat()
    assert is_same_file(str(one), other)
    one.write_text("2", encoding="utf-8")
    os.utime(one, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert not is_same_file(str(one), other)


def test_a_prefix_of_a_file_is_not_an_equal_file(tmp_path: Path) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    one.write_text("same, and more", encoding="utf-8")
    other.write_text("same", encoding="utf-8")
    assert not is_same_file(str(one), other)
    assert not is_same_file(str(other), one)
