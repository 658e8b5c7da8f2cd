"""The initial cache, read by CMake."""

import subprocess

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forge.base.cmake_syntax import quoted

# A backslash before a semicolon cannot be an element of a CMake list at all; brackets must be balanced there.
_elements = st.text(st.characters(codec="utf-8", exclude_characters="\x00\r\\[]", exclude_categories=["Cs"]))


@pytest.mark.needs("cmake")
@settings(max_examples=5, deadline=None)
@given(st.lists(_elements.filter(bool), min_size=20, max_size=40))
def test_cmake_reads_the_values_back(tmp_path_factory: pytest.TempPathFactory, elements: list[str]) -> None:
    folder = tmp_path_factory.mktemp("quoted")
    checks = "".join(
        f'list(GET elements {at} one)\nfile(WRITE "{folder}/{at}" "${{one}}")\n'
        for at in range(len(elements))
    )
    script = folder / "script.cmake"
    script.write_text(
        f"cmake_policy(VERSION 3.18)\nset(elements {quoted(*elements)})\n{checks}", encoding="utf-8"
    )
    subprocess.run(["cmake", "-P", str(script)], check=True)
    read = [(folder / str(at)).read_bytes().decode() for at in range(len(elements))]
    assert read == elements
