"""`forge build --watch` in this process; tests/e2e/test_watch.py has the rest."""

import os
import signal
import threading
import time
from collections.abc import Callable

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text

CMAKE = "cmake_minimum_required(VERSION 3.18)\nproject(a NONE)\ninstall(FILES said.txt DESTINATION share/a)\n"
PACKAGE = {
    "src/a/package.xml": manifest_text("a", build_type="cmake"),
    "src/a/CMakeLists.txt": CMAKE,
    "src/a/said.txt": "one",
}


def wait_for(question: Callable[[], bool]) -> None:
    """Wait until the answer is yes, but not for ever."""
    end = time.monotonic() + 30
    while not question() and time.monotonic() < end:
        time.sleep(0.05)


@pytest.mark.needs("cmake")
def test_watch_mode_builds_after_each_save(forge: Forge, tree: Tree) -> None:
    root = tree(PACKAGE)

    def edit() -> None:
        installed = root / "install/a/share/a/said.txt"
        wait_for(lambda: installed.exists() and (root / "build/.forge_lock").read_text() == "")
        time.sleep(1)
        (root / "src/a/package.xml").write_text("<")
        time.sleep(1)
        (root / "src/a/package.xml").write_text(PACKAGE["src/a/package.xml"])
        (root / "src/a/said.txt").write_text("two")
        wait_for(lambda: installed.exists() and installed.read_text() == "two")
        more = {
            "package.xml": manifest_text("b", build_type="cmake"),
            "CMakeLists.txt": CMAKE,
            "said.txt": "",
        }
        tree({f"src/b/{name}": text for name, text in more.items()})
        wait_for((root / "install/b/share/b/package.sh").exists)
        time.sleep(0.5)
        os.kill(os.getpid(), signal.SIGINT)

    editor = threading.Thread(target=edit)
    editor.start()
    ran = forge("build", "--watch", "--force", cwd=root)
    editor.join()
    assert ran.code in {0, 130}
    assert " a rebuilt in " in ran.out
    assert "nothing was built; waiting for the next change" in ran.out
    assert "package.xml:1" in ran.err
