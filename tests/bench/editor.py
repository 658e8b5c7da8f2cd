"""How long `forge lsp` takes to answer in a large workspace: `python -m tests.bench.editor [INTERFACES]`.

Prints the time to start, and the median and maximum of each request in milliseconds; asserts nothing.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from tests.packages import manifest_text
from tests.plugins.lsp.editors import Editor

if TYPE_CHECKING:
    from collections.abc import Callable

_IN_A_PACKAGE = 20
_REPEATED = 20


def write(root: Path, interfaces: int) -> Path:
    """Write packages whose messages contain those of earlier packages, and return the last message."""
    path = root
    for number in range(interfaces // _IN_A_PACKAGE):
        needs = sorted({number // 2, number // 3, max(number - 1, 0)} - {number})
        folder = root / f"src/pkg{number}"
        (folder / "msg").mkdir(parents=True)
        depends = [f"<depend>{name}</depend>" for name in ("std_msgs", *(f"pkg{need}" for need in needs))]
        (folder / "package.xml").write_text(manifest_text(f"pkg{number}", *depends), encoding="utf-8")
        for which in range(_IN_A_PACKAGE):
            fields = [f"float64 value{field}  # of something [m]" for field in range(8)]
            fields += [f"pkg{need}/Type{which} other{need}" for need in needs]
            path = folder / f"msg/Type{which}.msg"
            path.write_text(
                "\n".join(("std_msgs/Header header", *fields, "uint8 OK=0", "")), encoding="utf-8"
            )
    return path


def measure(editor: Editor, path: Path) -> None:
    """Ask every kind of question about a message."""
    text = path.read_text(encoding="utf-8")
    versions = iter(range(10**6))
    last = f"{text.count(chr(10))}:1"
    references = {"context": {"includeDeclaration": True}}
    questions: dict[str, Callable[[], Any]] = {
        "type a field": lambda: editor.type(path, f"{text}int8 x{next(versions)}\n"),
        "type an unknown type": lambda: editor.type(path, f"{text}pkk{next(versions)}/Typo x\n"),
        "type a word": lambda: editor.type(path, f"{text}T\n"),
        "completion": lambda: editor.at("textDocument/completion", path, last),
        "hover on a type": lambda: editor.at("textDocument/hover", path, "9:2"),
        "hover on a field": lambda: editor.at("textDocument/hover", path, "8:10"),
        "definition": lambda: editor.at("textDocument/definition", path, "9:2"),
        "references": lambda: editor.at("textDocument/references", path, "9:2", **references),
        "references of a type used everywhere": (
            lambda: editor.at("textDocument/references", path, "0:2", **references)
        ),
        "rename": lambda: editor.at("textDocument/rename", path, "9:7", newName="Renamed"),
    }
    editor.open(path)
    for name, ask in questions.items():
        taken = []
        for _ in range(_REPEATED):
            start = time.perf_counter()
            ask()
            taken.append((time.perf_counter() - start) * 1e3)
        print(f"{name:40} {median(taken):9.1f} {max(taken):8.1f}")


def main(interfaces: int) -> None:
    """Write a workspace, start the server in it, and measure."""
    argv = (sys.executable, "-m", "forge", "lsp")
    with (
        tempfile.TemporaryDirectory() as folder,
        subprocess.Popen(
            argv, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
        ) as server,
    ):
        assert server.stdin
        assert server.stdout
        path = write(Path(folder), interfaces)
        editor = Editor(server.stdout, server.stdin)
        start = time.perf_counter()
        editor.start(Path(folder), workspace={"workspaceEdit": {"resourceOperations": ["rename"]}})
        editor.problems(path)
        print(f"{interfaces} interfaces: started in {time.perf_counter() - start:.1f} s")
        print(f"{'request':40} {'median ms':>9} {'max ms':>8}")
        measure(editor, path)
        editor.end()


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 5000)
