"""Type descriptions in generated C: those of the .json files."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from forge.base.distributions import EMBEDDED
from forge.base.files import write_if_changed
from forge.interfaces.hashing import Hasher, describe
from forge.interfaces.model import Catalog, Source, TypeName
from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library
from forge.interfaces.resolve.resolution import dependency_catalogs, resolve
from forge.plugins.c_target import target as c

HERE = Path(__file__).parent
RUNTIME = EMBEDDED / "rosidl_default_runtime" / "include"
LONG = "# more than the 4095 characters of a literal\n" * 100
DEFINITIONS = {
    "msg/Everything.msg": f"""\
{LONG}int32 A=1
std_msgs/Header header
string<=9[<=2] words ['a"', 'b\\\\??/']  # café 日
float64[3] three [1, 2.5, -3]
wstring wide "é"
bool[] flags""",
    "srv/Move.srv": "float32 distance\n---\n",
    "action/Walk.action": "---\n---\n",
}
PRINTED = ("msg/Everything", "srv/Move", "srv/Move_Event", "action/Walk", "action/Walk_GetResult")


def catalog(*, events: bool) -> Catalog:
    sources = [Source("probe", path, Path(path), text) for path, text in DEFINITIONS.items()]
    return resolve("probe", parse_all(sources), Library(rosdistro="jazzy"), events=events)


def expected(probe: Catalog, name: TypeName) -> Iterator[str]:
    """Yield the lines that the program prints for a type."""
    described = describe(Hasher(probe), name)
    message = described["type_description_msg"]
    types = [message["type_description"], *message["referenced_type_descriptions"]]
    yield f"hash {described['type_hashes'][0]['hash_string']}"
    for type_ in types:
        yield f"type {type_['type_name']}"
        for field in type_["fields"]:
            kind = field["type"]
            numbers = f"{kind['type_id']} {kind['capacity']} {kind['string_capacity']}"
            yield f"field {field['name']} {numbers} '{kind['nested_type_name']}' '{field['default_value']}'"
    known = {
        str(source): (text.relative.partition(".")[2], len(text.text.encode()))
        for source, text in probe.sources.items()
    }
    for type_ in types:
        encoding, size = known.get(type_["type_name"], ("implicit", 0))
        yield f"source {type_['type_name']} {encoding} {size}"


@pytest.mark.needs("gcc")
def test_a_program_can_read_the_descriptions_in_the_json_files(tmp_path: Path) -> None:
    """It compiles without a warning, although a definition is longer than the literals of C99."""
    probe = catalog(events=True)
    for each in (probe, *dependency_catalogs(probe, Library(rosdistro="jazzy"))):
        for file in c.files(each):
            write_if_changed(tmp_path / file.path, file.text)
    strict = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror")
    program = tmp_path / "program"
    arguments = ("-I", tmp_path, "-I", RUNTIME, HERE / "describe.c", "-o", program)
    compiled = subprocess.run(["gcc", *strict, *arguments], capture_output=True, text=True, check=False)
    assert compiled.returncode == 0, compiled.stderr[:4000]
    ran = subprocess.run([program], stdout=subprocess.PIPE, check=True)
    names = [TypeName("probe", *name.split("/")) for name in PRINTED]
    lines = [line for name in names for line in expected(probe, name)]
    assert ran.stdout.decode() == "\n".join([*lines, DEFINITIONS["msg/Everything.msg"]])


def test_distributions_without_descriptions_have_no_description_header() -> None:
    texts = {file.path: file.text for file in c.files(catalog(events=False))}
    assert not [path for path in texts if path.endswith("__description.h")]
    assert "description" not in texts["probe/msg/everything.h"]


@pytest.mark.parametrize("events", [True, False])
def test_service_events_can_be_generated(*, events: bool) -> None:
    texts = {file.path: file.text for file in c.files(catalog(events=events))}
    struct, support = (texts[f"probe/srv/detail/move__{part}.h"] for part in ("struct", "type_support"))
    assert ("typedef struct probe__srv__Move_Event__Sequence" in struct) is events
    assert ("MESSAGE_TYPE_SUPPORT(probe, srv, Move_Event)" in support) is events
