"""protoc compiles each .proto file, and every message goes to Protocol Buffers and back unchanged."""

import math
from collections.abc import Iterator
from importlib import import_module
from itertools import chain
from typing import Any

import pytest
from google.protobuf.json_format import MessageToDict
from grpc_tools import protoc
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from forge.base.distributions import EMBEDDED
from forge.base.errors import InterfaceError
from forge.base.files import write_if_changed
from forge.interfaces.model import sections_of
from forge.interfaces.python import target as python
from forge.interfaces.python.types import module_name
from forge.plugins.protobuf.forge_protobuf import from_proto, to_proto
from forge.plugins.protobuf.target import files
from tests.generated import catalog_of, embedded_catalog, importable, probe_catalog
from tests.messages import messages

PACKAGES = sorted(
    {path.parent.name for kind in ("msg", "srv", "action") for path in EMBEDDED.glob(f"*/{kind}")}
)
AWKWARD = catalog_of(
    "option",
    {
        "msg/Message.msg": "int8 a_1\nint8 a1\nint8 a1_field3\nint8 foo_bar\nint8 foobar\nMap message\n",
        "msg/Map.msg": "string string 'x'\nbool repeated\nuint8[] bytes\nfloat32 optional\nint8 descriptor\n",
        "msg/Sizes.msg": "uint8[2] raw\nuint16[2] numbers\nMap[1] maps\nint8 small\n"
        "float64[] reals\nuint64 big\n",
    },
)


@pytest.fixture(scope="module")
def classes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, list[Any]]]:
    """Make the classes of all packages importable; return those of each package."""
    folder = tmp_path_factory.mktemp("protobuf")
    catalogs = [probe_catalog(), AWKWARD, *map(embedded_catalog, PACKAGES)]
    for file in chain.from_iterable(chain(files(catalog), python.files(catalog)) for catalog in catalogs):
        write_if_changed(folder / file.path, file.text)
    paths = [path.relative_to(folder).as_posix() for path in folder.rglob("*.proto")]
    assert protoc.main(["protoc", f"-I{folder}", f"--python_out={folder}", *paths]) == 0
    with importable(folder):
        yield {
            catalog.package: [
                getattr(import_module(module_name(interface.name)), part.name.name)
                for interface in catalog.interfaces.values()
                for part in sections_of(interface)
            ]
            for catalog in catalogs
        }


@settings(max_examples=5, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(data=st.data())
@pytest.mark.parametrize("package", ["probe", "option", *PACKAGES])
def test_each_message_comes_back_unchanged(
    package: str, classes: dict[str, list[Any]], data: st.DataObject
) -> None:
    for class_ in classes[package]:
        message = data.draw(messages(class_))
        proto = to_proto(message)
        assert from_proto(type(proto).FromString(proto.SerializeToString()), class_) == message


@pytest.fixture
def awkward(classes: dict[str, list[Any]]) -> dict[str, Any]:
    return {class_.__name__: class_ for class_ in classes["option"]}


def test_values_at_the_limits_come_back(awkward: dict[str, Any]) -> None:
    message = awkward["Sizes"](reals=[math.nan, math.inf, -math.inf, -0.0], big=2**64 - 1, small=-128)
    back = from_proto(to_proto(message), awkward["Sizes"])
    assert (repr(back), math.copysign(1, back.reals[3])) == (repr(message), -1)


@pytest.mark.parametrize(("field", "size"), [("raw", 2), ("numbers", 2), ("maps", 1)])
def test_a_fixed_array_of_another_size_is_an_error(field: str, size: int, awkward: dict[str, Any]) -> None:
    proto = to_proto(awkward["Sizes"]())
    proto.ClearField(field)
    with pytest.raises(ValueError, match=f"^'option.msg.pb.Sizes.{field}' has 0 elements instead of {size}$"):
        from_proto(proto, awkward["Sizes"])


def test_a_number_out_of_range_is_an_error(awkward: dict[str, Any]) -> None:
    proto = to_proto(awkward["Sizes"]())
    proto.small = 128
    with pytest.raises(AssertionError, match=r"The 'small' field must be an integer in \[-128, 127\]"):
        from_proto(proto, awkward["Sizes"])


def test_fields_have_different_names_in_json(awkward: dict[str, Any]) -> None:
    numbers = {"a_1": 1, "a1": 2, "a1_field3": 3, "foo_bar": 4, "foobar": 5}
    names = {"a1": 1, "a1Field2": 2, "a1Field3": 3, "fooBar": 4, "foobarField5": 5}
    message = MessageToDict(to_proto(awkward["Message"](**numbers)))
    assert message == {**names, "message": {"string": "x"}}


def test_definitions_contain_comments_and_the_original_types() -> None:
    text = (
        "# About it.\n\nuint8 OK=1  # fine\n# How\nfloat32 v 1.5  # fast [m/s]\n"
        "uint8[<=3] raw\ngeometry_msgs/Point[2] points\n"
    )
    catalog = catalog_of("p", {"msg/M.msg": text})
    made = {file.path: file.text for file in files(catalog)}
    assert made.keys() == {"forge_protobuf.py", "p/msg/M.proto"}
    assert (
        made["p/msg/M.proto"]
        == """// p/msg/M; generated by forge, do not edit.

syntax = "proto3";

package p.msg.pb;

import "geometry_msgs/msg/Point.proto";

// About it.
message M {
  // fine
  // uint8 OK=1

  // How
  // fast [m/s]
  float v = 1;  // float32 v 1.5
  bytes raw = 2;  // uint8[<=3] raw
  repeated .geometry_msgs.msg.pb.Point points = 3;  // geometry_msgs/Point[2] points
}
"""
    )


def test_a_long_double_is_an_error() -> None:
    idl = "module p { module msg { struct L { long double x; }; }; };"
    with pytest.raises(InterfaceError, match="no type for the long double 'x'"):
        list(files(catalog_of("p", {"msg/L.idl": idl})))
