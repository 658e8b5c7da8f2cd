"""`forge bundle`: an archive with everything that running needs, for any path."""

import re
import subprocess
import tarfile
from pathlib import Path

from forge.base.layout import LAYOUT_MARKER
from tests.conftest import Forge, Tree
from tests.e2e.test_shells import PLAIN, each_layout, each_shell, report, sourced
from tests.installs import Made, make_install

SITE = "lib/python3.11/site-packages"
WALKER = Made(
    "walker",
    build_type="ament_python",
    files={
        "bin/go": "",
        "include/walker/walker.hpp": "",
        "lib/libwalker.so": "",
        "lib/libwalker.a": "",
        "share/walker/cmake/walkerConfig.cmake": "",
        "share/walker/cmake/template.in": "",
        "lib/cmake/walker/walker-config.cmake": "",
        "lib/pkgconfig/walker.pc": "",
        "lib/walker/include/data": "",
        "bin/cmake": "",
        "share/walker/msg/Step.msg": "",
        f"{SITE}/walker.py": "",
        f"{SITE}/__pycache__/walker.pyc": "",
    },
)


@each_layout
@each_shell
def test_a_bundle_is_relocatable(shell: str, layout_word: str, forge: Forge, tmp_path: Path) -> None:
    root = tmp_path / "the old place"
    layout = make_install(root, [WALKER], merged=layout_word == "merged")
    ran = forge("bundle", "-o", str(tmp_path / "x.tar.gz"), cwd=root)
    assert (ran.code, ran.err) == (0, "")
    assert re.fullmatch(r"/.*/x\.tar\.gz: \d+ files, [1-9] KB\n", ran.out)
    root.rename(tmp_path / "away")
    new = tmp_path / "a new 'place'"
    new.mkdir()
    subprocess.run(["tar", "xzf", str(tmp_path / "x.tar.gz"), "-C", str(new)], check=True)
    moved = new / "install"
    telling = PLAIN | ({"COLCON_CURRENT_PREFIX": str(moved)} if shell == "sh" else {})
    after = report(shell, sourced(shell), telling, str(moved / f"setup.{shell}"))
    prefix = moved if layout_word == "merged" else moved / "walker"
    assert after["PATH"] == f"{prefix}/bin:{PLAIN['PATH']}"
    assert str(layout.install.parent) not in "".join(after.values())
    files = {path.name for path in prefix.rglob("*") if path.is_file()}
    assert {"go", "cmake", "libwalker.so", "walker.py", "Step.msg", "data"} <= files
    build_files = {"walker.hpp", "walkerConfig.cmake", "walker-config.cmake", "template.in", "walker.pc"}
    assert not files & {*build_files, "libwalker.a", "walker.pyc"}


def test_links_out_of_the_tree_become_files(forge: Forge, tmp_path: Path) -> None:
    root = tmp_path / "ws"
    layout = make_install(root, [WALKER])
    prefix = layout.prefix("walker")
    (tmp_path / "src/deep").mkdir(parents=True)
    (tmp_path / "src/deep/data").write_text("of the source")
    (prefix / "share/walker/linked").symlink_to(tmp_path / "src/deep")
    (prefix / "lib/libother.so").symlink_to(prefix / "lib/libwalker.so")
    (prefix / "bin/run").symlink_to("go")
    assert forge("bundle", cwd=root).code == 0
    with tarfile.open(root / "ws.tar.gz") as archive:
        data = archive.extractfile("install/walker/share/walker/linked/data")
        assert data is not None
        assert data.read() == b"of the source"
        assert archive.getmember("install/walker/lib/libother.so").linkname == "libwalker.so"
        assert archive.getmember("install/walker/bin/run").linkname == "go"


def test_bundles_are_reproducible(forge: Forge, tmp_path: Path) -> None:
    make_install(tmp_path, [WALKER])
    assert forge("bundle", "--output", "a.tar.gz", "--with-build-files", cwd=tmp_path).code == 0
    (tmp_path / "install/walker/bin/go").touch()
    assert forge("bundle", "--output", "b.tar.gz", "--with-build-files", cwd=tmp_path).code == 0
    assert (tmp_path / "a.tar.gz").read_bytes() == (tmp_path / "b.tar.gz").read_bytes()
    with tarfile.open(tmp_path / "a.tar.gz") as archive:
        assert "install/walker/include/walker/walker.hpp" in archive.getnames()


def test_a_workspace_built_only_for_other_platforms_is_reported(forge: Forge, tree: Tree) -> None:
    root = tree(
        {f"install/{name}/{LAYOUT_MARKER}": "" for name in ("riscv64-linux-gnu", "aarch64-linux-gnu")}
    )
    hint = "hint: pass the platform that it was built for: --target aarch64-linux-gnu or riscv64-linux-gnu\n"
    assert forge("bundle", cwd=root).err.endswith(hint)


def test_missing_files_and_underlays_are_reported(forge: Forge, tmp_path: Path) -> None:
    assert forge("bundle", cwd=tmp_path).err.startswith(
        f"error: '{tmp_path}/install' contains no installed packages"
    )
    layout = make_install(tmp_path, [WALKER], underlays=(tmp_path / "below",))
    assert forge("bundle", "-o", "x.tar.gz", cwd=tmp_path).err == (
        f"warning: underlays are not part of the archive: '{tmp_path}/below'\n"
        "hint: install them at the same path on the target machine, or bundle them, too\n"
    )
    (layout.prefix("walker") / "bin/lost").symlink_to("nowhere")
    ran = forge("bundle", "-o", "y.tar.gz", cwd=tmp_path)
    assert (ran.code, ran.err) == (
        2,
        (
            f"error: dangling link '{layout.prefix('walker')}/bin/lost'\n"
            "hint: the linked files no longer exist; build again\n"
        ),
    )
    assert not list(tmp_path.glob("*y.tar.gz*"))


def test_a_symbolic_link_cycle_is_reported(forge: Forge, tmp_path: Path) -> None:
    layout = make_install(tmp_path, [WALKER])
    (layout.install / "walker" / "all").symlink_to(tmp_path)
    ran = forge("bundle", cwd=tmp_path)
    assert (ran.code, "is a link to an enclosing folder" in ran.err) == (2, True)
