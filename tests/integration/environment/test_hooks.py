"""CMake finds the same config files with the variables that save it the search."""

import os
import subprocess
import tempfile
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from forge.environment.hooks import config_folders, config_variables

NAMES = ("one", "One", "two")
FOLDERS = (
    *("share/{}/cmake", "lib/cmake/{}", "share/cmake/{}", "lib/{}/cmake", "cmake", "share/{}x/cmake"),
    *("share/other/cmake", "lib/x86_64-linux-gnu/cmake/{}", "share/{}/test"),
)
FILES = ("{}Config.cmake", "{}-config.cmake", "{}ConfigVersion.cmake")

files = st.builds(
    lambda folder, file, name, inner: f"{folder.format(inner)}/{file.format(name)}",
    st.sampled_from(FOLDERS),
    st.sampled_from(FILES),
    st.sampled_from(NAMES),
    st.sampled_from(NAMES),
)
prefixes = st.lists(st.frozensets(files, max_size=4), min_size=1, max_size=3)


def found(root: Path, paths: list[Path], variables: dict[str, str]) -> str:
    """Return what find_package() finds in some prefixes."""
    environment = {**os.environ, **variables, "CMAKE_PREFIX_PATH": os.pathsep.join(map(str, paths))}
    argv = ["cmake", "-S", str(root), "-B", tempfile.mkdtemp(dir=root), "--log-level=NOTICE"]
    done = subprocess.run(argv, env=environment, capture_output=True, text=True, check=True)
    return done.stderr


PROJECT = f"""cmake_minimum_required(VERSION 3.18)
project(searches NONE)
foreach(name IN ITEMS {" ".join(NAMES)})
  find_package(${{name}} QUIET CONFIG)
  message("${{name}}: ${{${{name}}_DIR}}")
endforeach()
"""


@pytest.mark.needs("cmake")
@settings(max_examples=30, deadline=None)
@given(prefixes)
@example([frozenset({"share/one/cmake/oneConfig.cmake"}), frozenset({"lib/cmake/two/twoConfig.cmake"})])
@example([frozenset({"lib/cmake/one/one-config.cmake"}), frozenset({"share/one/cmake/oneConfig.cmake"})])
@example([frozenset({"lib/one/cmake/oneConfig.cmake"}), frozenset({"share/one/cmake/oneConfig.cmake"})])
@example([frozenset({"lib/two/cmake/twoConfig.cmake"}), frozenset({"lib/cmake/two/twoConfig.cmake"})])
@example([frozenset({"share/One/cmake/OneConfig.cmake"}), frozenset({"share/One/cmake/OneConfig.cmake"})])
@example([frozenset({"share/other/cmake/oneConfig.cmake"}), frozenset({"share/one/cmake/oneConfig.cmake"})])
def test_config_variables_point_to_the_same_files(trees: list[frozenset[str]]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder).resolve()
        (root / "CMakeLists.txt").write_text(PROJECT)
        paths = [root / f"p{index}" for index in range(len(trees))]
        for path, tree in zip(paths, trees, strict=True):
            for file in tree:
                (path / file).parent.mkdir(parents=True, exist_ok=True)
                (path / file).write_text("")
        installed = (
            config_folders([f"{path}/{file}" for file in tree])
            for path, tree in zip(paths, trees, strict=True)
        )
        assert found(root, paths, config_variables(installed)) == found(root, paths, {})


def test_configs_in_standard_folders_get_a_variable() -> None:
    files = ["/w/install/a/share/a/cmake/aConfig.cmake", "/w/install/a/share/a/cmake/aConfig-version.cmake"]
    other = ["/w/install/b/lib/cmake/b/bConfig.cmake", "/w/install/b/lib/libb.so"]
    assert config_variables([config_folders(files), config_folders(other)]) == {
        "a_DIR": "/w/install/a/share/a/cmake",
        "b_DIR": "/w/install/b/lib/cmake/b",
    }
