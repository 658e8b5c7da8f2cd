"""`forge lsp`: a session over standard input and output with the client of pygls, and what it lacks."""

import asyncio
import os
import subprocess
import sys
from functools import partial
from pathlib import Path

from lsprotocol import types as lsp
from pygls.lsp.client import LanguageClient

from forge.base.own_environment import extra_command
from tests.conftest import Tree
from tests.packages import manifest_text
from tests.snippets import ROOT

_ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "AMENT_PREFIX_PATH"}


def test_a_session_reports_problems_of_an_open_file(tree: Tree) -> None:
    root = tree(
        {
            "src/nav/package.xml": manifest_text("nav", "<depend>std_msgs</depend>"),
            "src/nav/msg/Path.msg": "std_msgs/Header header\n",
        }
    )
    asyncio.run(_session(root))


async def _session(root: Path) -> None:
    client = LanguageClient("tests", "1")
    reported: asyncio.Queue[lsp.PublishDiagnosticsParams] = asyncio.Queue()
    client.feature(lsp.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)(partial(reported.put_nowait))
    await client.start_io(sys.executable, "-m", "forge", "lsp", "--stdio", env=_ENVIRONMENT, cwd=ROOT)
    capabilities = lsp.ClientCapabilities()
    params = lsp.InitializeParams(capabilities=capabilities, root_uri=root.as_uri())
    started = await client.initialize_async(params)
    assert started.server_info is not None
    assert started.server_info.name == "forge"
    client.initialized(lsp.InitializedParams())
    uri = (root / "src/nav/msg/Path.msg").as_uri()
    text = "std_msgs/Header header\nstd_msgs/Headr other\n"
    client.text_document_did_open(lsp.DidOpenTextDocumentParams(lsp.TextDocumentItem(uri, "rosmsg", 1, text)))
    found = (await asyncio.wait_for(reported.get(), 60)).diagnostics
    assert [(each.range.start.line, each.message) for each in found] == [
        (1, "unknown type 'std_msgs/Headr'\nhint: did you mean 'std_msgs/Header'?")
    ]
    document, cursor = lsp.TextDocumentIdentifier(uri), lsp.Position(0, 12)
    shown = await client.text_document_hover_async(lsp.HoverParams(document, cursor))
    assert isinstance(shown, lsp.Hover)
    assert isinstance(shown.contents, lsp.MarkupContent)
    assert "Serialized: 13 bytes or more" in shown.contents.value
    await client.shutdown_async(None)
    client.exit(None)
    await client.stop()  # type: ignore[no-untyped-call]


def test_without_pygls_the_install_command_is_printed(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text("import sys\nsys.modules['pygls'] = None\n", encoding="utf-8")
    path = os.pathsep.join((str(tmp_path), str(ROOT)))
    argv = (sys.executable, "-m", "forge", "lsp")
    ran = subprocess.run(
        argv, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 2
    assert ran.stderr == f"error: 'forge lsp' needs pygls 2\nhint: run: {extra_command('lsp')}\n"
