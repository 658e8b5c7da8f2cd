"""Type hashes and stored descriptions against known values."""

import json

from forge.interfaces.hashing import hashes
from forge.interfaces.model import TypeName
from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library, read_folder
from forge.interfaces.resolve.resolution import resolve
from tests.conftest import Tree
from tests.generated import render


def test_type_ids_follow_rep_2011(tree: Tree) -> None:
    types = "wstring string<=5 wstring<=6 string<=7[3] bool[<=2] byte[] char[16] float32".split()
    folder = tree({"msg/All.msg": "\n".join(f"{type_} f{n}" for n, type_ in enumerate(types))})
    catalog = resolve("tour", parse_all(read_folder("tour", folder)), Library())
    (file,) = render(catalog, "json")
    stored = json.loads(file.text)["type_description_msg"]["type_description"]
    described = [field["type"] for field in stored["fields"]]
    assert [type_["type_id"] for type_ in described] == [18, 21, 22, 69, 111, 160, 51, 10]
    assert [type_["capacity"] for type_ in described] == [0, 0, 0, 3, 2, 0, 16, 0]
    assert [type_["string_capacity"] for type_ in described] == [0, 5, 6, 7, 0, 0, 0, 0]


def test_the_stored_description_has_defaults_and_the_hash_of_each_type(tree: Tree) -> None:
    folder = tree(
        {"msg/Outer.msg": "Inner inner\nbool a true\nint8[] b [1, 2]\nstring c", "msg/Inner.msg": "int8 x 50"}
    )
    catalog = resolve("tour", parse_all(read_folder("tour", folder)), Library())
    files = {file.path: json.loads(file.text) for file in render(catalog, "json")}
    outer = files["json/tour/msg/Outer.json"]
    fields = outer["type_description_msg"]["type_description"]["fields"]
    assert [f["default_value"] for f in fields] == ["", "True", "(1, 2)", ""]
    assert [t["type_name"] for t in outer["type_hashes"]] == ["tour/msg/Outer", "tour/msg/Inner"]
    (inner,) = outer["type_description_msg"]["referenced_type_descriptions"]
    assert inner == files["json/tour/msg/Inner.json"]["type_description_msg"]["type_description"]


def test_defaults_and_constants_do_not_change_a_hash(tree: Tree) -> None:
    folder = tree({"msg/A.msg": "# doc\nint8 A=1\nint8 x 5 # [m]"})
    name = TypeName("tour", "msg", "A")
    plain = hashes(resolve("tour", parse_all(read_folder("tour", folder)), Library()))[name]
    tree({"msg/A.msg": "int8 x"})
    assert hashes(resolve("tour", parse_all(read_folder("tour", folder)), Library()))[name] == plain
