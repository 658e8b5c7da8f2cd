"""Text from packages never becomes code: each language's parser finds the same structure."""

import ast
import json
import os
import re
from collections.abc import Iterable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from forge.base.errors import ForgeError, HostError, WorkspaceError
from forge.base.templating import render as render_template
from forge.base.xml import parse_xml
from forge.build.recipes.initial_cache import manifest_variables
from forge.environment.dsv import DsvChange, parse_dsv, resolve_hooks
from forge.interfaces.model import (
    Array,
    Constant,
    Field,
    Message,
    Primitive,
    Sequence,
    Source,
    String,
    TypeName,
)
from forge.interfaces.read.parsing import Parsed, parse
from forge.interfaces.read.sources import Library, read_source
from forge.interfaces.resolve.resolution import resolve
from forge.interfaces.writing import write_depfile
from forge.workspace.identification import identify
from forge.workspace.manifest import parse_manifest
from forge.workspace.overrides import Overrides
from tests.generated import reads_idl, render
from tests.hostile import CANARY, FRAGMENTS, hostile
from tests.packages import manifest_text

EXAMPLES = int(os.environ.get("FORGE_FUZZ_EXAMPLES", "40"))
quick = settings(
    max_examples=EXAMPLES, database=None, derandomize=True, suppress_health_check=list(HealthCheck)
)
BIDI = re.compile("[\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]")
_WORDS = ("x", "plain words", "x.")


# --- Interfaces ---------------------------------------------------------------------------------------------


def definition(doc: Iterable[str], unit: str, value: str, name: str = "Hostile") -> Message:
    """Return a message that says the same wherever an author may say anything."""
    lines, text = tuple(line for each in doc for line in each.split("\n")), String()
    return Message(
        TypeName("pkg", "msg", name),
        (
            Field("number", Primitive("int8"), 5, lines, unit),
            Field("text", text, value, lines, unit),
            Field("wide", String(wide=True), value, lines),
            Field("texts", Sequence(text), (value, value), lines),
            Field("fixed", Array(text, 2), ("", value), lines),
        ),
        (Constant("TEXT", text, value, lines), Constant("ONE", Primitive("int8"), 1, lines)),
        lines,
    )


def generated(message: Message, *targets: str) -> dict[str, str]:
    """Return the texts of all generated files by their paths."""
    source = Source("pkg", f"msg/{message.name.name}.msg", Path("x.msg"), "")
    catalog = resolve("pkg", [Parsed(source, message)], Library())
    return {file.path: file.text for target in targets for file in render(catalog, target)}


messages = st.builds(definition, st.lists(hostile(), max_size=3), hostile(), hostile())
NEUTRAL = definition(["x"], "x", "x")
everywhere = pytest.mark.parametrize("fragment", FRAGMENTS)


def skeleton(text: str) -> str:
    """Return a Python module with every text in it the same, so that only code can differ."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            node.value = ""
    return ast.dump(tree)


@quick
@given(messages)
def test_python_code_does_not_depend_on_comments_and_values(message: Message) -> None:
    found = generated(message, "python")
    plain = generated(NEUTRAL, "python")
    for path, text in found.items():
        if path.endswith(".py"):
            assert skeleton(text) == skeleton(plain[path])
        elif path.endswith(".pyi"):
            # A comment of nothing but blanks leaves no docstring.
            assert _without_docs(text) == _without_docs(plain[path])
        assert not BIDI.search(text), path


def _without_docs(text: str) -> str:
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.Module):
            node.body = [
                line
                for line in node.body
                if not (isinstance(line, ast.Expr) and isinstance(line.value, ast.Constant))
            ]
    return ast.dump(tree)


@reads_idl
@quick
@given(messages)
def test_generated_idl_round_trips(message: Message) -> None:
    (text,) = generated(message, "idl").values()
    again = parse(Source("pkg", "msg/Hostile.idl", Path("Hostile.idl"), text))
    assert isinstance(again, Message)
    assert [(f.name, f.type, f.default) for f in again.fields] == [
        (f.name, f.type, f.default) for f in message.fields
    ]
    assert [(c.name, c.value) for c in again.constants] == [(c.name, c.value) for c in message.constants]


@quick
@given(messages)
def test_json_descriptions_are_json(message: Message) -> None:
    for text in generated(message, "json").values():
        json.loads(text)


@pytest.mark.parametrize("name", [".X", "X\n", "X;Y", "X Y", "X$(a)", "\u202eX", "x"])
def test_invalid_interface_names_are_rejected(name: str) -> None:
    with pytest.raises(ForgeError):
        parse(Source("pkg", f"msg/{name}.msg", Path("x.msg"), "int8 a\n"))


@pytest.mark.parametrize(
    "line", ["int8 ../a", "int8 a;b", "../x/Y a", "a/../Y a", "int8 a$(b)", "int8 a\u202e", "pkg/X\u202eY a"]
)
def test_invalid_member_lines_are_rejected(line: str) -> None:
    with pytest.raises(ForgeError):
        parse(Source("pkg", "msg/X.msg", Path("x.msg"), f"{line}\n"))


# --- Packages -----------------------------------------------------------------------------------------------


@quick
@given(hostile("\0"), st.sampled_from(["name", "depend", "version", "build_type"]))
@example(f"x) execute_process(COMMAND touch {CANARY}", "depend")
@example("../../x", "name")
@example("*/\n#error sprung_canary\n", "build_type")
def test_hostile_manifests_are_rejected_or_harmless(text: str, tag: str) -> None:
    from xml.sax.saxutils import escape

    content = manifest_text(
        "pkg", f'<depend version_gte="1">{escape(text)}</depend>' if tag == "depend" else ""
    )
    if tag != "depend":
        content = re.sub(f"<{tag}>.*</{tag}>", lambda _: f"<{tag}>{escape(text)}</{tag}>", content)
    try:
        manifest = parse_manifest(content.encode(), Path("package.xml"), {})
    except WorkspaceError:
        return
    variables = manifest_variables(manifest)
    # A quoted value may have several lines.
    assert re.fullmatch(r'(?:#[^\n]*\n|set\([\w.+-]+ "(?:[^"\\]|\\.)*"\)\n|\n)*', variables), variables
    assert "/" not in manifest.name
    assert manifest.name != ".."


@pytest.mark.parametrize(
    "name",
    ["../x", "/x", "a/b", "..", ".", ".git", "-rf", "a b", "a\nb", "$(x)", "a'b", 'a"b', "x" * 300],
)
def test_invalid_package_names_are_rejected(name: str, tmp_path: Path) -> None:
    (tmp_path / "colcon.pkg").write_text(json.dumps({"name": name, "type": "cmake"}))
    (tmp_path / "CMakeLists.txt").write_text("project(x)\n")
    found = identify(tmp_path, Path(), ["colcon.pkg", "CMakeLists.txt"], {}, Overrides())
    assert found.package is None
    assert "invalid package name" in found.problems[0].message


@pytest.mark.parametrize("hook", ["../x.sh", "/x.sh", "a/../../x.sh", "a\nset;PATH;x", "", 5, {}])
def test_hooks_outside_the_package_are_rejected(hook: object, tmp_path: Path) -> None:
    (tmp_path / "package.xml").write_text(manifest_text("pkg"))
    (tmp_path / "colcon.pkg").write_text(json.dumps({"hooks": [hook]}))
    found = identify(tmp_path, Path(), ["package.xml", "colcon.pkg"], {}, Overrides())
    assert "'hooks' of 'pkg'" in found.problems[0].message


@pytest.mark.parametrize("relative", ["../X.msg", "/X.msg", "msg/../../X.msg", "msg/../X.msg"])
def test_definitions_outside_the_package_are_rejected(relative: str, tmp_path: Path) -> None:
    (tmp_path / "msg").mkdir()
    (tmp_path / "X.msg").write_text("int8 a\n")
    with pytest.raises(ForgeError, match="must be relative and without"):
        read_source("pkg", tmp_path, relative)


@pytest.mark.parametrize(
    "line",
    [
        "source;../x.sh",
        "source;a/../../x.sh",
        "source;",
        "source;/",
        "source;..",
        "set;A B;c",
        "set;A;b\0",
        "set;$A;b",
    ],
)
def test_invalid_hook_lines_are_rejected(line: str) -> None:
    with pytest.raises(WorkspaceError, match="invalid environment hook"):
        parse_dsv(f"{line}\n", "package.dsv")


@quick
@given(hostile("\n", "\r", "\x0b", "\x0c", "\x1c", "\x1d", "\x1e", "\x85", "\u2028", "\u2029", "\0"))
def test_hook_lines_are_single_operations(text: str) -> None:
    changes, sources = parse_dsv(f"set;VALUE;{text}\n", "package.dsv")
    assert (changes, sources) == ((DsvChange("set", "VALUE", text),), ())
    assert resolve_hooks(changes, lambda _: False)


# --- The rest -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", ["/a\n\ttouch b\n", "/a;touch b"])
def test_paths_that_make_cannot_represent_are_rejected(path: str, tmp_path: Path) -> None:
    with pytest.raises(HostError, match="make cannot handle the path"):
        write_depfile(tmp_path / "deps", Path("x"), [Path(path)])


def test_error_messages_contain_no_control_characters() -> None:
    content = manifest_text("pkg", "<x\x85y>\u202e</x\x85y>", "<depend>a b\u202e\x9b31m</depend>").encode()
    with pytest.raises(WorkspaceError) as caught:
        parse_manifest(content, Path("package.xml"), {})
    assert not re.search("[\x1b\x80-\x9f\u202e]", str(caught.value))


def test_the_substitute_test_result_is_valid_xml() -> None:
    text = render_template("testing/error_result.xml.j2", package="a.b-c+d", test="pytest", message="<>")
    assert parse_xml(text.encode(), Path("pytest.xml")).attributes["name"] == "a.b-c+d"
