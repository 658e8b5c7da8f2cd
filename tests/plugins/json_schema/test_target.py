"""Schemas accept each message as JSON, and nothing else, says the library jsonschema."""

import json
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from jsonschema.exceptions import ValidationError

from forge.base.distributions import EMBEDDED
from forge.interfaces import load
from forge.interfaces.model import sections_of
from forge.plugins.json_schema.target import files
from tests.conftest import Forge, Tree
from tests.generated import embedded_catalog, probe_catalog
from tests.messages import messages

PACKAGES = sorted(path.parent.name for path in EMBEDDED.glob("*/msg") if path.parent.name != "service_msgs")


def validator(schema: dict[str, Any]) -> Draft202012Validator:
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


@cache
def validators(package: str) -> dict[str, Draft202012Validator]:
    """Return the validators of an embedded package by the names of its types."""
    found = map(json.loads, (file.text for file in files(embedded_catalog(package))))
    return {schema["title"]: validator(schema) for schema in found}


@cache
def messages_of(package: str) -> list[tuple[str, Any]]:
    types = load(EMBEDDED / package, package)
    return [(name, types[name]) for name in types if name.startswith(f"{package}/msg/")]


@settings(max_examples=3, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
@pytest.mark.parametrize("package", PACKAGES)
def test_each_embedded_message_is_valid(package: str, data: st.DataObject) -> None:
    known = validators(package)
    for name, class_ in messages_of(package):
        convert = import_module("rosidl_runtime_py").message_to_ordereddict
        value = json.loads(json.dumps(convert(data.draw(messages(class_)))))
        known[name].validate(value)
        for field in list(value)[:1]:
            with pytest.raises(ValidationError):
                known[name].validate({key: each for key, each in value.items() if key != field})
            with pytest.raises(ValidationError):
                known[name].validate({**value, field: {"not": "a field"}})


def test_every_interface_has_schemas() -> None:
    catalog = probe_catalog()
    parts = {str(part.name) for each in catalog.interfaces.values() for part in sections_of(each)}
    assert {json.loads(file.text)["title"] for file in files(catalog)} == parts


@pytest.mark.parametrize(
    ("line", "good", "bad"),
    [
        ("int8 x", [-128, 127], [128, -129, 1.5, "1", None]),
        ("uint64 x", [0, 2**64 - 1], [-1, 2**64]),
        ("bool x", [True], [1, "true"]),
        ("float32 x", [1, 1.5], ["1.5"]),
        ("byte x", [0, 255, "a"], [256, "ab", ""]),
        ("string<=2 x", ["", "ab"], ["abc", 1]),
        ("int8[2] x", [[1, 2]], [[1], [1, 2, 3], "12"]),
        ("int8[<=2] x", [[], [1, 2]], [[1, 2, 3], [128]]),
        ("P[] x", [[], [{"y": 1}]], [[{}], [{"y": 1, "z": 2}], {"y": 1}]),
    ],
)
def test_values_that_do_not_match_are_rejected(
    line: str, good: list[object], bad: list[object], forge: Forge, tree: Tree
) -> None:
    root = tree({"src/msg/M.msg": f"{line}\n", "src/msg/P.msg": "int8 y\n"})
    words = ("interface", "generate", "--package", "p", "--lang", "jsonschema", "--output", "out", "src")
    assert forge(*words, cwd=root).code == 0
    schema = json.loads((root / "out/jsonschema/p/msg/M.schema.json").read_text())
    for value in good:
        validator(schema).validate({"x": value})
    for value in bad:
        with pytest.raises(ValidationError):
            validator(schema).validate({"x": value})


def test_schemas_are_json_for_all_numbers(forge: Forge, tree: Tree) -> None:
    root = tree({"src/msg/M.msg": "float64 I=inf\nfloat32 x nan\nfloat32[] y [1, inf]\n"})
    words = ("interface", "generate", "--package", "p", "--lang", "jsonschema", "--output", "out", "src")
    assert forge(*words, cwd=root).code == 0
    text = (root / "out/jsonschema/p/msg/M.schema.json").read_text()
    schema = json.loads(text, parse_constant=pytest.fail)
    assert schema["x-constants"] == {"I": "inf"}
    assert not any("default" in each for each in schema["properties"].values())


def test_schemas_contain_comments_defaults_and_constants(forge: Forge, tree: Tree) -> None:
    text = "# About it.\n\nfloat32 v 1.5  # how fast [m/s]\nuint8 OK=1\n"
    root = tree({"src/msg/M.msg": text})
    words = ("interface", "generate", "--package", "p", "--lang", "jsonschema", "--output", "out", "src")
    assert forge(*words, cwd=root).code == 0
    schema = json.loads(Path(root / "out/jsonschema/p/msg/M.schema.json").read_text())
    assert schema["description"] == "About it."
    assert schema["properties"]["v"] == {"type": "number", "description": "how fast [m/s]", "default": 1.5}
    assert schema["x-constants"] == {"OK": 1}
