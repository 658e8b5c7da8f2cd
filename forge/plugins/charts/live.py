"""The page of `--timings=live`: a server on this machine that shows the build while it runs.

Requests without the random token in the address are not answered. The page polls the state. The server
answers after the next change, at the latest after a second, and ends with the build.
"""

from __future__ import annotations

import json
import secrets
import threading
import time
from collections.abc import Callable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from forge.base.graph import reduced, reverse
from forge.base.templating import render
from forge.base.text import duration
from forge.build.events import Aborted, Event, Finished, Fresh, Skipped, Started
from forge.output.reporters import Run
from forge.plugins.charts.graph_formats import printable
from forge.plugins.charts.progress import Progress, expectations

_HOST = "127.0.0.1"
_PERIOD_SECONDS = 1.0
"""The maximum time that an answer waits for a change."""
_PAUSE_SECONDS = 0.25
"""The minimum time between two answers, so that a fast build does not keep the browser busy."""
_TIMEOUT_SECONDS = 3.0
_LONGEST_VERSION = 12
_MINUTE = 60
_SECURITY = {
    "Content-Security-Policy": "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}


class LiveBuild:
    """The state that the page shows. The main thread changes it, the threads of the server read it."""

    def __init__(self, run: Run, usage: Callable[[], Mapping[str, Any]]) -> None:
        """Start with all packages waiting; `usage` returns the load of the machine."""
        self._run = run
        self._usage = usage
        tasks = run.plan.tasks
        self._needs = reduced({name: task.needs for name, task in tasks.items()}, [*tasks])
        self._users = reverse({name: frozenset(needs) for name, needs in self._needs.items()})
        unsure = frozenset(name for name, task in tasks.items() if task.conditional)
        self._progress = Progress(
            time.monotonic(), expectations(tasks, run.seconds), len(tasks), unsure=unsure
        )
        self._outcomes: dict[str, tuple[str, str]] = {}
        self.is_followed = False
        self._ended = False
        self._version = 0
        self._changed = threading.Condition()

    def show(self, event: Event) -> None:
        with self._changed:
            before = self._progress
            match event:
                case Finished(name, code, seconds):
                    self._outcomes[name] = ("failed" if code else "finished", duration(seconds))
                case Fresh(name):
                    self._outcomes[name] = ("unchanged", "")
                case Skipped(name, because):
                    self._outcomes[name] = ("skipped", printable(because))
                case Aborted(name):
                    self._outcomes[name] = ("aborted", "")
                case _:
                    pass
            self._progress = before.after(event, time.monotonic())
            if self._progress is not before or isinstance(event, Started):
                self._tell()

    def end(self) -> None:
        """Answer all waiting requests with the last state."""
        self._ended = True
        self._tell()

    def after(self, version: int) -> dict[str, Any]:
        """Return the state once it differs from that of `version`, or after a second."""
        self.is_followed = True
        with self._changed:
            if not self._ended:
                self._changed.wait_for(lambda: self._ended, _PAUSE_SECONDS)
            self._changed.wait_for(lambda: self._ended or self._version != version, _PERIOD_SECONDS)
            return self.state()

    def state(self) -> dict[str, Any]:
        """Return the state as JSON data; times are strings for people."""
        now, progress = time.monotonic(), self._progress
        left = progress.left(now)
        running = {each.name: each for each in progress.running}
        waiting = [
            name for name in self._run.plan.tasks if name not in running and name not in self._outcomes
        ]
        memory = self._run.memory
        longest = max((now - each.begun for each in running.values()), default=0.0)
        longest = max([longest, *(self._run.seconds.get(name, 0.0) for name in running)])
        return {
            "version": self._version,
            "ended": self._ended,
            "share": round(100 * progress.share(now)),
            "done": len(progress.done),
            "total": progress.total,
            "elapsed": duration(now - progress.begun),
            "left": None if left is None or self._ended else _rough(left),
            "unsure": bool(progress.unsure),
            "usage": self._usage(),
            "running": [
                {
                    **self._named(name),
                    "step": printable(each.step) or "waits for a job",
                    "share": None if each.share is None else round(100 * each.share),
                    "elapsed": duration(now - each.begun),
                    "last": duration(self._run.seconds[name]) if name in self._run.seconds else None,
                    "width": _percent(now - each.begun, longest),
                    "expected": _percent(self._run.seconds.get(name, 0.0), longest),
                    "memory": _gigabytes(memory.now(name)) if memory else None,
                    "peak": _gigabytes(memory.peak(name)) if memory and memory.peak(name) else None,
                    "users": len([user for user in self._users[name] if user not in self._outcomes]),
                }
                for name, each in running.items()
            ],
            "waiting": [{**self._named(name), **self._waits(name, frozenset(running))} for name in waiting],
            "ended_packages": [
                {**self._named(name), "outcome": outcome, "words": words}
                for name, (outcome, words) in reversed(self._outcomes.items())
            ],
        }

    def _waits(self, name: str, running: frozenset[str]) -> dict[str, Any]:
        """Return the packages that a package waits for, or another reason why it waits."""
        needs = [
            {"name": printable(need), "running": need in running}
            for need in self._needs[name]
            if self._outcomes.get(need, ("",))[0] not in {"finished", "unchanged"}
        ]
        if needs:
            return {"needs": needs, "reason": ""}
        memory = self._run.memory
        if memory and running and not memory.fits(name, running):
            return {"needs": [], "reason": f"memory: it used {_gigabytes(memory.peak(name))}"}
        return {"needs": [], "reason": "a free job"}

    def _named(self, name: str) -> dict[str, Any]:
        return {"name": printable(name), "embedded": self._run.plan.tasks[name].embedded}

    def _tell(self) -> None:
        with self._changed:
            self._version += 1
            self._changed.notify_all()


class LiveServer:
    """Serves the page of a build on a free port, in separate threads."""

    def __init__(self, live: LiveBuild, title: str) -> None:
        self._live = live
        token = secrets.token_urlsafe(24)
        rendered = render("charts/templates/live.html.j2", title=title).encode()

        class Handler(_Handler):
            live = self._live
            page = rendered
            place = f"/{token}/"

        self._server = _Server((_HOST, 0), Handler)
        # The last answers, which announce the end, are sent before forge exits.
        self._server.daemon_threads = False
        port = self._server.server_address[1]
        Handler.hosts = frozenset({f"{_HOST}:{port}", f"localhost:{port}"})
        self.address = f"http://{_HOST}:{port}/{token}/"
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(0.05,), name="live page", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Tell the page that the build has ended, and stop the server."""
        if self._thread.is_alive():
            self._live.end()
            if self._live.is_followed:  # a page that just received an answer polls once more
                time.sleep(_PAUSE_SECONDS)
            self._server.shutdown()
            self._thread.join()
            self._server.server_close()


class _Server(ThreadingHTTPServer):
    def handle_error(self, request: object, client_address: object) -> None:
        """Print nothing: a browser may close its connection at any time."""


class _Handler(BaseHTTPRequestHandler):
    """Answers requests with the token for this host; all others get the same empty answer."""

    live: LiveBuild
    page: bytes
    place: str
    hosts: frozenset[str] = frozenset()
    timeout = _TIMEOUT_SECONDS
    server_version, sys_version = "forge", ""

    def do_GET(self) -> None:
        path, _, query = self.path.partition("?")
        # Prevent DNS rebinding: a page of another site could use a name that resolves to this host.
        is_own = self.headers.get("Host") in self.hosts
        if is_own and _same(self.place, path):
            self._answer(HTTPStatus.OK, "text/html; charset=utf-8", self.page)
        elif is_own and _same(f"{self.place}state", path):
            version = int(query) if query.isdecimal() and len(query) <= _LONGEST_VERSION else -1
            state = json.dumps(self.live.after(version)).encode()
            self._answer(HTTPStatus.OK, "application/json", state)
        else:
            self._answer(HTTPStatus.NOT_FOUND, "text/plain", b"")

    def _answer(self, status: HTTPStatus, kind: str, body: bytes) -> None:
        try:
            self.send_response(status)
            for name, value in {"Content-Type": kind, "Content-Length": str(len(body)), **_SECURITY}.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(body)
        except OSError:  # the browser closed the connection
            self.close_connection = True

    def log_message(self, format: str, *args: object) -> None:
        """Print nothing: the terminal belongs to the build."""


def _same(own: str, given: str) -> bool:
    """Compare in constant time, so that the duration does not reveal the length of the matching part."""
    return secrets.compare_digest(own.encode(), given.encode(errors="surrogateescape"))


def _rough(seconds: float) -> str:
    whole_seconds = max(1, round(seconds))
    return f"{whole_seconds}s" if whole_seconds < _MINUTE else duration(whole_seconds)


def _gigabytes(size: int) -> str:
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"


def _percent(part: float, total: float) -> str:
    return f"{min(100.0, 100 * part / total):.2f}%" if total > 0 else "0%"
