"""A change inside a shared library builds what depends on it only where that can make a difference."""

from pathlib import Path

import pytest

from tests.conftest import Forge, Ran, Tree
from tests.e2e.test_exact_installs import build, cmake, hold_against_clean

pytestmark = [pytest.mark.needs("cmake", "ninja", "gcc")]

BASE = """add_library(base SHARED base.c)
target_include_directories(base PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:include>)
install(TARGETS base EXPORT base LIBRARY DESTINATION lib)
install(EXPORT base FILE baseConfig.cmake NAMESPACE base:: DESTINATION share/base/cmake)
install(FILES base.h DESTINATION include)"""
CODE = """#include "base.h"
int numbers[{count}] = {{1}};
int base() {{ return {number}; }}
"""
HEADER = "int base();\nextern int numbers[];\n"
USER = """find_package(base REQUIRED)
add_executable({name} main.c)
target_link_libraries({name} base::base)
install(TARGETS {name} DESTINATION bin)
{more}"""
MAIN = "#include <base.h>\nint main() { return base() + numbers[0]; }\n"

OTHERS = {
    "runs_it": "add_custom_command(OUTPUT made.txt COMMAND user > made.txt || true)\n"
    "add_custom_target(made ALL DEPENDS made.txt)\n"
    "install(FILES ${CMAKE_CURRENT_BINARY_DIR}/made.txt DESTINATION share)",
    "target_runs_it": "add_custom_target(made ALL COMMAND user || true)",
    "after_link": "add_custom_command(TARGET user POST_BUILD COMMAND user || true)",
    "installs_it": "install(IMPORTED_RUNTIME_ARTIFACTS base::base DESTINATION share)",
    "copies_it": "get_target_property(file base::base LOCATION)\ninstall(FILES ${file} DESTINATION share)",
    "install_code": 'get_target_property(file base::base LOCATION)\ninstall(CODE "file(SHA256 ${file} x)")',
    "reads_it": "get_target_property(path base::base LOCATION)\n"
    "file(SHA256 ${path} digest)\nfile(WRITE ${CMAKE_CURRENT_BINARY_DIR}/d.txt ${digest})\n"
    "install(FILES ${CMAKE_CURRENT_BINARY_DIR}/d.txt DESTINATION share)",
}
"""What a program's package does with it beside linking it, by the package's name."""


def library(kind: str = "SHARED") -> dict[str, str]:
    return cmake(
        "base",
        BASE.replace("SHARED", kind).replace("LIBRARY DESTINATION", "DESTINATION"),
        languages="C",
        **{"base.c": CODE.format(count=4, number=1), "base.h": HEADER},
    )


def user(name: str = "user", more: str = "") -> dict[str, str]:
    """Return a package with a program that links the library."""
    text = USER.format(name=name, more=more.replace("user", name))
    return cmake(name, text, "base", languages="C", **{"main.c": MAIN})


def packages(kind: str = "SHARED") -> dict[str, str]:
    """Return a library, a program that links it, and a package that needs that."""
    return {
        **library(kind),
        **user(),
        **cmake("top", "install(FILES x DESTINATION share/top)", "user", x="x\n"),
    }


def started(ran: Ran) -> list[str]:
    return [line.split()[2] for line in ran.out.splitlines() if line.startswith("Starting >>>")]


def change(root: Path, count: int = 4, number: int = 2) -> None:
    (root / "src/base/base.c").write_text(CODE.format(count=count, number=number))


@pytest.mark.parametrize("options", [(), ("--merge-install",)], ids=["isolated", "merged"])
def test_a_changed_function_body_rebuilds_only_the_library(
    forge: Forge, tree: Tree, options: tuple[str, ...]
) -> None:
    root = tree(packages())
    build(forge, root, *options)
    for number in (2, 3, 2):
        change(root, number=number)
        assert started(build(forge, root, *options)) == ["base"]
        assert started(build(forge, root, *options)) == []
    (root / "src/user/main.c").write_text(MAIN + "// edited\n")
    assert started(build(forge, root, *options)) == ["user"]
    change(root, number=4)
    hold_against_clean(forge, root, *options)


def test_a_changed_library_interface_rebuilds_users(forge: Forge, tree: Tree) -> None:
    root = tree(packages())
    build(forge, root)
    change(root, number=2)
    assert started(build(forge, root)) == ["base"]
    change(root, count=64, number=2)
    assert started(build(forge, root))[:2] == ["base", "user"]
    hold_against_clean(forge, root)


def test_packages_that_may_load_the_library_are_rebuilt(forge: Forge, tree: Tree) -> None:
    files = {**library(), **user()}
    for name, more in OTHERS.items():
        files |= user(name, more)
    root = tree(files)
    build(forge, root)
    change(root)
    assert sorted(started(build(forge, root))) == sorted(("base", *OTHERS))
    hold_against_clean(forge, root)


def test_a_changed_static_library_rebuilds_users(forge: Forge, tree: Tree) -> None:
    root = tree(packages("STATIC"))
    build(forge, root)
    change(root)
    assert started(build(forge, root))[:2] == ["base", "user"]
    hold_against_clean(forge, root)


VARIABLE = '.data\n.globl v\nv: .long {values}\n.size v, {size}\n.section .note.GNU-stack,"",@progbits\n'
"""A variable whose symbol has no type."""


@pytest.mark.parametrize(
    ("file", "one", "other", "main"),
    [
        (
            "v.s",
            VARIABLE.format(values="1", size=4),
            VARIABLE.format(values="1,2,3,4", size=16),
            "extern int v[];\nint main(void) { return v[0] + v[1] + v[2] + v[3]; }\n",
        ),
        (
            "v.c",
            "static int q; int *v = &q;\n",
            "static int q; int *const v = &q;\n",
            "extern int *v;\nint main(void) { return *v; }\n",
        ),
    ],
    ids=["a symbol without a type", "a constant pointer"],
)
def test_a_changed_copied_variable_relinks_users(
    forge: Forge, tree: Tree, file: str, one: str, other: str, main: str
) -> None:
    library = f"enable_language(ASM)\nadd_library(base SHARED {file})\n"
    library += "set_target_properties(base PROPERTIES LINKER_LANGUAGE C)\n"
    library += "install(TARGETS base EXPORT base DESTINATION lib)\n"
    library += "install(EXPORT base FILE baseConfig.cmake NAMESPACE base:: DESTINATION share/base/cmake)"
    user = (
        "find_package(base REQUIRED)\nadd_executable(user main.c)\ntarget_link_libraries(user base::base)\n"
    )
    user += "target_compile_options(user PRIVATE -fno-pic)\ntarget_link_options(user PRIVATE -no-pie)\n"
    user += "install(TARGETS user DESTINATION bin)"
    root = tree(
        {
            **cmake("base", library, languages="C", **{file: one}),
            **cmake("user", user, "base", languages="C", **{"main.c": main}),
        }
    )
    build(forge, root)
    (root / "src/base" / file).write_text(other)
    assert started(build(forge, root)) == ["base", "user"]
    hold_against_clean(forge, root)
