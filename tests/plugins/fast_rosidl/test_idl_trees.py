"""Fast syntax trees against those of a real rosidl_parser: what it makes of both is the same."""

from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from lark import Lark
from lark.exceptions import LarkError

import forge
from forge.plugins.fast_rosidl import generators
from forge.plugins.fast_rosidl.generators import described, fast_parser
from tests.conftest import Forge
from tests.rosidl import MODULES, imported_anew

pytestmark = pytest.mark.needs(str(MODULES / "rosidl_parser"))

HOME = Path(forge.__file__).parent
PROBES = sorted(Path(generators.__file__).with_name("probes").glob("*.idl"))


@pytest.fixture(scope="module")
def parser() -> Iterator[Any]:
    """Import Debian's rosidl_parser with the lark of this interpreter; other tests use that of forge."""
    with imported_anew("rosidl_parser"):
        yield import_module("rosidl_parser.parser")


@pytest.fixture(scope="module")
def trees() -> Lark:
    return fast_parser()


def same(parser: Any, trees: Lark, text: str) -> bool:
    """Tell whether both ways give the same objects."""
    fast = parser.extract_content_from_ast(trees.parse(text))
    return bool(described(fast) == described(parser.parse_idl_string(text)))


@pytest.mark.parametrize("probe", PROBES, ids=lambda path: path.stem)
def test_probe_files_are_parsed_as_by_rosidl(parser: Any, trees: Lark, probe: Path) -> None:
    assert same(parser, trees, probe.read_text(encoding="utf-8"))


@pytest.mark.parametrize("package", ["diagnostic_msgs", "example_interfaces", "rcl_interfaces", "std_msgs"])
def test_standard_interfaces_are_parsed_as_by_rosidl(
    parser: Any, trees: Lark, forge: Forge, tmp_path: Path, package: str
) -> None:
    source = HOME / "embedded" / package
    done = forge(
        "interface", "generate", "--package", package, "--output", str(tmp_path), "--lang", "idl", str(source)
    )
    assert done.code == 0, done.err
    files = sorted(tmp_path.rglob("*.idl"))
    assert files
    assert [path.name for path in files if not same(parser, trees, path.read_text(encoding="utf-8"))] == []


MESSAGE = "module p {{ module msg {{ {} }}; }};"


@pytest.mark.parametrize(
    "text",
    [
        "struct M { @default (value=010) long a; };",
        "struct M { @default (value=+1) long a; };",
        "struct M { @default (value=~1) long a; };",
        "struct M { @default (value=(1)) long a; };",
        "struct M { @default (value=a::b) long a; };",
        'struct M { @verbatim (language="comment", text="a" L"b") long a; };',
        "@key typedef long t; struct M { t a; };",
        "module Empty { }; struct M { long a; };",
        "module M_Constants { const other A = 1; }; struct M { long a; };",
    ],
)
def test_unsupported_definitions_are_left_to_rosidl(trees: Lark, text: str) -> None:
    with pytest.raises(LarkError):
        trees.parse(MESSAGE.format(text))


def outcome(parser: Any, way: Callable[[str], object], text: str) -> object:
    """Return what rosidl makes of a tree, or the type of the error."""
    try:
        return described(parser.extract_content_from_ast(way(text)))
    except Exception as error:
        return type(error).__name__


@pytest.mark.parametrize(
    "text",
    [
        "struct M { long a[2][3]; };",
        "struct M { unknown a; };",
        "struct M { @default (value=missing) long a; };",
        "struct A { long a; }; struct B { long a; }; struct C { long a; }; struct D { long a; };",
        "typedef long t; typedef short t; struct M { t a; };",
    ],
)
def test_definitions_rejected_by_rosidl_are_rejected(parser: Any, trees: Lark, text: str) -> None:
    ways = (trees.parse, parser.get_ast_from_idl_string)
    fast, slow = (outcome(parser, way, MESSAGE.format(text)) for way in ways)
    assert fast == slow
