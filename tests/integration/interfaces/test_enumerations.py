"""Enumerations: the integers of a message with names, in Python and C++, and the same bytes without them."""

import subprocess
from importlib import import_module
from pathlib import Path

import pytest
import yaml

from forge.base.files import write_if_changed
from forge.interfaces.cpp import target as cpp
from forge.interfaces.enumerations import enumerations
from forge.interfaces.hashing import hashes
from forge.interfaces.model import Message
from forge.interfaces.read.sources import Library
from forge.interfaces.resolve.resolution import dependency_catalogs
from tests.generated import RUNTIME, catalog_of, generate, importable

BATTERY = """\
uint8 STATUS_UNKNOWN=0
uint8 STATUS_CHARGING=1
uint8 STATUS_ERROR=2
uint8 STATUS_FAULT=2
int8 TYPE_LIPO=-1
int8 TYPE_18650=1
uint8 status  # enum: STATUS_*
# What it was before.
# enum: STATUS_*
uint8 former
int8[] types  # enum: TYPE_*
"""
PROGRAM = """\
#include <cassert>
#include <string>
#include "cells/msg/battery.hpp"

using cells::msg::Battery;

int main()
{
  Battery battery;
  battery.status = to_value(Battery::Status::CHARGING);
  battery.types = {to_value(Battery::TypeEnum::LIPO)};
  static_assert(sizeof(Battery::Status) == 1);
  static_assert(Battery::Status::FAULT == Battery::Status::ERROR);
  static_assert(Battery::Status{Battery::STATUS_CHARGING} == Battery::Status::CHARGING);
  assert(to_string(Battery::Status{battery.status}) == std::string("CHARGING"));
  assert(to_string(Battery::TypeEnum::TYPE_18650) == std::string("TYPE_18650"));
  assert(to_string(Battery::Status{77}) == nullptr);
  battery.former = 77;
  const auto block = cells::msg::to_yaml(battery);
  assert(block == "status: 1  # CHARGING\\nformer: 77\\ntypes:\\n- -1\\n");
  assert(cells::msg::to_yaml(battery, true) == "{status: 1, former: 77, types: [-1]}");
}
"""


def test_python_enumerations_have_the_constants_as_members(tmp_path: Path) -> None:
    generate(tmp_path, catalog_of("cells", {"msg/Battery.msg": BATTERY}))
    with importable(tmp_path):
        battery = import_module("cells.msg").Battery
        assert [(each.name, each.value) for each in battery.Status] == [
            ("UNKNOWN", 0),
            ("CHARGING", 1),
            ("ERROR", 2),
        ]
        assert battery.Status.FAULT is battery.Status.ERROR
        assert battery.TypeEnum.TYPE_18650 == battery.TYPE_18650
        message = battery(status=battery.Status.CHARGING, former=77, types=[-1])
        assert (message.status, message) == (1, battery(status=1, former=77, types=[-1]))
        assert repr(message) == ("cells.msg.Battery(status=<Status.CHARGING: 1>, former=77, types=[-1])")
        convert = import_module("rosidl_runtime_py.convert")
        text = "status: 1  # CHARGING\nformer: 77\ntypes:\n- -1\n"
        assert convert.message_to_yaml(message) == text
        assert convert.message_to_ordereddict(message) == yaml.safe_load(text)
        assert convert.message_to_csv(message) == "1,77,-1"
        cdr = import_module("forge_cdr")
        assert cdr.serialize(message) == cdr.serialize(battery(status=1, former=77, types=[-1]))


def test_yaml_names_values_in_comments(tmp_path: Path) -> None:
    """Nested ones as well, but not inside of a list on one line."""
    pack = "Battery main\nBattery[] others\nuint8 A_B=1\nuint8 enumerations  # enum: A_*\nuint8 shown\n"
    generate(tmp_path, catalog_of("cells", {"msg/Battery.msg": BATTERY, "msg/Pack.msg": pack}))
    with importable(tmp_path):
        convert, cells = import_module("rosidl_runtime_py.convert"), import_module("cells.msg")
        full = cells.Battery(status=2, former=1)
        message = cells.Pack(main=full, others=[full], enumerations=1)
        assert convert.message_to_yaml(message) == (
            "main:\n  status: 2  # ERROR\n  former: 1  # CHARGING\n  types: []\n"
            "others:\n- status: 2  # ERROR\n  former: 1  # CHARGING\n  types: []\n"
            "enumerations: 1  # B\nshown: 0\n"
        )
        assert convert.message_to_yaml(message, flow_style=True) == (
            "main:\n  status: 2  # ERROR\n  former: 1  # CHARGING\n  types: []\n"
            "others: [{status: 2, former: 1, types: []}]\nenumerations: 1  # B\nshown: 0\n"
        )
        assert repr(message).endswith("enumerations=<A.B: 1>, shown=0)")


@pytest.mark.needs("g++")
def test_cpp_converts_between_values_names_and_numbers(tmp_path: Path) -> None:
    catalog = catalog_of("cells", {"msg/Battery.msg": BATTERY})
    for each in (catalog, *dependency_catalogs(catalog, Library())):
        for file in cpp.files(each):
            write_if_changed(tmp_path / file.path, file.text)
    runtime = RUNTIME.parent / "include"
    argv = [
        "g++",
        "-std=c++17",
        "-Wall",
        "-Wextra",
        "-Wswitch-enum",
        "-Werror",
        "-DERROR=1",
        "-DUNKNOWN=1",
        "-x",
        "c++",
        "-",
    ]
    argv += ["-I", str(tmp_path), "-I", str(runtime), "-o", str(tmp_path / "program")]
    made = subprocess.run(
        argv, input=PROGRAM.replace("::ERROR", "::FAULT"), capture_output=True, text=True, check=False
    )
    assert made.returncode == 0, made.stderr
    assert subprocess.run([tmp_path / "program"], check=False).returncode == 0


@pytest.mark.parametrize(
    ("text", "name", "members"),
    [
        ("uint8 NONE_A=0\nuint8 f # enum: NONE_*", "NoneEnum", ["A"]),
        ("uint8 CONST_SHARED_PTR_A=0\nuint8 f # enum: CONST_SHARED_PTR_*", "ConstSharedPtrEnum", ["A"]),
        ("uint8 T_1=0\nuint8 T_T_1=1\nuint8 f # enum: T_*", "T", ["T_1", "T_T_1"]),
        ("uint8 S_NULL=0\nuint8 S_OFF=1\nuint8 f # enum: S_*", "S", ["S_NULL", "OFF"]),
    ],
)
def test_names_are_valid_in_both_languages(text: str, name: str, members: list[str]) -> None:
    (message,) = catalog_of("p", {"msg/M.msg": text}).interfaces.values()
    assert isinstance(message, Message)
    found = enumerations(message)["f"]
    assert (found.name, [each for each, _ in found.members]) == (name, members)


def test_type_hashes_do_not_depend_on_enumerations() -> None:
    annotated, plain = (
        catalog_of("cells", {"msg/Battery.msg": text}) for text in (BATTERY, BATTERY.replace("enum:", ""))
    )
    counts = [
        len(enumerations(each))
        for catalog in (annotated, plain)
        for each in catalog.interfaces.values()
        if isinstance(each, Message)
    ]
    assert counts == [3, 0]
    assert hashes(annotated) == hashes(plain)
