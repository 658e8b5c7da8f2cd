"""`forge interface schema`: schemas as stored by MCAP and rosbag2."""

import pytest

from forge.interfaces.hashing import hashes
from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library
from forge.interfaces.resolve.resolution import require, resolve
from forge.interfaces.schema import read_schema
from forge.plugins.interface_queries.schema import schema_text
from tests.conftest import Forge, Tree
from tests.generated import reads_idl

LINE = "=" * 80
LIBRARY = Library()
NAMES = sorted(name for name in LIBRARY.names() if name.kind == "msg")

FILES = {
    "msg/Top.msg": "# What it is.\n\nInner[] inner  # one\nother_msgs/Far far\nInner again\n",
    "msg/Inner.msg": "int8 a # [m]\nother_msgs/Far far",
    "srv/Ask.srv": "Inner inner\n---\nother_msgs/Far far\n",
    "other/msg/Far.msg": "",
    "idl/Only.idl": "module tour { module idl { struct Only { tour::msg::Inner inner; }; }; };\n",
}


def test_schemas_contain_definitions_depth_first(forge: Forge, tree: Tree) -> None:
    root = tree(FILES)
    includes = ["--include", f"tour={root}", "--include", f"other_msgs={root / 'other'}"]
    ran = forge("interface", "schema", "tour/msg/Top", *includes)
    assert ran.err == ""
    assert ran.out == (
        f"{FILES['msg/Top.msg']}\n{LINE}\nMSG: other_msgs/Far\n\n"
        f"{LINE}\nMSG: tour/Inner\nint8 a # [m]\nother_msgs/Far far"
    )
    service = forge("interface", "schema", "tour/srv/Ask", *includes).out
    assert service.startswith(f"{FILES['srv/Ask.srv']}\n{LINE}\nMSG: other_msgs/Far\n")


@reads_idl
def test_a_schema_in_idl_names_every_type_in_full(forge: Forge, tree: Tree) -> None:
    root = tree(FILES)
    includes = ["--include", f"tour={root}", "--include", f"other_msgs={root / 'other'}"]
    out = forge("interface", "schema", "tour/idl/Only", "--encoding", "ros2idl", *includes).out
    assert out.startswith(
        f"{LINE}\nIDL: tour/idl/Only\n{FILES['idl/Only.idl']}\n{LINE}\nIDL: tour/msg/Inner\n//"
    )
    ran = forge("interface", "schema", "tour/idl/Only", *includes)
    assert (ran.code, ran.err.splitlines()[-1]) == (2, "hint: use --encoding ros2idl")
    assert "error: 'tour/idl/Only' is written in IDL" in ran.err


def test_a_schema_of_a_missing_type_is_an_error(forge: Forge, tree: Tree) -> None:
    ran = forge("interface", "schema", "std_msgs/msg/Strin")
    assert ran.err.splitlines() == [
        "error: unknown type 'std_msgs/msg/Strin'",
        "hint: did you mean 'std_msgs/msg/String'?",
    ]
    root = tree({"msg/A.msg": "gone_msgs/B b"})
    ran = forge("interface", "schema", "tour/msg/A", "--include", f"tour={root}")
    assert (ran.code, "unknown type 'gone_msgs/B'" in ran.err) == (2, True)


@pytest.mark.parametrize("encoding", ["ros2msg", pytest.param("ros2idl", marks=reads_idl)])
def test_schemas_round_trip(encoding: str) -> None:
    """The definitions that are read back have the same type hash, for all embedded messages."""
    for name in NAMES[:: 1 if encoding == "ros2msg" else 3]:
        text = schema_text(require(name, LIBRARY), lambda each: require(each, LIBRARY), encoding)
        sources = read_schema(text, name)
        assert (sources[0].package, sources[0].path.stem) == (name.package, name.name)
        parsed = {each.interface.name: each for each in parse_all(sources)}
        expected = require(name, LIBRARY).interface
        assert parsed[name].interface == expected
        own = [each for each in parsed.values() if each.interface.name.package == name.package]
        found = hashes(resolve(name.package, own, LIBRARY))[name]
        reference = [require(each, LIBRARY) for each in parsed if each.package == name.package]
        assert found == hashes(resolve(name.package, reference, LIBRARY))[name]
