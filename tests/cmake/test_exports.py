"""What a package exports reaches its users: by targets, classic variables, ament_target_dependencies()."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from .conftest import Ament, Project

pytestmark = [pytest.mark.needs("cmake"), pytest.mark.needs("ninja")]
cxx = pytest.mark.needs("g++")

LIBRARY = """
add_library({name} SHARED {name}.cpp)
target_include_directories({name} PUBLIC
  "$<BUILD_INTERFACE:${{CMAKE_CURRENT_SOURCE_DIR}}/include>" "$<INSTALL_INTERFACE:include/{name}>")
{use}
{exports}
ament_package()
install(TARGETS {name} EXPORT export_{name} LIBRARY DESTINATION lib)  # after ament_package(), as many do
install(DIRECTORY include/ DESTINATION include/{name})
"""
MODERN = "ament_export_targets(export_{name} HAS_LIBRARY_TARGET)"
CLASSIC = "ament_export_include_directories(include/{name})\nament_export_libraries({name})"
USER = '#include "top/top.hpp"\nint main() { return top() == 42 ? 0 : 1; }\n'


def library(ament: Ament, name: str, exports: str, *, uses: str = "", body: str = "return 42;") -> Project:
    """Install a package with one library of one function."""
    use = f"find_package({uses} REQUIRED)\nament_target_dependencies({name} {uses})\n" if uses else ""
    use += f"ament_export_dependencies({uses})\n" if uses else ""
    include = f'#include "{uses}/{uses}.hpp"\n' if uses else ""
    files = {
        f"{name}.cpp": f'#include "{name}/{name}.hpp"\n{include}int {name}() {{ {body} }}\n',
        f"include/{name}/{name}.hpp": f"{include}int {name}();\n",
    }
    commands = LIBRARY.format(name=name, use=use, exports=exports.format(name=name))
    return ament(commands, name, files=files).install()


@cxx
@pytest.mark.parametrize(
    ("base", "top"),
    [(MODERN, CLASSIC), (CLASSIC, MODERN), (f"{MODERN}\n{CLASSIC}", MODERN)],
    ids=["modern-classic", "classic-modern", "both-modern"],
)
def test_libraries_can_be_linked_in_every_style(ament: Ament, base: str, top: str) -> None:
    library(ament, "base", base)
    library(ament, "top", top, uses="base", body="return base();")
    user = ament(
        "find_package(top REQUIRED)\nadd_executable(by_ament main.cpp)\n"
        "ament_target_dependencies(by_ament top)\n"
        "target_link_libraries(by_ament m)\n"  # the plain signature, after ament's own
        "add_executable(classic main.cpp)\n"
        + (
            "include_directories(${top_INCLUDE_DIRS})\ntarget_link_libraries(classic ${top_LIBRARIES})\n"
            if top == CLASSIC
            else "target_link_libraries(classic top::top)\n"
        )
        + "enable_testing()\nadd_test(NAME one COMMAND by_ament)\nadd_test(NAME two COMMAND classic)",
        name="user",
        files={"main.cpp": USER},
    )
    user.configure()
    user.make()
    outcome = user.test()
    assert outcome.code == 0, outcome.text


@cxx
def test_targets_of_several_exports_are_listed_in_order_without_executables(ament: Ament) -> None:
    single = ament(
        "add_library(low INTERFACE)\nadd_library(high INTERFACE)\ntarget_link_libraries(high INTERFACE low)\n"
        "add_executable(tool tool.cpp)\n"
        "install(TARGETS low EXPORT low_set)\n"
        "install(TARGETS high tool EXPORT high_set DESTINATION lib/single)\n"
        "ament_export_targets(low_set)\nament_export_targets(high_set HAS_LIBRARY_TARGET)\nament_package()",
        name="single",
        files={"tool.cpp": "int main() {}\n"},
    ).install()
    user = ament('find_package(single REQUIRED)\nmessage(STATUS "targets=${single_TARGETS}")', name="user")
    assert user.configure().said("targets") == "single::low;single::high"
    assert "share/single/environment/library_path.sh" in single.files()


@pytest.mark.newest_cmake
def test_classic_variables_include_those_of_dependencies(ament: Ament) -> None:
    ament(
        "ament_export_include_directories(include/base include/base)\nament_export_definitions(BASE=1)\n"
        "ament_export_link_flags(-Wl,--as-needed)\nament_export_libraries(-pthread -rdynamic)\n"
        "ament_package()",
        name="base",
    ).install()
    ament("ament_export_dependencies(base)\nament_package()", name="middle").install()
    ament(
        "ament_export_dependencies(middle)\nament_export_dependencies(middle base)\n"
        "ament_export_definitions(TOP)\n"
        "ament_export_libraries(optimized -la debug -lb)\nament_package()",
        name="top",
    ).install()
    names = "INCLUDE_DIRS LIBRARIES DEFINITIONS LINK_FLAGS DEPENDENCIES RECURSIVE_DEPENDENCIES"
    user = ament(
        f'find_package(top REQUIRED)\nforeach(name {names})\nmessage(STATUS "${{name}}=${{top_${{name}}}}")\n'
        'endforeach()\nmessage(STATUS "base_found=${base_FOUND}")',
        name="user",
    )
    outcome = user.configure()
    assert outcome.said("INCLUDE_DIRS").endswith("/install/base/include/base")
    assert outcome.said("DEFINITIONS") == "TOP;BASE=1"
    assert outcome.said("LINK_FLAGS") == "-Wl,--as-needed"
    assert outcome.said("LIBRARIES").endswith("-pthread;-rdynamic")
    assert outcome.said("DEPENDENCIES") == "middle;base"
    assert outcome.said("RECURSIVE_DEPENDENCIES") == "middle;base"
    assert outcome.said("base_found") in ("1", "TRUE")


def test_a_missing_dependency_is_an_error_for_users(ament: Ament) -> None:
    ament("ament_export_dependencies(nowhere)\nament_package()").install()
    outcome = ament("find_package(demo REQUIRED)", name="user").try_to_configure()
    assert outcome.code != 0
    assert '"nowhere"' in outcome.flat


KEYWORDS = ("", "PUBLIC", "SYSTEM PUBLIC", "SYSTEM", "INTERFACE")


@cxx
def test_keywords_select_the_signature(ament: Ament) -> None:
    ament(
        "add_library(offer INTERFACE)\ntarget_compile_definitions(offer INTERFACE OFFERED)\n"
        "install(TARGETS offer EXPORT set)\nament_export_targets(set)\nament_package()",
        name="offer",
    ).install()
    lines = ["find_package(offer REQUIRED)"]
    for number, keyword in enumerate(KEYWORDS):
        library, program = f"lib{number}", f"main{number}"
        kind = "INTERFACE" if keyword == "INTERFACE" else "STATIC lib.cpp"
        lines += [f"add_library({library} {kind})", f"ament_target_dependencies({library} {keyword} offer)"]
        if keyword != "INTERFACE":
            # CMake rejects the plain signature after one with a keyword, and the reverse.
            lines += [f"target_link_libraries({library} {'PRIVATE' * ('PUBLIC' in keyword)} m)"]
        lines += [f"add_executable({program} main.cpp)", f"target_link_libraries({program} {library})"]
    user = ament(
        "\n".join(lines),
        name="user",
        files={
            "lib.cpp": "#ifndef OFFERED\n#error\n#endif\n",
            "main.cpp": "#ifndef OFFERED\n#error\n#endif\nint main() {}\n",
        },
    )
    user.configure()
    user.make()


def test_overlays_come_before_underlays(ament: Ament) -> None:
    demo = ament(
        "ament_include_directories_order(dirs /under/include /other /over/include /over /under/more)\n"
        'message(STATUS "dirs=${dirs}")'
    )
    ordered = type(demo)(
        demo.source, demo.build, demo.prefix, demo.prefixes, {"AMENT_PREFIX_PATH": "/over:/under"}
    )
    assert ordered.configure().said("dirs") == "/over/include;/over;/under/include;/under/more;/other"


PUBLIC_COMMANDS: Mapping[str, tuple[str, str]] = {
    "normalize_path": ('normalize_path(x "/a/./b//../c/")', "/a/c"),
    "normalize_path above the root": ('normalize_path(x "/../a")', "/a"),
    "normalize_path relative": ('normalize_path(x "../a/..")', ".."),
    "list_append_unique": ("set(x a)\nlist_append_unique(x a b b)", "a;b"),
    "string_ends_with": ("string_ends_with(abc bc x)", "TRUE"),
    "string_ends_with longer": ("string_ends_with(bc abc x)", "FALSE"),
    "ament_libraries_deduplicate": (
        "ament_libraries_deduplicate(x a debug b a optimized b debug b)",
        "a;optimized;b;debug;b",
    ),
    "get_executable_path": ("get_executable_path(x some/program BUILD)", "some/program"),
}


@pytest.mark.newest_cmake
def test_utility_commands_work_as_documented(ament: Ament) -> None:
    """One project for all: each result is printed under its number."""
    lines = [
        f'unset(x)\n{command}\nmessage(STATUS "{number}=${{x}}")'
        for number, (command, _) in enumerate(PUBLIC_COMMANDS.values())
    ]
    outcome = ament("\n".join(lines)).configure()
    for number, (name, (_, answer)) in enumerate(PUBLIC_COMMANDS.items()):
        assert outcome.said(str(number)) == answer, name
