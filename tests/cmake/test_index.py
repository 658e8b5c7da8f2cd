"""Resources of the ament index: written byte for byte, found in the order of the prefixes."""

from dataclasses import replace
from pathlib import Path

import pytest

from .conftest import Ament

pytestmark = [pytest.mark.needs("cmake"), pytest.mark.needs("ninja")]
INDEX = "share/ament_index/resource_index"


CONTENTS = (
    ('CONTENT "ns::A;lib/liba.so\\nns::B;lib/libb.so\\n"', "ns::A;lib/liba.so\nns::B;lib/libb.so\n"),
    ('CONTENT "[x] $<1:y> z"', "[x] y z"),
    ('CONTENT ""', ""),
    ("", ""),
    ("CONTENT_FILE plain.txt", "a;b\n@NAME@\n"),
    ("CONTENT_FILE expanded.txt.in", "a;demo\n"),
    ("CONTENT x PACKAGE_NAME other", "x"),
)


def test_resource_contents_are_unchanged(ament: Ament) -> None:
    files = {"plain.txt": "a;b\n@NAME@\n", "expanded.txt.in": "a;@PROJECT_NAME@\n"}
    calls = (f"ament_index_register_resource(kind{n} {words})" for n, (words, _) in enumerate(CONTENTS))
    demo = ament("\n".join(calls), files=files).install()
    for number, (words, text) in enumerate(CONTENTS):
        name = "other" if "PACKAGE_NAME" in words else "demo"
        assert demo.read(f"{INDEX}/kind{number}/{name}") == text, words


def test_resources_are_found_in_the_order_of_the_prefixes(ament: Ament, tmp_path: Path) -> None:
    for prefix, text in (("over", "1"), ("under", "2")):
        folder = tmp_path / prefix / INDEX / "kind"
        folder.mkdir(parents=True)
        (folder / "both").write_text(text, encoding="utf-8")
        (folder / prefix).write_text("", encoding="utf-8")
        (folder / ".hidden").write_text("", encoding="utf-8")
    demo = ament(
        "ament_index_get_resources(names kind)\nament_index_get_resource(text kind both)\n"
        "ament_index_has_resource(where kind under)\nament_index_has_resource(nowhere kind none)\n"
        "ament_index_get_prefix_path(path)\nlist(GET path 0 first)\n"
        'foreach(name names text where nowhere first)\nmessage(STATUS "${name}=${${name}}")\nendforeach()'
    )
    path = f"{tmp_path}/over:{tmp_path}/under"
    outcome = replace(demo, variables={"AMENT_PREFIX_PATH": path}).configure()
    assert outcome.said("names") == "both;over;under"
    assert outcome.said("text") == "1"
    assert outcome.said("where") == f"{tmp_path}/under"
    assert outcome.said("nowhere") == "FALSE"
    assert outcome.said("first") == f"{demo.build}/ament_cmake_index"
