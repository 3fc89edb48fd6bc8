"""`lab3 server`, asked over the Language Server Protocol as an editor asks it."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import TypeVar

import pytest
from places import REPOSITORY

pytest.importorskip("pygls", reason="the extra editor is not installed")

from lsprotocol import types
from pygls.lsp.client import LanguageClient

CARTER = REPOSITORY / "docs" / "examples" / "carter.usda"
_T = TypeVar("_T")


class Editor(LanguageClient):
    """A client that keeps what the server publishes of each document."""

    def __init__(self, path: Path) -> None:
        super().__init__("editor", "1")
        self.uri = path.as_uri()
        self.status: int | None = None  # with which the server ended
        self.published: asyncio.Queue[types.PublishDiagnosticsParams] = asyncio.Queue()

        @self.feature(types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
        def keep(params: types.PublishDiagnosticsParams) -> None:
            self.published.put_nowait(params)

        @self.feature(types.WINDOW_LOG_MESSAGE)
        def log(params: types.LogMessageParams) -> None:
            del params

    async def server_exit(self, server: asyncio.subprocess.Process) -> None:
        self.status = server.returncode

    async def diagnostics(self) -> list[types.Diagnostic]:
        """Wait for the next findings."""
        return list((await asyncio.wait_for(self.published.get(), 60)).diagnostics)

    def open(self, text: str) -> None:
        document = types.TextDocumentItem(self.uri, "usda", 1, text)
        self.text_document_did_open(types.DidOpenTextDocumentParams(document))

    def change(self, text: str) -> None:
        self.text_document_did_change(
            types.DidChangeTextDocumentParams(
                types.VersionedTextDocumentIdentifier(2, self.uri),
                [types.TextDocumentContentChangeWholeDocument(text)],
            )
        )

    @property
    def document(self) -> types.TextDocumentIdentifier:
        return types.TextDocumentIdentifier(self.uri)


def asked(path: Path, question: Callable[[Editor], Awaitable[_T]], *options: str) -> _T:
    """Start the server, initialize it, ask it something, and end it without an error."""

    async def ask() -> _T:
        editor = Editor(path)
        await editor.start_io(sys.executable, "-m", "lab3_usd", "server", *options)
        capabilities = types.ClientCapabilities()
        await editor.initialize_async(
            types.InitializeParams(capabilities=capabilities, process_id=None)
        )
        editor.initialized(types.InitializedParams())
        try:
            answer = await question(editor)
        finally:
            await editor.shutdown_async(None)
            editor.exit(None)
            await editor.stop()
        assert editor.status == 0
        return answer

    return asyncio.run(ask())


@pytest.fixture
def carter(tmp_path: Path) -> Path:
    """A robot that lacks connections."""
    path = tmp_path / "carter.usda"
    path.write_text(CARTER.read_text())
    return path


def line_of(text: str, part: str) -> int:
    """The line of the first place of a text, counted from 0."""
    return text.count("\n", 0, text.index(part))


def test_findings_stand_at_their_lines_when_a_file_is_opened(carter: Path) -> None:
    text = carter.read_text()

    async def question(editor: Editor) -> list[types.Diagnostic]:
        editor.open(text)
        return await editor.diagnostics()

    found = {(each.code, each.range.start.line) for each in asked(carter, question)}
    assert ("K11", line_of(text, 'def OmniGraphNode "joint_name_array"')) in found
    assert ("K01", line_of(text, 'def OmniGraphNode "publish_odometry"')) in found


CLOCK = """import omni.graph.core as og

og.Controller.edit(
    {"graph_path": "/World/Clock", "evaluator_name": "execution"},
    {
        og.Controller.Keys.CREATE_NODES: [
            ("tick", "omni.graph.action.OnPlaybackTick"),
            ("time", "isaacsim.core.nodes.IsaacReadSimulationTime"),
            ("clock", "isaacsim.ros2.bridge.ROS2PublishClock"),
        ],
        og.Controller.Keys.CONNECT: [
            ("tick.outputs:tick", "clock.inputs:execIn"),
            ("time.outputs:simulationTime", "clock.inputs:timestamp"),
        ],
    },
)
"""


def test_scripts_are_judged_and_repaired_too(tmp_path: Path) -> None:
    path = tmp_path / "clock.py"
    path.write_text("import omni.graph.core\n")

    async def question(editor: Editor) -> tuple[list[types.Diagnostic], list[str]]:
        editor.open(CLOCK)
        found = await editor.diagnostics()
        asked_for = types.CodeActionParams(
            editor.document, found[0].range, types.CodeActionContext(found)
        )
        actions = await editor.text_document_code_action_async(asked_for) or []
        edits = [
            edit.new_text
            for action in actions
            if isinstance(action, types.CodeAction) and action.edit and action.edit.changes
            for edit in action.edit.changes[editor.uri]
        ]
        return found, edits

    found, edits = asked(path, question)
    line = line_of(CLOCK, "inputs:timestamp")
    assert [(each.code, each.range.start.line) for each in found] == [("K21", line)]
    assert edits == [CLOCK.splitlines(keepends=True)[line].replace("timestamp", "timeStamp")]


def test_what_is_typed_is_judged_before_it_is_saved(carter: Path) -> None:
    text = carter.read_text()
    changed = text.replace("isaacsim.ros2.bridge.ROS2PublishOdometry", "isaacsim.ros2.bridge.Odo")

    async def question(editor: Editor) -> list[types.Diagnostic]:
        editor.open(text)
        await editor.diagnostics()
        editor.change(changed)
        return await editor.diagnostics()

    assert "K32" in {each.code for each in asked(carter, question)}
    assert carter.read_text() == text
    assert [path.name for path in carter.parent.iterdir()] == ["carter.usda"]


def test_text_that_is_no_stage_is_one_finding_at_its_line(carter: Path) -> None:
    text = carter.read_text()
    broken = text.replace('def OmniGraphNode "publish_odometry"', 'def OmniGraphNode publish"')

    async def question(editor: Editor) -> list[types.Diagnostic]:
        editor.open(broken)
        return await editor.diagnostics()

    (found,) = asked(carter, question)
    assert found.range.start.line == line_of(broken, "OmniGraphNode publish")
    assert found.code_description is None  # nothing is published yet


def test_a_hover_shows_the_manual_of_the_rule(carter: Path) -> None:
    text = carter.read_text()
    line = line_of(text, 'def OmniGraphNode "joint_name_array"')

    async def question(editor: Editor) -> types.Hover | None:
        editor.open(text)
        await editor.diagnostics()
        place = types.Position(line, 14)
        return await editor.text_document_hover_async(types.HoverParams(editor.document, place))

    answer = asked(carter, question)
    assert answer is not None
    assert isinstance(answer.contents, types.MarkupContent)
    assert answer.contents.value.startswith("**K11 array-gaps** (error)")
    assert "Fix:" in answer.contents.value


def test_a_quick_fix_repairs_the_finding(carter: Path) -> None:
    text = carter.read_text()
    line = line_of(text, 'def OmniGraphNode "publish_odometry"')

    async def question(editor: Editor) -> tuple[list[types.CodeAction], set[object]]:
        editor.open(text)
        before = await editor.diagnostics()
        lines = types.Range(types.Position(line, 0), types.Position(line, 1))
        params = types.CodeActionParams(editor.document, lines, types.CodeActionContext(before))
        actions = list(await editor.text_document_code_action_async(params) or [])
        edits = actions[0].edit.changes[editor.uri]
        lines_after = text.splitlines(keepends=True)
        for edit in sorted(edits, key=lambda edit: -edit.range.start.line):
            lines_after[edit.range.start.line : edit.range.end.line] = [edit.new_text]
        editor.change("".join(lines_after))
        after = await editor.diagnostics()
        return actions, {(each.code, each.range.start.line) for each in after}

    actions, left = asked(carter, question)
    assert actions[0].title.startswith("K01: connect ")
    assert ("K01", line) not in left


def test_a_definition_is_the_other_end_of_a_wire(carter: Path) -> None:
    text = carter.read_text()
    wire = "on_playback_tick.outputs:tick>"
    offset = text.index(wire)
    line = text.count("\n", 0, offset)
    column = offset - text.rindex("\n", 0, offset) - 1

    async def question(editor: Editor) -> object:
        editor.open(text)
        await editor.diagnostics()
        place = types.Position(line, column)
        params = types.DefinitionParams(editor.document, place)
        return await editor.text_document_definition_async(params)

    answer = asked(carter, question)
    assert isinstance(answer, types.Location)
    name = text.splitlines()[answer.range.start.line]
    assert "outputs:tick" in name or '"on_playback_tick"' in name


def test_the_outline_has_the_graphs_with_their_nodes_by_type(carter: Path) -> None:
    text = carter.read_text()

    async def question(editor: Editor) -> list[types.DocumentSymbol]:
        editor.open(text)
        await editor.diagnostics()
        params = types.DocumentSymbolParams(editor.document)
        return list(await editor.text_document_document_symbol_async(params) or [])

    def flat(symbols: list[types.DocumentSymbol]) -> dict[str, str | None]:
        found: dict[str, str | None] = {}
        for symbol in symbols:
            found |= {symbol.name: symbol.detail} | flat(list(symbol.children or ()))
        return found

    found = flat(asked(carter, question))
    assert found["odometry"] == "OmniGraph"
    assert found["publish_odometry"] == "isaacsim.ros2.bridge.ROS2PublishOdometry"


def test_a_release_that_does_not_exist_is_refused_at_the_start() -> None:
    import subprocess

    command = [sys.executable, "-m", "lab3_usd", "server", "--isaac", "3.0"]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    assert answer.returncode == 2
    assert "there is no Isaac Sim '3.0' here" in answer.stderr
