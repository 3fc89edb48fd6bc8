"""Speaks the Language Server Protocol: what an editor asks, and what it is told."""

from __future__ import annotations

import asyncio
from pathlib import Path

from lsprotocol import types
from pygls.lsp.server import LanguageServer
from pygls.uris import to_fs_path
from pygls.workspace import TextDocument

from lab3_usd.check.registry import own_rules
from lab3_usd.data import as_called, rule_address
from lab3_usd.model.finding import Finding, Severity, site_of
from lab3_usd.report.entries import site
from lab3_usd.server.diagnosis import FIRST_LINE, Diagnosis, diagnose, is_judged
from lab3_usd.server.manuals import manual_of
from lab3_usd.server.places import Lines, Span, Symbol, definition, outline, path_at

WAIT = 0.3  # seconds without a change after which a text is judged
_SOURCE = "lab3"
_SEVERITIES: dict[Severity, types.DiagnosticSeverity] = {
    "error": types.DiagnosticSeverity.Error,
    "warning": types.DiagnosticSeverity.Warning,
    "note": types.DiagnosticSeverity.Information,
}


class StageServer(LanguageServer):
    """The server, and what it found of each document that is open."""

    def __init__(self, version: str, release: str = "") -> None:
        """Judge by a release of Isaac Sim; an editor may name another one."""
        super().__init__("lab3", version)
        self.release = release
        self.known: dict[str, Diagnosis] = {}
        self.texts: dict[str, str] = {}  # the last of each document that OpenUSD accepts
        self.waiting: dict[str, asyncio.Task[None]] = {}
        self.judging = asyncio.Lock()


def make_server(version: str, release: str = "") -> StageServer:
    """Return a server that answers what editors ask of stages.

    `release` is that of Isaac Sim, '' for the usual one.
    """
    server = StageServer(version, release)
    _follow_documents(server)
    _answer_questions(server)
    return server


def _follow_documents(server: StageServer) -> None:
    """Judge documents when they are opened, changed and saved."""

    @server.feature(types.INITIALIZE)
    def initialize(params: types.InitializeParams) -> None:
        options = params.initialization_options
        if isinstance(options, dict) and isinstance(options.get("isaac"), str):
            server.release = options["isaac"]

    @server.feature(types.TEXT_DOCUMENT_DID_OPEN)
    async def opened(params: types.DidOpenTextDocumentParams) -> None:
        await _judge(server, params.text_document.uri)

    @server.feature(types.TEXT_DOCUMENT_DID_SAVE)
    async def saved(params: types.DidSaveTextDocumentParams) -> None:
        await _judge(server, params.text_document.uri)

    @server.feature(types.TEXT_DOCUMENT_DID_CHANGE)
    async def changed(params: types.DidChangeTextDocumentParams) -> None:
        uri = params.text_document.uri
        if uri in server.waiting:
            server.waiting[uri].cancel()
        server.waiting[uri] = asyncio.create_task(_judge(server, uri, WAIT))

    @server.feature(types.TEXT_DOCUMENT_DID_CLOSE)
    def closed(params: types.DidCloseTextDocumentParams) -> None:
        uri = params.text_document.uri
        if uri in server.waiting:
            server.waiting.pop(uri).cancel()
        server.known.pop(uri, None)
        server.texts.pop(uri, None)
        server.text_document_publish_diagnostics(types.PublishDiagnosticsParams(uri, []))


def _answer_questions(server: StageServer) -> None:
    """Answer what an editor asks of a place in a document."""

    def document_of(
        params: types.HoverParams
        | types.CodeActionParams
        | types.DefinitionParams
        | types.DocumentSymbolParams,
    ) -> TextDocument:
        return server.workspace.get_text_document(params.text_document.uri)

    @server.feature(types.TEXT_DOCUMENT_HOVER)
    def hover(params: types.HoverParams) -> types.Hover | None:
        return _hover(server, document_of(params), params.position.line)

    @server.feature(
        types.TEXT_DOCUMENT_CODE_ACTION,
        types.CodeActionOptions(code_action_kinds=[types.CodeActionKind.QuickFix]),
    )
    def actions(params: types.CodeActionParams) -> list[types.CodeAction]:
        return _actions(server, document_of(params), params.range)

    @server.feature(types.TEXT_DOCUMENT_DEFINITION)
    def define(params: types.DefinitionParams) -> types.Location | None:
        return _definition(server, document_of(params), params.position)

    @server.feature(types.TEXT_DOCUMENT_DOCUMENT_SYMBOL)
    def symbols(params: types.DocumentSymbolParams) -> list[types.DocumentSymbol]:
        document = document_of(params)
        text = server.texts.get(document.uri, "")
        lines = Lines(text)
        return [_symbol(document, lines, symbol) for symbol in outline(text)] if text else []


async def _judge(server: StageServer, uri: str, wait: float = 0.0) -> None:
    """Judge a document, unless it changes again within `wait` seconds, and tell the editor."""
    await asyncio.sleep(wait)
    document = server.workspace.get_text_document(uri)
    path, text = to_fs_path(uri), document.source
    if path is None or not is_judged(path, text):
        return
    async with server.judging:
        diagnosis = await asyncio.to_thread(diagnose, Path(path), text, server.release)
    server.known[uri] = diagnosis
    is_stage = text.startswith(FIRST_LINE)
    if is_stage and not any(finding.rule.startswith("F") for finding in diagnosis.findings):
        server.texts[uri] = text
    if diagnosis.failure:
        message = types.LogMessageParams(types.MessageType.Error, diagnosis.failure)
        server.window_log_message(message)
    for reason in diagnosis.not_judged:
        server.window_log_message(
            types.LogMessageParams(types.MessageType.Info, f"{path}: not judged: {reason}")
        )
    diagnostics = [
        _diagnostic(document, finding)
        for finding in diagnosis.findings
        if finding.layer in (path, None, "")
    ]
    published = types.PublishDiagnosticsParams(uri, diagnostics, document.version)
    server.text_document_publish_diagnostics(published)


def _diagnostic(document: TextDocument, finding: Finding) -> types.Diagnostic:
    """Return a finding as an editor marks it: from its column to the end of its line."""
    hint = f"\nhint: {as_called(finding.hint)}" if finding.hint else ""
    # Custom rules have no page, and no rule while there is no site.
    page = "" if finding.rule in own_rules() else rule_address(finding.rule)
    return types.Diagnostic(
        range=_range_of(document, finding),
        severity=_SEVERITIES[finding.severity],
        code=finding.rule,
        code_description=types.CodeDescription(page) if page else None,
        source=_SOURCE,
        message=f"{finding.name}: {finding.message}\n{site(finding)}{hint}",
    )


def _range_of(document: TextDocument, finding: Finding) -> types.Range:
    line, column = (finding.line or 1) - 1, (finding.column or 1) - 1
    text = document.lines[line] if line < len(document.lines) else ""
    whole = types.Range(
        types.Position(line, column), types.Position(line, max(column, len(text.rstrip())))
    )
    return document.position_codec.range_to_client_units(document.lines, whole)


def _hover(server: StageServer, document: TextDocument, line: int) -> types.Hover | None:
    """Return the manuals of the rules that find something in a line."""
    here = [
        finding
        for finding in server.known.get(document.uri, Diagnosis()).findings
        if _range_of(document, finding).start.line == line
    ]
    manuals = dict.fromkeys(manual_of(finding.rule) for finding in here)
    text = "\n\n---\n\n".join(filter(None, manuals))
    if not text:
        return None
    return types.Hover(types.MarkupContent(types.MarkupKind.Markdown, text))


def _actions(
    server: StageServer, document: TextDocument, asked: types.Range
) -> list[types.CodeAction]:
    """Return the safe repairs of what is found in some lines, each as an edit of lines."""
    diagnosis = server.known.get(document.uri, Diagnosis())
    actions = []
    for finding in diagnosis.findings:
        place = _range_of(document, finding)
        changes = diagnosis.changes.get(site_of(finding), ())
        if not (changes and asked.start.line <= place.start.line <= asked.end.line):
            continue
        edits = [
            types.TextEdit(
                types.Range(types.Position(change.first, 0), types.Position(change.last, 0)),
                change.text,
            )
            for change in changes
        ]
        title = finding.fix.title if finding.fix is not None else finding.message
        action = types.CodeAction(
            title=f"{finding.rule}: {title}",
            kind=types.CodeActionKind.QuickFix,
            diagnostics=[_diagnostic(document, finding)],
            edit=types.WorkspaceEdit(changes={document.uri: edits}),
            is_preferred=True,
        )
        actions.append(action)
    return actions


def _definition(
    server: StageServer, document: TextDocument, position: types.Position
) -> types.Location | None:
    """Return where the prim or property stands that a wire or target at a place names."""
    text = document.source
    if server.texts.get(document.uri) != text:
        return None
    lines = Lines(text)
    here = document.position_codec.position_from_client_units(document.lines, position)
    place = path_at(text, lines.offset(here.line, here.character))
    span = definition(text, place[0]) if place is not None else None
    return None if span is None else types.Location(document.uri, _range(document, lines, span))


def _range(document: TextDocument, lines: Lines, span: Span) -> types.Range:
    places = (types.Position(*lines.place(offset)) for offset in (span.start, span.stop))
    whole = types.Range(*places)
    return document.position_codec.range_to_client_units(document.lines, whole)


def _symbol(document: TextDocument, lines: Lines, symbol: Symbol) -> types.DocumentSymbol:
    return types.DocumentSymbol(
        name=symbol.name,
        detail=symbol.kind,
        kind=types.SymbolKind.Object if symbol.below else types.SymbolKind.Field,
        range=_range(document, lines, symbol.whole),
        selection_range=_range(document, lines, symbol.name_span),
        children=[_symbol(document, lines, below) for below in symbol.below],
    )
