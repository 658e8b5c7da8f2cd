"""Programs that differ only in their run path are equal."""

import subprocess
from pathlib import Path

import pytest

from forge.plugins.package_cache.linked_parts import linked_parts

pytestmark = pytest.mark.needs("gcc")


def with_run_path(folder: Path, run_path: str, code: str = "int v = 1;") -> bytes:
    """Return a library that was linked with a run path, which then was overwritten as CMake does."""
    (folder / "v.c").write_text(code)
    argv = ["gcc", "-shared", "-fPIC", "-o", "libv.so", "v.c", f"-Wl,--build-id=sha1,-rpath,{run_path}"]
    subprocess.run(argv, cwd=folder, check=True)
    content = (folder / "libv.so").read_bytes()
    assert run_path.encode() in content
    return content.replace(run_path.encode(), b"\0" * len(run_path))


def test_linked_parts_do_not_depend_on_the_length_of_the_run_path(tmp_path: Path) -> None:
    one, two = with_run_path(tmp_path, "/one/lib"), with_run_path(tmp_path, "/the/other/lib:/and/lib")
    assert one != two
    assert linked_parts(one) == linked_parts(two) != ""
    assert linked_parts(one) != linked_parts(with_run_path(tmp_path, "/one/lib", "int v = 2;"))
    kept = with_run_path(tmp_path, "/one/lib").replace(b"\0" * len("/one/lib"), b"/two/lib", 1)
    assert linked_parts(one) != linked_parts(kept)
    assert linked_parts(one + b"more") == linked_parts(b"text") == linked_parts(one[:100]) == ""
