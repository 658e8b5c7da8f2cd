"""A team's cache behind nginx: clones at other paths get what was built, whatever becomes of the server."""

import itertools
import os
import re
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.conftest import Forge, Ran
from tests.e2e.test_cache import restored
from tests.evolving import PLAIN, Entry, differences, look
from tests.nginx import Nginx, serving
from tests.packages import manifest_text, write_files
from tests.rude import Moves, rude
from tests.snippets import ROOT, shell

pytestmark = pytest.mark.needs("/usr/sbin/nginx", "cmake", "g++")

SMALL = {name: text for name, text in PLAIN.items() if name.startswith(("src/data/", "src/reader/"))}
"""Two packages, of which one needs the other, and no compiler."""


@pytest.fixture
def nginx(tmp_path: Path) -> Iterator[Nginx]:
    with serving(tmp_path / "nginx") as running:
        yield running


@dataclass(frozen=True, slots=True)
class Clone:
    """A folder with the sources of the others, and with a local cache of its own, which is empty."""

    folder: Path
    forge: Forge

    @property
    def cache(self) -> Path:
        return self.folder.with_name(f"{self.folder.name} cache")

    def build(self, *words: str, env: Mapping[str, str] | None = None) -> Ran:
        """Build what is new; this must work."""
        argv = ("--log-base", "/dev/null", "build", "--cache", str(self.cache), *words)
        ran = self.forge(*argv, cwd=self.folder, env=env)
        assert ran.code == 0, ran.err
        return ran

    def tree(self) -> Mapping[str, Entry]:
        return look(self.folder / "install")

    def forget(self) -> None:
        """Remove what was built, and the local cache."""
        for folder in (self.folder / "build", self.folder / "install", self.cache):
            shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture
def clone(tmp_path: Path, forge: Forge) -> Callable[[str], Clone]:
    return lambda name: Clone(write_files(tmp_path / name, SMALL), forge)


@pytest.fixture
def detected_compilers() -> None:
    """Let each workspace detect compilers, since their starts are counted."""


def watched_compilers(folder: Path) -> dict[str, str]:
    """Return the environment in which each start of a compiler is written down, in FOLDER/started."""
    folder.mkdir()
    for name in ("cc", "gcc", "c++", "g++"):
        real = shutil.which(name)
        text = f'#!/bin/sh\necho "$0 $*" >> "{folder}/started"\nexec "{real}" "$@"\n'
        (folder / name).write_text(text, encoding="utf-8")
        (folder / name).chmod(0o755)
    return {"PATH": f"{folder}:{os.environ['PATH']}"}


def test_a_clone_at_another_path_is_restored_completely(nginx: Nginx, forge: Forge, tmp_path: Path) -> None:
    """No compiler is started for it, and nothing is installed but what a clean build there installs.

    That paths do not matter was shown by builds in two other clones.
    """
    env = watched_compilers(tmp_path / "compilers")
    some = ("--packages-up-to", "plain_cmake_math", "robot_control_interfaces", "robot_configs")
    words = (*some, "--remote-cache", nginx.url)
    names = ("first", "deeper/second", "and/at/the_third")
    first, second, third = (Clone(tmp_path / name, forge) for name in names)
    for each in (first, second, third):
        shutil.copytree(ROOT / "examples_ws/src", each.folder / "src")
    started = tmp_path / "compilers/started"
    for each in (first, second):
        assert restored(each.build(*words, env=env)) == 0
        assert " -c " in started.read_text("utf-8")
        started.unlink()
    ran = third.build(*words, env=env)
    assert ran.out.count("Finished <<<") == ran.out.count("[ from the cache ]") == restored(ran)
    assert restored(ran) > 4
    assert not started.exists()
    found = third.tree()
    third.forget()
    assert restored(third.build(*some, env=env)) == 0
    assert differences(found, third.tree()) == []


def test_read_only_clients_upload_nothing(nginx: Nginx, clone: Callable[[str], Clone]) -> None:
    clone("reader").build("--remote-cache", nginx.url, "--cache-read-only")
    assert {request.split()[0] for request in nginx.requests()} == {"GET"}
    for name in ("writer", "deeper/second"):
        assert restored(clone(name).build(env={"FORGE_REMOTE_CACHE": nginx.url})) == 0
    assert restored(clone("a/third/clone").build("--remote-cache", nginx.url, "--cache-read-only")) == 2


def test_a_clone_at_the_same_path_is_restored_immediately(
    nginx: Nginx, clone: Callable[[str], Clone]
) -> None:
    """As in containers and on CI servers, whose caches are empty."""
    one = clone("one")
    assert restored(one.build("--remote-cache", nginx.url)) == 0
    one.forget()
    assert restored(one.build("--remote-cache", nginx.url)) == 2


@dataclass(frozen=True, slots=True)
class Clean:
    """What a build without a server installs in a folder, and how long it takes."""

    folder: Path
    tree: Mapping[str, Entry]
    seconds: float


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Clean:
    """Build once for all tests of this module."""
    folder = write_files(tmp_path_factory.mktemp("clean") / "clone", SMALL)
    begun = time.monotonic()
    shell("forge build --cache ../cache", folder)
    seconds = time.monotonic() - begun
    return Clean(folder, look(folder / "install"), seconds)


@pytest.fixture
def one(built: Clean, forge: Forge) -> Clone:
    """Give the clone in that folder, as if nothing had been built."""
    clone = Clone(built.folder, forge)
    clone.forget()
    return clone


@pytest.mark.parametrize(
    ("answer", "most"),
    [
        (lambda _: (60.0,), 1),
        (lambda _: itertools.cycle([b"H", 0.1]), 1),
        (lambda _: (), 2),
        (lambda _: (b"HTTP/1.1 500 Oh\r\nContent-Length: 0\r\n\r\n",), 1),
        (lambda _: (b"HTTP/1.1 200 OK\r\nContent-Length: 6\r\n\r\n<html>",), 30),
    ],
    ids=["hangs", "drips", "goes away", "is broken", "lies"],
)
def test_a_bad_server_delays_a_build_by_at_most_the_timeout(
    answer: Callable[..., Moves], most: int, one: Clone, built: Clean
) -> None:
    with rude(answer) as server:
        begun = time.monotonic()
        ran = one.build("--remote-cache", server.url, "--cache-timeout", "1")
        assert time.monotonic() - begun < 2 * built.seconds + 1 + 1
        assert 1 <= len(server.requests) <= most
    assert restored(ran) == 0
    assert "warning: " in ran.err
    assert differences(one.tree(), built.tree) == []


def test_an_unreachable_server_does_not_delay_a_build(nginx: Nginx, one: Clone, built: Clean) -> None:
    nginx.stop()
    ran = one.build("--remote-cache", nginx.url)
    assert f"{nginx.url}: cannot connect: Connection refused; disabled for this build" in ran.err
    assert differences(one.tree(), built.tree) == []


@pytest.mark.parametrize(
    "damage",
    [
        ("cas", lambda data: bytes([data[0] ^ 0x40]) + data[1:]),
        ("cas", lambda data: data[:-1]),
        ("cas", None),
        ("ac", lambda data: bytes([data[0] ^ 0x40]) + data[1:]),
        ("ac", lambda _: b""),
    ],
    ids=["other bytes", "too few bytes", "no blobs", "no messages", "empty messages"],
)
def test_corrupt_remote_results_are_rebuilt_and_replaced(
    damage: tuple[str, Callable[[bytes], bytes] | None],
    nginx: Nginx,
    clone: Callable[[str], Clone],
    one: Clone,
    built: Clean,
) -> None:
    clone("writer").build("--remote-cache", nginx.url)
    folder, spoil = damage
    for path in (nginx.files / folder).iterdir():
        if spoil is None:
            path.unlink()
        else:
            path.write_bytes(spoil(path.read_bytes()))
    assert restored(one.build("--remote-cache", nginx.url)) == 0
    assert differences(one.tree(), built.tree) == []
    one.forget()
    assert restored(one.build("--remote-cache", nginx.url)) == 2
    assert differences(one.tree(), built.tree) == []


def test_passwords_are_not_stored_in_packages_or_files(forge: Forge, tmp_path: Path) -> None:
    """Packages are built by code of others, logs are given to others."""
    folder = tmp_path / "ws"
    (folder / "src/curious").mkdir(parents=True)
    (folder / "src/curious/package.xml").write_text(manifest_text("curious", build_type="cmake"), "utf-8")
    (folder / "src/curious/CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.18)\nproject(curious NONE)\n"
        "file(WRITE ${CMAKE_BINARY_DIR}/found\n"
        '  "$ENV{FORGE_CACHE_TOKEN} $ENV{FORGE_REMOTE_CACHE} $ENV{OTHER}")\n'
        "install(FILES ${CMAKE_BINARY_DIR}/found DESTINATION share)\n",
        "utf-8",
    )
    url = "http://me:hush@word@127.0.0.1:9/cache"
    env = {"FORGE_CACHE_TOKEN": "to.ken", "FORGE_REMOTE_CACHE": url, "OTHER": "other"}
    for words in (("--remote-cache", url), ("--force", f"--remote-cache={url}"), ("--force",)):
        ran = forge("build", "--cache", str(tmp_path / "cache"), *words, cwd=folder, env=env)
        assert ran.code == 0, ran.err
        assert "127.0.0.1:9/cache: cannot connect" in ran.err
        said = [
            ran.out,
            ran.err,
            *(
                path.read_text("utf-8", "replace")
                for path in tmp_path.rglob("*")
                if path.is_file() and not path.is_symlink()
            ),
        ]
        assert [text for text in said if re.search("hush|word@|to[.]ken", text)] == []
    assert (folder / "install/curious/share/found").read_text("utf-8") == "  other"
