"""Unit tests start no programs and use no network: one that does fails."""

import sys
import threading
import traceback
from collections.abc import Generator
from pathlib import Path

import pytest

_HERE = str(Path(__file__).parent)
_PROGRAMS = frozenset(
    {"os.exec", "os.fork", "os.forkpty", "os.posix_spawn", "os.spawn", "os.system", "subprocess.Popen"}
)
"""Audit events of Python for starting a process, or replacing this one."""
_NETWORK = "socket.connect"


class _Guard:
    """An audit hook, which cannot be removed, that works while a unit test is watched."""

    def __init__(self) -> None:
        self.active = False
        self.violations: list[str] = []

    def __call__(self, event: str, arguments: tuple[object, ...]) -> None:
        if not self.active or (event not in _PROGRAMS and event != _NETWORK):
            return
        if event == _NETWORK and not isinstance(arguments[1], tuple):  # a Unix domain socket
            return
        in_main_thread = threading.current_thread() is threading.main_thread()
        if event == _NETWORK and not in_main_thread:
            return  # of a library that an earlier test in this process has used, such as Dask
        frames = [frame for frame in traceback.extract_stack()[:-1] if frame.filename.startswith(_HERE)]
        line = f"{frames[-1].filename}:{frames[-1].lineno}: " if frames else ""
        self.violations.append(f"{line}{event} {arguments!r}")
        if in_main_thread:
            raise PermissionError(event)  # not in other threads, for which a test may wait

    def watch(self) -> Generator[None, object, object]:
        """Watch one phase of a test, and fail it even if the tested code handled the error."""
        self.active = True
        try:
            return (yield)
        finally:
            self.active = False
            violations, self.violations = self.violations, []
            if violations:
                rule = "tests that start programs or use a network belong in tests/integration:"
                pytest.fail("\n".join((rule, *violations)), pytrace=False)


_GUARD = _Guard()
sys.addaudithook(_GUARD)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, object, object]:
    """Watch the fixtures; a test that is skipped without a program does not belong here either."""
    if next(item.iter_markers("needs"), None):
        pytest.fail("tests that need a program belong in tests/integration", pytrace=False)
    return (yield from _GUARD.watch())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Generator[None, object, object]:
    """Watch the test."""
    return (yield from _GUARD.watch())


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(nextitem: pytest.Item | None) -> Generator[None, object, object]:
    """Watch what the fixtures do afterwards, but not those of the session, which end after the last test."""
    if nextitem is None:
        return (yield)
    return (yield from _GUARD.watch())
