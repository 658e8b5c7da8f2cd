"""The language server: requests of the protocol to functions of an index, and their results back."""

from __future__ import annotations

import os
import sys
from contextlib import redirect_stdout
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lsprotocol import types as lsp
from pygls import uris
from pygls.lsp.server import LanguageServer
from pygls.workspace import ServerTextPosition, ServerTextRange

from forge import __version__
from forge.editor.diagnostics import diagnose
from forge.editor.index import is_known

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from forge.editor.index import Index
    from forge.editor.text import Span

_SEVERITIES = {
    "error": lsp.DiagnosticSeverity.Error,
    "warning": lsp.DiagnosticSeverity.Warning,
    "note": lsp.DiagnosticSeverity.Information,
}
_WATCHED = "**/{package.xml,*.msg,*.srv,*.action,*.idl}"


class InterfaceServer(LanguageServer):
    """Answers one editor; `open_index` returns the index of the workspace around a folder."""

    def __init__(self, open_index: Callable[[Path], Index]) -> None:
        """Register what the server offers."""
        super().__init__("forge", __version__)
        self._open_index = open_index
        self._indexes: dict[Path, Index] = {}
        self._opened: dict[Path, str] = {}
        """The open documents, with the address by which the editor knows each."""
        handlers: dict[str, Callable[[Any], object]] = {
            lsp.INITIALIZED: self._initialized,
            lsp.TEXT_DOCUMENT_DID_OPEN: self._did_open,
            lsp.TEXT_DOCUMENT_DID_CHANGE: self._did_change,
            lsp.TEXT_DOCUMENT_DID_CLOSE: self._did_close,
            lsp.TEXT_DOCUMENT_DID_SAVE: self._did_save,
            lsp.WORKSPACE_DID_CHANGE_WATCHED_FILES: self._did_change_files,
        }
        for method, handler in handlers.items():
            # pygls stores attributes in what it registers, which a method does not accept.
            self.feature(method)(partial(handler))

    def _initialized(self, _: lsp.InitializedParams) -> None:
        """Read the workspace, and ask the editor to report changed files."""
        folders = [Path(uris.to_fs_path(uri) or "") for uri in self.workspace.folders]
        root = self.workspace.root_path
        for folder in folders or [Path(root) if root else Path.cwd()]:
            self._add(folder)
        capabilities = self.client_capabilities.workspace
        watching = capabilities.did_change_watched_files if capabilities else None
        if watching and watching.dynamic_registration:
            watchers = [lsp.FileSystemWatcher(glob_pattern=_WATCHED)]
            options = lsp.DidChangeWatchedFilesRegistrationOptions(watchers=watchers)
            method = lsp.WORKSPACE_DID_CHANGE_WATCHED_FILES
            registration = lsp.Registration(id="files", method=method, register_options=options)
            self.client_register_capability(lsp.RegistrationParams(registrations=[registration]))

    def _add(self, folder: Path) -> Index:
        index = self._open_index(folder)
        return self._indexes.setdefault(index.root, index)

    def _index(self, path: Path) -> Index:
        """Return the index of the innermost workspace around a file."""
        around = [root for root in self._indexes if path.is_relative_to(root)]
        if around:
            return self._indexes[max(around, key=lambda root: len(root.parts))]
        return self._add(path.parent)

    def _did_open(self, params: lsp.DidOpenTextDocumentParams) -> None:
        self._take(params.text_document.uri)

    def _did_change(self, params: lsp.DidChangeTextDocumentParams) -> None:
        self._take(params.text_document.uri)

    def _take(self, uri: str) -> None:
        """Use the text of an open document."""
        path = _path(uri)
        if path:
            self._opened[path] = uri
            self._index(path).open(path, self.workspace.get_text_document(uri).source)
            self._publish()

    def _did_close(self, params: lsp.DidCloseTextDocumentParams) -> None:
        path = _path(params.text_document.uri)
        if path:
            self._opened.pop(path, None)
            self._index(path).close(path)
            self._report(params.text_document.uri, [])
            self._publish()

    def _did_save(self, params: lsp.DidSaveTextDocumentParams) -> None:
        del params  # its text is known
        self._publish()

    def _did_change_files(self, params: lsp.DidChangeWatchedFilesParams) -> None:
        for path in filter(None, (_path(change.uri) for change in params.changes)):
            self._index(path).refresh(path)
        self._publish()

    def _publish(self) -> None:
        """Report the problems of all open files, because each may depend on any other."""
        for path, uri in sorted(self._opened.items()):
            found = diagnose(self._index(path), path)
            self._report(
                uri,
                [
                    lsp.Diagnostic(
                        self._range(path, each.span),
                        each.message,
                        severity=_SEVERITIES[each.severity],
                        source="forge",
                    )
                    for each in found
                ],
            )

    def _report(self, uri: str, diagnostics: Sequence[lsp.Diagnostic]) -> None:
        self.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(uri, diagnostics))

    def _range(self, path: Path, span: Span) -> lsp.Range:
        """Return a part of a file in the units of the editor."""
        start, end = (ServerTextPosition(span.line, column) for column in (span.start, span.end))
        lines = self._index(path).text(path).splitlines()
        return self.workspace.position_codec.range_to_client_units(lines, ServerTextRange(start, end))


def serve(open_index: Callable[[Path], Index]) -> None:
    """Answer an editor on standard input and output until it ends the session."""
    # The server closes its stream at the end; and whatever is printed must not get between its answers.
    with os.fdopen(os.dup(sys.stdout.fileno()), "wb") as answers, redirect_stdout(sys.stderr):
        InterfaceServer(open_index).start_io(stdout=answers)


def _path(uri: str) -> Path | None:
    """Return the path of a document that the server understands."""
    name = uris.to_fs_path(uri)
    return Path(name) if name and is_known(Path(name)) else None
