"""Every message goes to Arrow and back unchanged; schemas have comments and units."""

import math
from collections.abc import Iterator
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings

from forge.base.files import write_if_changed
from forge.interfaces.model import Field, Message, Primitive, Sequence, TypeName
from forge.interfaces.python import target as python
from forge.interfaces.read.sources import Library
from forge.plugins.arrow.target import files
from tests.generated import catalog_of, embedded_catalog, importable, probe_catalog, section_classes
from tests.messages import messages

PACKAGES = sorted(Library().packages())
OURS = catalog_of(
    "ours",
    {
        "msg/Sizes.msg": "uint8[2] raw\nfloat64[] reals\nuint64 big\nint8 small\nEmpty empty\n",
        "msg/Empty.msg": "# Nothing.\n",
        "msg/Texts.msg": (
            "# About it.\n\nfloat32 v  # how fast [m/s]\nuint8[<=3] raw\nbyte[2] pair\nstring<=3[2] names\n"
            "geometry_msgs/Point[] points\nwstring plain\n"
        ),
    },
    Message(
        TypeName("ours", "msg", "Letters"),
        (
            Field("one", Primitive("char")),
            Field("wide", Primitive("wchar")),
            Field("many", Sequence(Primitive("wchar"))),
            Field("few", Sequence(Primitive("char"), 2)),
        ),
    ),
)


@pytest.fixture(scope="module")
def classes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, list[Any]]]:
    """Make forge_arrow and the classes of all packages importable; return the classes of each package."""
    folder = tmp_path_factory.mktemp("arrow")
    catalogs = [probe_catalog(), OURS, *map(embedded_catalog, PACKAGES)]
    for file in chain.from_iterable(chain(files(catalog), python.files(catalog)) for catalog in catalogs):
        write_if_changed(folder / file.path, file.text)
    with importable(folder):
        yield {catalog.package: section_classes(catalog) for catalog in catalogs}


@pytest.fixture
def ours(classes: dict[str, list[Any]]) -> dict[str, Any]:
    return {class_.__name__: class_ for class_ in classes["ours"]}


@pytest.fixture
def arrow(classes: dict[str, list[Any]]) -> Any:
    return import_module("forge_arrow")


@pytest.mark.parametrize("package", ["probe", "ours", *PACKAGES])
def test_messages_round_trip(package: str, classes: dict[str, list[Any]], arrow: Any) -> None:
    for class_ in classes[package]:

        @settings(max_examples=3, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
        @given(message=messages(class_))
        def check(message: Any) -> None:
            class_ = type(message)
            sent = [message, message]
            batch = arrow.to_arrow(sent, class_)
            batch.validate(full=True)
            assert batch.schema.equals(arrow.schema(class_), check_metadata=True)
            stream = pa.BufferOutputStream()
            with pa.ipc.new_stream(stream, batch.schema) as writer:
                writer.write_batch(batch)
            (received,) = pa.ipc.open_stream(stream.getvalue())
            assert arrow.from_arrow(received, class_) == sent

        check()


def test_extreme_values_round_trip(arrow: Any, ours: dict[str, Any]) -> None:
    class_ = ours["Sizes"]
    message = class_(reals=[math.nan, math.inf, -math.inf, -0.0], big=2**64 - 1, small=-128, raw=[0, 255])
    (back,) = arrow.from_arrow(arrow.to_arrow([message], class_), class_)
    assert (repr(back), math.copysign(1, back.reals[3])) == (repr(message), -1)


def test_an_empty_batch_has_a_schema(arrow: Any, ours: dict[str, Any]) -> None:
    batch = arrow.to_arrow([], ours["Texts"])
    assert batch.schema == arrow.schema(ours["Texts"])
    assert arrow.from_arrow(batch, ours["Texts"]) == []


def test_messages_round_trip_through_parquet(arrow: Any, ours: dict[str, Any], tmp_path: Path) -> None:
    point = import_module("geometry_msgs.msg").Point(x=1.5)
    sent = [ours["Texts"](), ours["Texts"](v=2.0, raw=[1, 2], pair=[b"a", b"b"], points=[point], plain="ü")]
    path = str(tmp_path / "texts.parquet")
    pq.write_table(pa.Table.from_batches([arrow.to_arrow(sent, ours["Texts"])]), path)
    (batch,) = pq.read_table(path).to_batches()
    assert batch.schema == arrow.schema(ours["Texts"])
    assert batch.schema.field("v").metadata[b"unit"] == b"m/s"
    assert arrow.from_arrow(batch, ours["Texts"]) == sent


def test_a_lone_surrogate_is_an_error(arrow: Any, ours: dict[str, Any]) -> None:
    with pytest.raises(UnicodeEncodeError, match="surrogates not allowed"):
        arrow.to_arrow([ours["Texts"](plain="\ud800")], ours["Texts"])


def test_a_schema_has_types_comments_and_units(arrow: Any, ours: dict[str, Any]) -> None:
    schema = arrow.schema(ours["Texts"])
    assert {field.name: str(field.type) for field in schema} == {
        "v": "float",
        "raw": "binary",
        "pair": "fixed_size_binary[2]",
        "names": "fixed_size_list<item: string not null>[2]",
        "points": "list<item: struct<x: double not null, y: double not null, z: double not null> not null>",
        "plain": "string",
    }
    assert schema.metadata == {b"name": b"ours/msg/Texts", b"comment": b"About it."}
    assert schema.field("v").metadata == {b"comment": b"how fast", b"unit": b"m/s"}
    assert schema.field("raw").metadata is None


def test_a_missing_column_and_a_value_out_of_range_are_errors(arrow: Any, ours: dict[str, Any]) -> None:
    class_ = ours["Sizes"]
    batch = arrow.to_arrow([class_()], class_)
    with pytest.raises(KeyError, match="big"):
        arrow.from_arrow(batch.drop_columns(["big"]), class_)
    wide = batch.set_column(3, "small", pa.array([128]))
    with pytest.raises(AssertionError, match=r"The 'small' field must be an integer in \[-128, 127\]"):
        arrow.from_arrow(wide, class_)
