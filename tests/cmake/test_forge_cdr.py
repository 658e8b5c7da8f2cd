"""forge_cdr in CMake: with an interface package, and by its own name."""

from dataclasses import replace
from pathlib import Path

import pytest

from .conftest import Ament

MAIN = """\
#include "forge_cdr/forge_cdr.hpp"
#include "std_msgs/msg/header.hpp"
int main() { return forge_cdr::serialize(std_msgs::msg::Header()).size() == 17 ? 0 : 1; }
"""


@pytest.mark.needs("cmake", "ninja", "g++")
def test_programs_serialize_without_additional_libraries(ament: Ament, interfaces: Path) -> None:
    user = ament(
        "find_package(forge_cdr REQUIRED)\nfind_package(std_msgs REQUIRED)\n"
        "add_executable(by_package main.cpp)\nament_target_dependencies(by_package std_msgs)\n"
        "add_executable(by_name main.cpp)\n"
        "target_include_directories(by_name PRIVATE ${std_msgs_INCLUDE_DIRS})\n"
        "target_link_libraries(by_name forge_cdr::forge_cdr)\n"
        "add_custom_target(run COMMAND by_package COMMAND by_name)",
        "demo",
        files={"main.cpp": MAIN},
    )
    user = replace(user, prefixes=(*user.prefixes, interfaces))
    user.configure("-DCMAKE_CXX_FLAGS=-Wall -Wextra -Wpedantic -Werror")
    user.make("--target", "run")
