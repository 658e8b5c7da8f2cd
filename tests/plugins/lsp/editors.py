"""An editor for tests: a client of the language server, over the streams of a process or of a thread."""

import json
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from forge.interfaces.read.sources import Library
from forge.plugins.lsp.index import Index
from forge.plugins.lsp.server import InterfaceServer


class Editor:
    """Sends requests, and waits for their answers; positions are written as 'LINE:COLUMN' from 0."""

    def __init__(self, answers: IO[bytes], requests: IO[bytes]) -> None:
        self._answers = answers
        self._requests = requests
        self._number = 0
        self._versions: dict[Path, int] = {}
        self.diagnostics: dict[str, list[dict[str, Any]]] = {}
        """The problems that the server has reported last, by the address of the document."""
        self.messages: list[str] = []
        """What the server has shown to the user."""
        self.registered: list[str] = []
        """The methods that the server has registered."""

    def start(self, folder: Path, **capabilities: Any) -> dict[str, Any]:
        """Open a folder, and return what the server can do."""
        params = {"processId": None, "rootUri": folder.as_uri(), "capabilities": capabilities}
        answer: dict[str, Any] = self.ask("initialize", **params)
        self.tell("initialized")
        return answer["capabilities"]  # type: ignore[no-any-return]  # JSON

    def open(self, path: Path, text: str | None = None) -> list[str]:
        """Open a file, with another text than it has on disk if one is given, and return its problems."""
        self._versions[path] = 1
        content = path.read_text(encoding="utf-8") if text is None else text
        item = {"uri": path.as_uri(), "languageId": "plaintext", "version": 1, "text": content}
        self.tell("textDocument/didOpen", textDocument=item)
        return self.problems(path)

    def type(self, path: Path, text: str) -> list[str]:
        """Replace the text of an open file without saving it, and return its problems."""
        self._versions[path] += 1
        document = {"uri": path.as_uri(), "version": self._versions[path]}
        self.tell("textDocument/didChange", textDocument=document, contentChanges=[{"text": text}])
        return self.problems(path)

    def problems(self, path: Path) -> list[str]:
        """Return the problems of a file after the server has processed all messages."""
        self._settle()
        return [
            f"{each['range']['start']['line']}:{each['range']['start']['character']}"
            f"-{each['range']['end']['character']}: {each['message'].partition(chr(10))[0]}"
            for each in self.diagnostics.get(path.as_uri(), [])
        ]

    def at(self, method: str, path: Path, position: str, **params: Any) -> Any:
        """Ask about a position in a file."""
        line, _, column = position.partition(":")
        place = {"line": int(line), "character": int(column)}
        return self.ask(method, textDocument={"uri": path.as_uri()}, position=place, **params)

    def ask(self, method: str, **params: Any) -> Any:
        """Send a request and return its result; an error fails the test."""
        self._number += 1
        self._send({"id": self._number, "method": method, "params": params})
        while True:
            message = self._receive()
            if message.get("id") == self._number and "method" not in message:
                assert "error" not in message, message["error"]
                return message["result"]
            self._take(message)

    def tell(self, method: str, **params: Any) -> None:
        """Send a notification."""
        self._send({"method": method, "params": params})

    def end(self) -> None:
        self._number += 1
        self._send({"id": self._number, "method": "shutdown"})
        while self._receive().get("id") != self._number:
            pass
        self._send({"method": "exit"})

    def _settle(self) -> None:
        """Wait until the server has processed all messages: it answers in order, also to unknown methods."""
        self._number += 1
        self._send({"id": self._number, "method": "tests/settle", "params": {}})
        while (message := self._receive()).get("id") != self._number or "method" in message:
            self._take(message)

    def _take(self, message: dict[str, Any]) -> None:
        match message.get("method"):
            case "textDocument/publishDiagnostics":
                self.diagnostics[message["params"]["uri"]] = message["params"]["diagnostics"]
            case "window/showMessage":
                self.messages.append(message["params"]["message"])
            case "client/registerCapability":
                self.registered += [each["method"] for each in message["params"]["registrations"]]
                self._send({"id": message["id"], "result": None})
            case _:
                raise AssertionError(f"not expected: {message}")

    def _send(self, message: dict[str, Any]) -> None:
        content = json.dumps({"jsonrpc": "2.0", **message}).encode()
        self._requests.write(b"Content-Length: %d\r\n\r\n%s" % (len(content), content))
        self._requests.flush()

    def _receive(self) -> dict[str, Any]:
        length = 0
        while (line := self._answers.readline().strip()) or not length:
            name, _, value = line.partition(b":")
            if name.lower() == b"content-length":
                length = int(value)
            assert line, "the server has ended"
        message: dict[str, Any] = json.loads(self._answers.read(length))
        return message


def index_of(root: Path) -> Index:
    """Return the index of a workspace without underlays."""
    index = Index(root, Library(), {})
    index.scan()
    return index


@contextmanager
def editor() -> Iterator[Editor]:
    (requests_out, requests_in), (answers_out, answers_in) = os.pipe(), os.pipe()
    with (
        os.fdopen(requests_out, "rb") as requests,
        os.fdopen(answers_in, "wb") as answers,
        os.fdopen(answers_out, "rb") as received,
        os.fdopen(requests_in, "wb") as sent,
    ):
        server = InterfaceServer(index_of)
        thread = threading.Thread(target=lambda: server.start_io(requests, answers))
        thread.start()
        client = Editor(received, sent)
        try:
            yield client
        finally:
            client.end()
            thread.join(timeout=10)
    assert not thread.is_alive()
