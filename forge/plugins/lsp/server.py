"""The language server: converts requests to calls of an index, and their results to responses."""

from __future__ import annotations

import logging
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from functools import lru_cache, partial
from itertools import islice
from pathlib import Path
from typing import Any
from urllib.parse import quote

from lsprotocol import types as lsp
from pygls import uris
from pygls.exceptions import JsonRpcException
from pygls.lsp.server import LanguageServer

from forge import __version__
from forge.base.errors import ForgeError
from forge.plugins.lsp.completion import complete
from forge.plugins.lsp.diagnostics import diagnose
from forge.plugins.lsp.hover import hover
from forge.plugins.lsp.index import Index, is_known
from forge.plugins.lsp.navigation import definition, references
from forge.plugins.lsp.rename import renamable, rename
from forge.plugins.lsp.text import Place, Span

_Cursor = tuple[Index, Path, int, int]
"""A file in an index, and a line and a column in it."""

_SEVERITIES = {
    "error": lsp.DiagnosticSeverity.Error,
    "warning": lsp.DiagnosticSeverity.Warning,
    "note": lsp.DiagnosticSeverity.Information,
}
_KINDS = {
    "type": lsp.CompletionItemKind.Struct,
    "package": lsp.CompletionItemKind.Module,
    "constant": lsp.CompletionItemKind.Constant,
    "keyword": lsp.CompletionItemKind.Keyword,
    "value": lsp.CompletionItemKind.Value,
}
_WATCHED = "**/{package.xml,*.msg,*.srv,*.action,*.idl}"
_PLAIN = re.compile(r"[\w./-]*", re.ASCII)
"""A path that needs no quoting in a URL: matching is faster than quoting."""


class _RefusedError(JsonRpcException):
    """The response to a request that cannot be fulfilled."""

    CODE = lsp.LSPErrorCodes.RequestFailed.value


@contextmanager
def _refusing() -> Iterator[None]:
    """Answer a request with the problems that make it impossible."""
    try:
        yield
    except ForgeError as error:
        raise _RefusedError("; ".join(each.message for each in error.problems)) from None


class InterfaceServer(LanguageServer):
    """Answers one editor; `open_index` returns the index of the workspace around a folder."""

    def __init__(self, open_index: Callable[[Path], Index]) -> None:
        super().__init__("forge", __version__)
        logging.getLogger("pygls.protocol.json_rpc").addFilter(_is_worth_logging)
        self._open_index = open_index
        self._indexes: dict[Path, Index] = {}
        self._opened: dict[Path, str] = {}
        """The open documents, each with the URI that the editor uses."""
        self._is_told = False
        """Whether the editor reports files that others change; Neovim on Linux does not."""
        handlers: dict[str, Callable[[Any], object]] = {
            lsp.INITIALIZED: self._initialized,
            lsp.TEXT_DOCUMENT_DID_OPEN: self._did_open,
            lsp.TEXT_DOCUMENT_DID_CHANGE: self._did_change,
            lsp.TEXT_DOCUMENT_DID_CLOSE: self._did_close,
            lsp.TEXT_DOCUMENT_DID_SAVE: self._did_save,
            lsp.WORKSPACE_DID_CHANGE_WATCHED_FILES: self._did_change_files,
        }
        for method, handler in handlers.items():
            # pygls sets attributes on the functions that it registers, which methods do not support.
            self.feature(method)(partial(handler))
        triggers = lsp.CompletionOptions(trigger_characters=["/", ":", "<", ">", " ", "="])
        questions: dict[str, tuple[Callable[[Any, _Cursor], object], Any]] = {
            lsp.TEXT_DOCUMENT_HOVER: (self._hover, None),
            lsp.TEXT_DOCUMENT_DEFINITION: (self._definition, None),
            lsp.TEXT_DOCUMENT_REFERENCES: (self._references, None),
            lsp.TEXT_DOCUMENT_COMPLETION: (self._completion, triggers),
            lsp.TEXT_DOCUMENT_PREPARE_RENAME: (self._prepare_rename, None),
            lsp.TEXT_DOCUMENT_RENAME: (self._rename, lsp.RenameOptions(prepare_provider=True)),
        }
        for method, (answer, options) in questions.items():
            self.feature(method, options)(partial(self._at_cursor, answer))

    def _initialized(self, _: lsp.InitializedParams) -> None:
        """Read the workspace, and ask the editor to report changed files."""
        folders = [Path(uris.to_fs_path(uri) or "") for uri in self.workspace.folders]
        root = self.workspace.root_path
        for folder in folders or [Path(root) if root else Path.cwd()]:
            self._add(folder)
        capabilities = self.client_capabilities.workspace
        watching = capabilities.did_change_watched_files if capabilities else None
        if watching and watching.dynamic_registration:
            self._is_told = True
            watchers = [lsp.FileSystemWatcher(glob_pattern=_WATCHED)]
            options = lsp.DidChangeWatchedFilesRegistrationOptions(watchers=watchers)
            method = lsp.WORKSPACE_DID_CHANGE_WATCHED_FILES
            registration = lsp.Registration(id="files", method=method, register_options=options)
            self.client_register_capability(lsp.RegistrationParams(registrations=[registration]))

    def _add(self, folder: Path) -> Index:
        index = self._open_index(folder)
        return self._indexes.setdefault(index.root, index)

    def _index(self, path: Path) -> Index:
        enclosing = [root for root in self._indexes if path.is_relative_to(root)]
        if enclosing:
            return self._indexes[max(enclosing, key=lambda root: len(root.parts))]
        return self._add(path.parent)

    def _did_open(self, params: lsp.DidOpenTextDocumentParams) -> None:
        self._look_for_changes()
        self._take(params.text_document.uri)

    def _did_change(self, params: lsp.DidChangeTextDocumentParams) -> None:
        self._take(params.text_document.uri)

    def _take(self, uri: str) -> None:
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
        del params  # the editor has sent its text
        self._look_for_changes()
        self._publish()

    def _look_for_changes(self) -> None:
        if not self._is_told:
            for index in self._indexes.values():
                index.refresh_changed()

    def _did_change_files(self, params: lsp.DidChangeWatchedFilesParams) -> None:
        for path in filter(None, (_path(change.uri) for change in params.changes)):
            self._index(path).refresh(path)
        self._publish()

    def _at_cursor(self, answer: Callable[[Any, _Cursor], object], params: Any) -> object:
        """Answer a query about the text under a cursor; None if the file is of another kind."""
        path = _path(params.text_document.uri)
        if path is None:
            return None
        index = self._index(path)
        codec, lines = self.workspace.position_codec, index.text(path).splitlines()
        position = codec.position_from_client_units(lines, params.position)
        return answer(params, (index, path, position.line, position.character))

    def _hover(self, _: lsp.HoverParams, cursor: _Cursor) -> lsp.Hover | None:
        text = hover(*cursor)
        return lsp.Hover(lsp.MarkupContent(lsp.MarkupKind.Markdown, text)) if text else None

    def _definition(self, _: lsp.DefinitionParams, cursor: _Cursor) -> lsp.Location | None:
        place = definition(*cursor)
        return self._location(cursor[0], place) if place else None

    def _references(self, params: lsp.ReferenceParams, cursor: _Cursor) -> list[lsp.Location]:
        places = references(*cursor, declaration=params.context.include_declaration)
        return [self._location(cursor[0], each) for each in places]

    def _completion(self, _: lsp.CompletionParams, cursor: _Cursor) -> lsp.CompletionList:
        proposals = complete(*cursor)
        where = self._range(cursor[0], cursor[1], proposals.span)
        items = [
            lsp.CompletionItem(
                each.label,
                kind=_KINDS[each.kind],
                detail=each.detail,
                filter_text=each.match,
                sort_text=f"{number:04}",
                text_edit=lsp.TextEdit(where, each.text or each.label),
            )
            for number, each in enumerate(proposals.items)
        ]
        return lsp.CompletionList(is_incomplete=not proposals.complete, items=items)

    def _prepare_rename(
        self, _: lsp.PrepareRenameParams, cursor: _Cursor
    ) -> lsp.PrepareRenamePlaceholder | None:
        with _refusing():
            target = renamable(*cursor)
        if target is None:
            return None
        self._require_moves(moves=target.file is not None)
        return lsp.PrepareRenamePlaceholder(self._range(cursor[0], cursor[1], target.span), target.name)

    def _rename(self, params: lsp.RenameParams, cursor: _Cursor) -> lsp.WorkspaceEdit:
        index = cursor[0]
        with _refusing():
            renaming = rename(*cursor, params.new_name)
        self._require_moves(moves=bool(renaming.moves))
        if renaming.remark:
            self.window_show_message(lsp.ShowMessageParams(lsp.MessageType.Warning, renaming.remark))
        by_path: dict[Path, list[lsp.TextEdit | lsp.AnnotatedTextEdit | lsp.SnippetTextEdit]] = {}
        for edit in renaming.edits:
            change = lsp.TextEdit(self._range(index, edit.path, edit.span), edit.text)
            by_path.setdefault(edit.path, []).append(change)
        documents = self.workspace.text_documents
        changes: list[Any] = [
            lsp.TextDocumentEdit(
                lsp.OptionalVersionedTextDocumentIdentifier(
                    self._uri(path), documents[uri].version if (uri := self._uri(path)) in documents else None
                ),
                edits,
            )
            for path, edits in by_path.items()
        ]
        changes += [lsp.RenameFile(self._uri(old), new.as_uri()) for old, new in renaming.moves]
        return lsp.WorkspaceEdit(document_changes=changes)

    def _require_moves(self, *, moves: bool) -> None:
        """Reject a renaming that moves files if the editor cannot move them."""
        capabilities = self.client_capabilities.workspace
        editing = capabilities.workspace_edit if capabilities else None
        operations = (editing and editing.resource_operations) or ()
        if moves and lsp.ResourceOperationKind.Rename not in operations:
            raise _RefusedError("this editor cannot rename files, which renaming a type requires")

    def _uri(self, path: Path) -> str:
        name = str(path)
        return self._opened.get(path) or f"file://{name if _PLAIN.fullmatch(name) else quote(name)}"

    def _location(self, index: Index, place: Place) -> lsp.Location:
        return lsp.Location(self._uri(place.path), self._range(index, place.path, place.span))

    def _publish(self) -> None:
        """Report the problems of all open files, because each may depend on any other."""
        for path, uri in sorted(self._opened.items()):
            index = self._index(path)
            diagnostics = [
                lsp.Diagnostic(
                    self._range(index, path, each.span),
                    each.message,
                    severity=_SEVERITIES[each.severity],
                    source="forge",
                )
                for each in diagnose(index, path)
            ]
            self._report(uri, diagnostics)

    def _report(self, uri: str, diagnostics: Sequence[lsp.Diagnostic]) -> None:
        self.text_document_publish_diagnostics(lsp.PublishDiagnosticsParams(uri, diagnostics))

    def _range(self, index: Index, path: Path, span: Span) -> lsp.Range:
        """Return a part of a file in the units of the editor."""
        text = index.text(path)
        start, end = span.start, span.end
        if not text.isascii():
            line = next(islice(text.splitlines(), span.line, None), "")
            start, end = map(self.workspace.position_codec.client_num_units, (line[:start], line[:end]))
        return _range(span.line, start, end)


def serve(open_index: Callable[[Path], Index]) -> None:
    """Answer an editor on standard input and output until it ends the session."""
    # The server closes its stream at the end, and printed text must not mix with its responses.
    with os.fdopen(os.dup(sys.stdout.fileno()), "wb") as answers, redirect_stdout(sys.stderr):
        InterfaceServer(open_index).start_io(stdout=answers)


@lru_cache(4096)
def _range(line: int, start: int, end: int) -> lsp.Range:
    """Return a part of a line; cached, because thousands of references are in a few hundred places."""
    return lsp.Range(lsp.Position(line, start), lsp.Position(line, end))


def _is_worth_logging(record: logging.LogRecord) -> bool:
    """Return whether a message of pygls does not concern a rejected request."""
    return not (record.exc_info and isinstance(record.exc_info[1], _RefusedError))


def _path(uri: str) -> Path | None:
    """Return the path of a document that the server understands."""
    name = uris.to_fs_path(uri)
    return Path(name) if name and is_known(Path(name)) else None
