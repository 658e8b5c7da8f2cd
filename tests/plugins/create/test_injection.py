"""Text from the command line never becomes code or markup in new packages."""

import ast
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from forge.base.errors import ForgeError
from forge.plugins.create.package import BUILD_TYPES, NewPackage, render_package
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import Person
from tests.hostile import hostile
from tests.unit.test_injection import quick


@quick
@given(hostile(), hostile(), hostile(), st.sampled_from(BUILD_TYPES))
def test_created_packages_contain_the_given_strings(
    description: str, license_: str, name: str, build_type: str
) -> None:
    try:
        blueprint = NewPackage(
            "pkg", Person(name, "a@b.cc"), build_type, description=description, license=license_
        )
    except ForgeError:
        return
    files = {path: text or "" for path, text in render_package(blueprint).items()}
    manifest = parse_manifest(files["package.xml"].encode(), Path("package.xml"), {})
    assert manifest.maintainers == (Person(" ".join(name.split(" ")).strip(), "a@b.cc"),)
    if build_type == "ament_python":
        call = next(
            node
            for node in ast.walk(ast.parse(files["setup.py"]))
            if isinstance(node, ast.Call) and node.keywords
        )
        said = {word.arg: word.value.value for word in call.keywords if isinstance(word.value, ast.Constant)}
        assert (said["maintainer"], said["description"], said["license"]) == (name, description, license_)
