"""Compiled templates against EmPy itself, in both of its versions."""

import importlib.util
import io
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from forge.plugins.fast_rosidl.empy import CompiledTemplates, install
from tests.plugins.fast_rosidl.expand import expanded
from tests.rosidl import DEBIAN, EMPY, RESOURCES

pytestmark = pytest.mark.needs(*map(str, EMPY.values()))

EXPAND = Path(__file__).with_name("expand.py")

ORDINARY = [
    "plain text\nwith lines\n",
    "@one @(one + 1) @text. @(none)@none|",
    "@(text)@text.upper()@table['key']@items[0]",
    "@[if one]yes@[else]no@[end if]",
    "@[if none]a@[elif one]b@[else]c@[end if]",
    "@[for item in items]@item,@[end for]\n@item",
    "@[for name, number in pairs]@name=@number;@[end for]",
    "@[for (name, number) in pairs]@(name)@[end for]",
    "@[for item in items]@[if item == 2]@[continue]@[end if]@item@[end for]",
    "@[for item in items]@[if item == 2]@[break]@[end if]@item@[else]else@[end for]",
    "@[for item in []]@item@[else]else@[end for]",
    "@[while items]@items.pop()@[end while]",
    "@{a = 1\nb = a + 1\n}@a@b",
    "@{\nimport os\ndef twice(x):\n    return 2 * x\n}@(twice(2))@(os.sep)",
    "@{print('printed')}@{print(one, end='')}",
    "@# a comment\nafter\n",
    "@@ @ spaces\n@\tand\n@\nlines",
    "@('@' + text)@(', '.join(str(i) for i in items))",
    "@{x = [i for i in items if i > 1]}@x@(locals()['one'])@('x' in globals())",
    "@(TEMPLATE('inner @a @[for i in b]@i@[end for]', a=1, b=[1, 2]))outer@one",
    "@[for item in items]@(TEMPLATE('@item ', item=item))@[end for]",
    "@{text = '''a\n  b\n'''}@text",
    "@( one )@(\tone)@(one\n)",
    "@(text if one else none)@(str((lambda: 1)()))",
    "no newline at the end @one",
    "@one",
    "",
    "é \U0001f600 @('ü')",
]
HOSTILE = [
    "@(1)@(True)@(0)@(False)@[if 1]a@[end if]@[if False]b@[end if]",
    "@[continue]",
    "@[break]after",
    "@[for i in items]@(TEMPLATE('@[break]'))@i@[end for]",
    "@[for i in items]@{continue}@i@[end for]",
    "@[for i in items]@{break}@i@[end for]",
    "@{return}",
    "@{'a docstring'}@(locals().get('__doc__'))",
    "@{global one}@{one = 5}@one",
    "@{x: int = 1}@(locals().get('__annotations__'))",
    "@{from __future__ import annotations}",
    "@(yield)",
    "@(one ? 'then' ! 'else')@(none ? 1 ! 2)@(missing $ 'default')",
    "@[try]@missing@[except NameError]caught@[end try]",
    "@[def twice(x)]@x@x@[end def]@twice(2)",
    "@[while items]@items.pop()@[else]else@[end while]",
    "@[if one]a@[else]b@[else]c@[end if]",
    "@[if one]unfinished",
    "@[end for]",
    "@[unknown x]@[end unknown]",
    "@[if]@[end if]",
    "@[for x of items]@x@[end for]",
    "@[for self.x in items]@x@[end for]",
    "@[for *x, y in pairs]@x@[end for]",
    "@[for a, b, c in pairs]@a@[end for]",
    "@[for x in none]@x@[end for]",
    "@missing",
    "@(1 / 0)",
    "@(",
    "@{",
    "@{if one:}",
    "@(one two)",
    "@(empy.write('direct'))@empy.identify()",
    "@{empy.pushContext('other', 3)}",
    "@'string literal'@\"another\"",
    "@`'repr'`",
    "@:one:unknown:",
    "@$one$unknown$",
    "@%key value\nafter",
    "@?name\n@!5\n@empy.identify()",
    "@\\n@\\t@\\x41@\\u0042@\\^[",
    "@<custom>",
    "@*inline comment*after",
    "@-off\nhidden@+on\nshown",
    "@one{a}{b}",
    "@)@]@}",
    "@",
    "a@",
    "@one@",
    "text@#comment without a newline",
    "@[if one]@# comment ]\nx@[end if]",
    "@(text.replace('(', ')'))@('[' + ']')",
    "@{import sys; sys.stdout.write('written')}",
    "@{__forge_write__ = None}@one",
    "@(dir())",
    "@(sorted(vars()))",
    "@{del one}@one",
    "@[for one in items]@[end for]@one",
    "@{class A:\n  b = one\n}@A.b",
    "@{f = lambda: one}@f()",
    "@[if one]\r\n@{a = 1\r\nb = 2\r\n}@a@b\r\n@[end if]",
    "#! bangpath\n@one",
    "@{x = 1; raise ValueError(x)}",
]


def compared(version: str, templates: list[str]) -> tuple[list[list[Any]], int]:
    """Return the results of both, and how many templates were compiled."""
    done = subprocess.run(
        [sys.executable, EXPAND, EMPY[version]],
        input=json.dumps(templates),
        capture_output=True,
        text=True,
        check=True,
    )
    found = json.loads(done.stdout[done.stdout.index('{"pairs"') :])
    return found["pairs"], found["compiled"]


@pytest.mark.parametrize("version", EMPY)
def test_compiled_templates_give_the_same_output_as_empy(version: str) -> None:
    pairs, compiled = compared(version, ORDINARY)
    differences = [
        (template, *pair) for template, pair in zip(ORDINARY, pairs, strict=True) if pair[0] != pair[1]
    ]
    assert differences == [], differences
    assert compiled == len(ORDINARY)


@pytest.mark.parametrize("version", EMPY)
def test_hostile_templates_give_the_same_output_or_fail(version: str) -> None:
    pairs, _ = compared(version, HOSTILE)
    # A failed command runs once more in a separate process, so only the output of a success counts.
    differences = [
        (template, expected, actual)
        for template, (expected, actual) in zip(HOSTILE, pairs, strict=True)
        if expected != actual and not isinstance(actual, str)
    ]
    assert differences == [], differences


def load(version: str) -> Any:
    """Import EmPy under a name of its own."""
    spec = importlib.util.spec_from_file_location(f"em_{version}", EMPY[version])
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("version", EMPY)
def test_compiled_templates_are_kept_in_files(version: str, tmp_path: Path) -> None:
    em = load(version)
    first = CompiledTemplates(em, tmp_path / "cache")
    codes = [first.code(template) for template in (*ORDINARY, *HOSTILE)]
    assert None not in codes[: len(ORDINARY)]
    assert None in codes
    files = sorted((tmp_path / "cache").iterdir())
    assert len(files) == len({*ORDINARY, *HOSTILE})
    files[0].write_bytes(b"damaged")
    files[1].write_bytes(files[2].read_bytes())
    second = CompiledTemplates(em, tmp_path / "cache")
    assert [second.code(template) for template in (*ORDINARY, *HOSTILE)] == codes


@pytest.mark.parametrize("version", EMPY)
def test_interpreters_run_compiled_templates(version: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    em = load(version)
    monkeypatch.setitem(sys.modules, "em", em)
    expected = [expanded(em, template) for template in (*ORDINARY, "@empy.identify()")]
    compiled = CompiledTemplates(em, None)
    install(em, compiled)
    assert [expanded(em, template) for template in (*ORDINARY, "@empy.identify()")] == expected


# But not those that ask for their position: it does not count what a compiled template within them writes.
PIECES = st.sampled_from(
    [
        *ORDINARY,
        *(template for template in HOSTILE if "identify" not in template),
        *(" ", "\n", "x", "@[end if]", "@[end for]", "@[if one]", "@[else]"),
    ]
)


@pytest.mark.parametrize("version", EMPY)
@settings(max_examples=8, phases=(Phase.generate,))
@given(templates=st.lists(st.lists(PIECES, max_size=5).map("".join), min_size=40, max_size=40))
def test_combined_constructs_give_the_same_output_or_fail(version: str, templates: list[str]) -> None:
    pairs, _ = compared(version, templates)
    for template, (expected, actual) in zip(templates, pairs, strict=True):
        assert expected == actual or isinstance(actual, str), template


@pytest.mark.parametrize("version", EMPY)
@pytest.mark.needs(str(DEBIAN))
def test_all_rosidl_templates_are_compiled(version: str) -> None:
    templates = [path.read_text(encoding="utf-8") for folder in RESOURCES for path in folder.glob("*.em")]
    assert len(templates) > 30
    code = (
        "import importlib.util, json, sys\n"
        "from forge.plugins.fast_rosidl.empy import compile_template\n"
        "sys.path.insert(0, sys.argv[1])\n"
        "import em\n"
        "print(len([compile_template(em, text) for text in json.load(sys.stdin)]))\n"
    )
    argv = [sys.executable, "-c", code, str(EMPY[version].parent)]
    done = subprocess.run(argv, input=json.dumps(templates), capture_output=True, text=True, check=True)
    assert int(done.stdout) == len(templates)
