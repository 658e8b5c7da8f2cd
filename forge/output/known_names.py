"""Names that a failed package may have misspelled: CMake commands, and headers of other packages."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING

from forge.base.files import text_or_nothing
from forge.base.layout import PACKAGE
from forge.workspace.cmake_text import calls

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

_HEADERS = (".h", ".hh", ".hpp", ".hxx", ".inl", ".ipp", ".cuh")
_CMAKE_COMMANDS = re.findall(
    r"\w+",
    """
    add_compile_definitions add_compile_options add_custom_command add_custom_target add_definitions
    add_dependencies add_executable add_library add_link_options add_subdirectory add_test
    cmake_minimum_required cmake_parse_arguments cmake_policy configure_file enable_language
    enable_testing execute_process export file find_file find_library find_package find_path
    find_program foreach function get_filename_component get_property get_target_property include
    include_directories install link_directories link_libraries list macro message option project set
    set_property set_target_properties set_tests_properties string target_compile_definitions
    target_compile_features target_compile_options target_include_directories target_link_directories
    target_link_libraries target_link_options target_precompile_headers target_sources unset
    """,
)


def cmake_commands(folder: Path, files: Iterable[str]) -> frozenset[str]:
    """Return the commands of CMake, of ament and rosidl, and of a package with these files below `folder`."""
    own = (folder / name for name in files if name.endswith((".cmake", "CMakeLists.txt")))
    embedded = (PACKAGE / "embedded").rglob("*.cmake")
    defined = (call for path in (*own, *embedded) for call in calls(text_or_nothing(path)))
    names = (call.words[0] for call in defined if call.command in {"function", "macro"} and call.words)
    return frozenset((*_CMAKE_COMMANDS, *names))


def exported_targets(package: str, prefix: Path) -> tuple[str, ...]:
    """Return the targets that the CMake files of an installed package define."""
    folders = (prefix / "share" / package, prefix / "lib/cmake" / package, prefix / "cmake")
    files = (path for folder in folders for path in sorted(folder.rglob("*.cmake")))
    found = (
        call.words[0]
        for path in files
        for call in calls(text_or_nothing(path))
        if call.command in {"add_executable", "add_library"}
        and not {"IMPORTED", "ALIAS"}.isdisjoint(call.words)
    )
    return tuple(dict.fromkeys(name for name in found if "$" not in name))


def installed_headers(package: str, prefix: Path) -> frozenset[str]:
    """Return the headers that a package installed, as sources include them: 'shapes/circle.hpp'."""
    found: set[str] = set()
    # Some packages install below a folder with their name, so that overlays do not mix their headers.
    for root in (prefix / "include", prefix / "include" / package):
        for folder, _, names in os.walk(root / package):
            below = os.path.relpath(folder, root)
            found.update(f"{below}/{name}" for name in names if name.endswith(_HEADERS))
    return frozenset(found)
