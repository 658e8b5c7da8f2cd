"""Repositories of mixins: an index of files on this machine or on a server."""

import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
import yaml

from tests.conftest import Forge, Ran, Tree

ASAN = '{"build": {"asan": {"cmake-args": ["-DCMAKE_CXX_FLAGS=-fsanitize=address"]}}}\n'
INDEX = "mixin:\n  - asan.mixin\n  - more/lld.mixin\n"


@pytest.fixture
def root(tree: Tree) -> Path:
    """Return a folder with a repository of two files, and the user's folder 'home'."""
    return tree(
        {
            "repo/index.yaml": INDEX,
            "repo/asan.mixin": ASAN,
            "repo/more/lld.mixin": "build:\n  lld: {cmake-args: [-DCMAKE_EXE_LINKER_FLAGS=-fuse-ld=lld]}\n",
            "repo/bad.mixin": "build: [1]\n",
            "home/mixin/mine.mixin": "build: {mine: {jobs: 3}}\n",
        }
    )


@pytest.fixture
def mixin(forge: Forge, root: Path) -> partial[Ran]:
    return partial(forge, "mixin", cwd=root, env={"COLCON_HOME": str(root / "home")})


@pytest.fixture
def served(root: Path) -> Iterator[str]:
    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(root / "repo"))) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}/index.yaml"
        server.shutdown()
        thread.join()


def test_mixins_can_be_listed_and_shown(forge: Forge, root: Path) -> None:
    (root / "home/mixin/mine.mixin").unlink()
    (root / "home/mixin/my.mixin").write_text(
        "test: {fast: {executor: parallel}}\nbuild: {mold: {jobs: 2}}\n"
    )
    env = {"COLCON_HOME": str(root / "home")}
    listing = forge("mixin", "list", cwd=root, env=env).out
    assert listing.startswith(
        "mixin files not associated with a repository\n"
        f"- {root}/home/mixin/my.mixin\n    build: mold\n    test: fast\nbuilt into forge\n    build: asan, "
    )
    shown = forge("mixin", "show", "build", "release", cwd=root).out
    assert shown == "build:\n- release\n  cmake-args: ['-DCMAKE_BUILD_TYPE=Release']\n"
    assert "test:\n- coverage-pytest\n" in forge("mixin", "show", cwd=root).out
    ran = forge("mixin", "show", "build", "releas", cwd=root)
    assert (ran.code, ran.err) == (
        2,
        "error: unknown mixin 'releas' for 'build'\nhint: did you mean 'release'?\n",
    )
    assert "did you mean 'test'?" in forge("mixin", "show", "tset", cwd=root).err
    assert "build:\n- release\n" in forge("mixin", "show", "release", cwd=root).out
    ran = forge("mixin", "show", "relase", cwd=root)
    assert ran.err == "error: unknown mixin 'relase'\nhint: did you mean 'release'?\n"


def test_mixins_of_an_index_are_fetched_updated_and_removed(mixin: partial[Ran], root: Path) -> None:
    fetched = root / "home/mixin/default"
    assert mixin("add", "default", "repo/index.yaml").code == 0
    url = f"file://{root}/repo/index.yaml"
    assert yaml.safe_load((root / "home/mixin_repositories.yaml").read_text()) == {"default": url}
    assert not fetched.exists()
    first = mixin("update")
    assert first.out == (f"fetching default: {url} ...\n  + {fetched}/asan.mixin\n  + {fetched}/lld.mixin\n")
    assert (fetched / "asan.mixin").read_text() == ASAN
    listing = mixin("list").out
    assert listing.startswith(
        f"default: {url}\n- {fetched}/asan.mixin\n    build: asan\n- {fetched}/lld.mixin\n    build: lld\n"
        f"mixin files not associated with a repository\n- {root}/home/mixin/mine.mixin\n    build: mine\n"
    )
    assert mixin("list", "default").out == listing.partition("mixin files")[0]

    (root / "repo/asan.mixin").write_text(ASAN.replace("asan", "asan2"))
    (root / "repo/index.yaml").write_text("mixin: [asan.mixin]")
    assert mixin("update", "default").out.splitlines()[1:] == [
        f"  * {fetched}/asan.mixin",
        f"  - {fetched}/lld.mixin -> *.obsolete",
    ]
    assert mixin("update").out.splitlines()[1:] == [f"  . {fetched}/asan.mixin"]
    assert "asan2" in mixin("show", "build").out

    assert mixin("remove", "default").out == f"  - {fetched}/asan.mixin -> *.obsolete\n"
    assert "asan2" not in mixin("show", "build").out
    assert mixin("update").out == ""
    assert (root / "home/mixin/mine.mixin").exists()


def test_an_index_may_be_on_a_server(mixin: partial[Ran], served: str, root: Path) -> None:
    assert mixin("add", "web", served).code == 0
    told = mixin("update", "web").out
    assert told.splitlines()[1:] == [
        f"  + {root}/home/mixin/web/asan.mixin",
        f"  + {root}/home/mixin/web/lld.mixin",
    ]
    (root / "repo/index.yaml").write_text(f"mixin: [no.mixin, asan.mixin, 'file://{root}/repo/asan.mixin']")
    ran = mixin("update")
    assert ran.code == 2
    assert "no.mixin': 404 file not found" in ran.err.lower()
    assert f"the index names 'file://{root}/repo/asan.mixin', which is not on a server" in ran.err
    assert ran.out.splitlines()[1:] == [
        f"  . {root}/home/mixin/web/asan.mixin",
        f"  - {root}/home/mixin/web/lld.mixin -> *.obsolete",
    ]


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ("[bad.mixin]", "bad.mixin: error: 'build' is not a mapping of names to options"),
        ("[index.yaml]", "which is not a '*.mixin' file"),
        ("[more/..%2Fx.mixin]", "which is not a '*.mixin' file"),
        ("['https://[x/a.mixin']", "which is not a URL"),
        ("['ssh://host/a.mixin']", "which is not on a server"),
        ("[none.mixin]", "none.mixin': no such file or directory"),
        ("asan.mixin", "index.yaml: error: the index has no list 'mixin' of file names"),
    ],
)
def test_an_invalid_index_is_an_error_and_changes_nothing(
    mixin: partial[Ran], root: Path, entries: str, message: str
) -> None:
    (root / "home/mixin/r").mkdir()
    (root / "home/mixin/r/bad.mixin").write_text(ASAN)
    (root / "repo/index.yaml").write_text(f"mixin: {entries}" if entries[0] == "[" else f"files: {entries}")
    mixin("add", "r", "repo/index.yaml")
    ran = mixin("update")
    assert ran.code == 2
    assert message in ran.err
    if "bad" in entries:
        assert (root / "home/mixin/r/bad.mixin").read_text() == ASAN


def test_a_failing_repository_does_not_stop_the_others(mixin: partial[Ran], root: Path) -> None:
    (root / "home/mixin_repositories.yaml").write_text(
        f"a: http://127.0.0.1:1/index.yaml\nb: file://{root}/repo/index.yaml\n"
    )
    ran = mixin("update")
    assert ran.code == 2
    assert "cannot fetch 'http://127.0.0.1:1/index.yaml': connection refused" in ran.err
    assert f"  + {root}/home/mixin/b/asan.mixin\n" in ran.out


def test_passwords_in_urls_are_hidden(mixin: partial[Ran], root: Path) -> None:
    (root / "home/mixin_repositories.yaml").write_text("a: http://me:secret@127.0.0.1:1/index.yaml")
    assert mixin("list", "a").out == "a: http://...@127.0.0.1:1/index.yaml\n"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("add", "a/b", "repo/index.yaml"), "invalid repository name 'a/b'"),
        (("add", ".a", "repo/index.yaml"), "invalid repository name '.a'"),
        (("add", "r", "repo/index.yaml"), "a repository named 'r' already exists"),
        (("add", "x", "repo/none.yaml"), "file 'repo/none.yaml' not found"),
        (
            ("add", "x", "ftp://host/index.yaml"),
            "cannot fetch mixins over 'ftp'\nhint: use http, https or file",
        ),
        (("update", "rr"), "no mixin repository is named 'rr'\nhint: did you mean 'r'?"),
        (("remove", "zzz"), "no mixin repository is named 'zzz'\nhint: 'forge mixin list' lists"),
        (("list", "zzz"), "no mixin repository is named 'zzz'"),
    ],
)
def test_an_invalid_name_or_url_is_an_error(
    mixin: partial[Ran], words: tuple[str, ...], message: str
) -> None:
    mixin("add", "r", "repo/index.yaml")
    ran = mixin(*words)
    assert ran.code == 2
    assert message in ran.err


def test_a_damaged_list_of_repositories_is_an_error(mixin: partial[Ran], root: Path) -> None:
    (root / "home/mixin_repositories.yaml").write_text("a: 1\n")
    ran = mixin("update")
    assert (ran.code, "is not a mapping of names to URLs" in ran.err) == (2, True)


def test_oversized_files_are_not_fetched(mixin: partial[Ran], root: Path) -> None:
    (root / "repo/asan.mixin").write_text("#" * 1_000_001)
    mixin("add", "r", "repo/index.yaml")
    assert "asan.mixin': it is larger than 1000000 bytes" in mixin("update").err
