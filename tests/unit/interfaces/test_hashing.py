"""Type hashes and stored descriptions against known values."""

from __future__ import annotations

import json

import pytest

from forge.base.standard_interfaces import EMBEDDED
from forge.interfaces.hashing import hashes
from forge.interfaces.model import TypeName
from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library, read_folder
from forge.interfaces.rendering import render
from forge.interfaces.resolve.resolution import resolve
from tests.conftest import Tree

# Of actions only the interface has its line: the hash covers what is derived from it.
KNOWN = dict(
    line.split()
    for line in """
    builtin_interfaces/msg/Time b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197
    std_msgs/msg/String df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18
    std_msgs/msg/Empty 20b625256f32d5dbc0d04fee44f43c41e51c70d3502f84b4a08e7a9c26a96312
    std_msgs/msg/Char 3ad2d04dd29ba19d04b16659afa3ccaedd691914b02a64e82e252f2fa6a586a9
    std_msgs/msg/Byte 41e1a3345f73fe93ede006da826a6ee274af23dd4653976ff249b0f44e3e798f
    std_msgs/msg/Header f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01
    geometry_msgs/msg/Pose d501954e9476cea2996984e812054b68026ae0bfae789d9a10b23daf35cc90fa
    sensor_msgs/msg/PointCloud2 9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5
    service_msgs/msg/ServiceEventInfo 41bcbbe07a75c9b52bc96bfd5c24d7f0fc0a08c0cb7921b3373c5732345a6f45
    std_srvs/srv/Empty 5888399dedec5ccc85ea6451949fd2c9f97bfdf963f9a588821639fcd31b5d19
    example_interfaces/srv/AddTwoInts e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a
    example_interfaces/srv/AddTwoInts_Event 32c1d140259c71e5c355115942bcb31df98b4330e4d906b1b75ccb1c9b3ce6c8
    example_interfaces/action/Fibonacci 9508051da1ea4658de144b09bd0690ff3de52104683d847aed764d2915906f51
    """.strip().splitlines()
)


@pytest.mark.parametrize("package", sorted({name.partition("/")[0] for name in KNOWN}))
def test_embedded_types_have_the_reference_hashes(package: str) -> None:
    found = hashes(resolve(package, parse_all(read_folder(package, EMBEDDED / package)), Library()))
    expected = {name: f"RIHS01_{digits}" for name, digits in KNOWN.items() if name.startswith(f"{package}/")}
    assert {str(name): text for name, text in found.items() if str(name) in expected} == expected


def test_type_ids_follow_rep_2011(tree: Tree) -> None:
    lines = [
        "wstring a",
        "string<=5 b",
        "wstring<=6 c",
        "string<=7[3] d",
        "bool[<=2] e",
        "byte[] f",
        "char[16] g",
        "float32 h",
    ]
    folder = tree({"msg/All.msg": "\n".join(lines)})
    catalog = resolve("tour", parse_all(read_folder("tour", folder)), Library())
    (file,) = render(catalog, "json")
    stored = json.loads(file.text)["type_description_msg"]["type_description"]
    types = [
        (f["type"]["type_id"], f["type"]["capacity"], f["type"]["string_capacity"]) for f in stored["fields"]
    ]
    assert types == [
        (18, 0, 0),
        (21, 0, 5),
        (22, 0, 6),
        (69, 3, 7),
        (111, 2, 0),
        (160, 0, 0),
        (51, 16, 0),
        (10, 0, 0),
    ]


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
