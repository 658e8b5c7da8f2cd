"""All commands agree which interfaces a package has: those that rosidl_generate_interfaces() was given."""

import json
import os
import subprocess
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

import pytest

from forge.environment.prefixes import package_prefixes
from forge.interfaces.read.sources import Library
from forge.plugins.completion import words as completion_words
from forge.plugins.lsp.index import Index
from tests.conftest import Forge, Tree
from tests.packages import manifest_text

pytestmark = pytest.mark.needs("cmake", "ninja")

INTERFACES = (
    "<buildtool_depend>ament_cmake</buildtool_depend>",
    "<build_depend>rosidl_default_generators</build_depend>",
    "<member_of_group>rosidl_interface_packages</member_of_group>",
)
GENERATE = "rosidl_generate_interfaces"
LAYOUTS: Mapping[str, tuple[str, Mapping[str, str], set[str]]] = {
    "plain": (f"{GENERATE}(plain msg/A.msg srv/S.srv action/G.action)", {}, {"A", "S", "G"}),
    "deep": (f"{GENERATE}(deep msg/A.msg msg/in/B.msg msg/in/it/C.msg)", {}, {"A", "B", "C"}),
    "elsewhere": (f"{GENERATE}(elsewhere msg/A.msg more/of/srv/T.srv)", {}, {"A", "T"}),
    "with_base": (
        f"{GENERATE}(with_base msg/A.msg ${{CMAKE_CURRENT_SOURCE_DIR}}/other:msg/D.msg)",
        {"other/msg/D.msg": "A a\n"},
        {"A", "D"},
    ),
    "generated": (
        'file(WRITE "${CMAKE_CURRENT_BINARY_DIR}/gen/msg/E.msg" "A a\\n")\n'
        f'{GENERATE}(generated msg/A.msg "${{CMAKE_CURRENT_BINARY_DIR}}/gen:msg/E.msg")',
        {},
        {"A", "E"},
    ),
    "own_idl": (
        f"{GENERATE}(own_idl msg/A.msg msg/F.idl)",
        {"msg/F.idl": "module own_idl { module msg { struct F { long x; }; }; };\n"},
        {"A", "F"},
    ),
    "other_target": (
        f"{GENERATE}(messages msg/A.msg LIBRARY_NAME ${{PROJECT_NAME}})",
        {"msg/unused/H.msg": "int8 h\n"},
        {"A"},
    ),
    "skipped": (
        f"{GENERATE}(skipped msg/A.msg)\n{GENERATE}(for_tests test/msg/I.msg SKIP_INSTALL)",
        {"test/msg/I.msg": "int8 i\n"},
        {"A"},
    ),
    "two_targets": (
        f"{GENERATE}(${{PROJECT_NAME}} msg/A.msg)\n{GENERATE}(internal msg/P.msg srv/Q.srv SKIP_INSTALL)",
        {"msg/P.msg": "int8 p\n", "srv/Q.srv": "---\n"},
        {"A"},
    ),
    "listed": (
        f'set(files "msg/A.msg")\nlist(APPEND files srv/S.srv)\n{GENERATE}(${{PROJECT_NAME}} ${{files}})',
        {},
        {"A", "S"},
    ),
    "globbed": (
        "file(GLOB files RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} msg/*.msg)\n"
        + f"{GENERATE}(globbed ${{files}})",
        {"msg/J.msg": "int8 j\n"},
        {"A", "J"},
    ),
    "optional": (
        "set(files msg/A.msg)\nif(FALSE)\nlist(APPEND files msg/K.msg)\nendif()\n"
        f"{GENERATE}(optional ${{files}})",
        {"msg/K.msg": "int8 k\n"},
        {"A"},
    ),
    "below": (
        "add_subdirectory(interfaces)",
        {
            "interfaces/CMakeLists.txt": f"{GENERATE}(${{PROJECT_NAME}} msg/L.msg)\n",
            "interfaces/msg/L.msg": "int8 l\n",
        },
        {"L"},
    ),
    "copied": (
        f"configure_file(msg/M.msg.in msg/M.msg)\n{GENERATE}(copied ${{CMAKE_CURRENT_BINARY_DIR}}:msg/M.msg)",
        {"msg/M.msg.in": "int8 m\n"},
        {"M"},
    ),
    "not_all": (f"{GENERATE}(not_all msg/A.msg)", {"unused/msg/Z.msg": "int8 x\n"}, {"A"}),
}
"""The call, further files, and the names of the interfaces of each package."""
FILES = {
    "msg/A.msg": "int8 a\n",
    "msg/in/B.msg": "A a\n",
    "msg/in/it/C.msg": "B b\n",
    "srv/S.srv": "int8 a\n---\n",
    "more/of/srv/T.srv": "int8 a\n---\n",
    "action/G.action": "int8 a\n---\n---\n",
}


def package(name: str) -> dict[str, str]:
    """Return a package with one of the layouts, and only with the files that it names."""
    call, own, names = LAYOUTS[name]
    depends = (*INTERFACES, *(("<depend>action_msgs</depend>",) if "action" in call else ()))
    found = "".join(
        f"find_package({each} REQUIRED)\n" for each in ("ament_cmake", "rosidl_default_generators")
    )
    code = f"cmake_minimum_required(VERSION 3.16)\nproject({name} NONE)\n{found}{call}\nament_package()\n"
    files = {path: text for path, text in FILES.items() if Path(path).stem in names}
    return {
        f"src/{name}/package.xml": manifest_text(name, *depends, build_type="ament_cmake"),
        f"src/{name}/CMakeLists.txt": code,
        **{f"src/{name}/{path}": text for path, text in {**files, **own}.items()},
    }


OF_EDITORS = {"other_target": {"H"}, "optional": {"K"}, "two_targets": {"P", "Q"}}
"""Definitions below msg and srv that are not installed: the language server knows them, too."""


def named(names: Iterable[object], package: str) -> set[str]:
    """Return the names of interfaces of a package, also for their parts, without package and kind."""
    own = (str(each) for each in names if str(each).startswith(f"{package}/"))
    return {each.rpartition("/")[2].partition("_")[0] for each in own}


def completions(folder: Path, variables: Mapping[str, str]) -> list[str]:
    """Return the names that shells offer after `forge interface show`."""
    argv = (sys.executable, "-S", "-E", completion_words.__file__, "interfaces")
    environment = {**os.environ, **variables}
    return subprocess.run(
        argv, cwd=folder, env=environment, capture_output=True, text=True, check=True
    ).stdout.split()


def test_all_readers_agree(forge: Forge, tree: Tree) -> None:
    root = tree({path: text for name in LAYOUTS for path, text in package(name).items()})
    for words in (("build",), ("interface", "docs")):
        ran = forge(*words, cwd=root)
        assert ran.code == 0, ran.out + ran.err
    everything = forge("interface", "list", cwd=root).out.split()
    completed = completions(root, {})
    index = Index(root, Library(prefixes=package_prefixes(root / "install")), {})
    index.scan()
    for name, (_, _, expected) in LAYOUTS.items():
        listed = forge("interface", "package", name, cwd=root).out.split()
        assert {each.rpartition("/")[2] for each in listed} == expected
        assert {each for each in everything if each.startswith(f"{name}/")} == {*listed}
        assert named(completed, name) == expected
        assert named(index.names(), name) == expected | OF_EDITORS.get(name, set())
        pages = (root / "build/forge_interface_docs" / name).rglob("*.html")
        assert {page.stem for page in pages} - {"index"} == expected
        hashes = forge("interface", "hash", *listed, cwd=root)
        assert {line.split()[0] for line in hashes.out.splitlines()} >= {*listed}
        for each in listed:
            ran = forge("interface", "show", each, cwd=root)
            assert ran.code == 0, ran.err
            assert "generated by forge" not in ran.out
            assert forge("interface", "proto", each, cwd=root).code == 0
            encoding = "ros2idl" if each == "own_idl/msg/F" else "ros2msg"
            assert forge("interface", "schema", each, "--encoding", encoding, cwd=root).code == 0
        for folder in (f"src/{name}", f"install/{name}/share/{name}"):
            ran = forge("interface", "hash", "--json", "--package", name, folder, cwd=root)
            assert named(json.loads(ran.out), name) == expected, folder
            options = ("--package", name, "--lang", "jsonschema", "--output", f"out/{folder}")
            assert forge("interface", "generate", *options, folder, cwd=root).code == 0
            schemas = (root / "out" / folder / "jsonschema" / name).rglob("*.json")
            assert {path.name.partition(".")[0].partition("_")[0] for path in schemas} == expected, folder
    assert forge("interface", "schema", "deep/msg/C", cwd=root).out.count("int8 a") == 1


def test_unbuilt_folders_have_the_definitions_found_in_them(forge: Forge, tree: Tree) -> None:
    """What CMakeLists.txt says otherwise is a warning; what it says with variables is not known."""
    names = ("plain", "deep", "elsewhere", "with_base", "listed", "globbed", "skipped")
    more = {"src/deep/msg/New.msg": "int8 n\n"}
    root = tree({path: text for name in names for path, text in package(name).items()} | more)

    def warnings(name: str) -> list[str]:
        ran = forge("interface", "hash", "--package", name, f"src/{name}", cwd=root)
        assert ran.code == 0, ran.err
        return [line for line in ran.err.splitlines() if "warning: " in line]

    base = "${CMAKE_CURRENT_SOURCE_DIR}/other"
    expected = {
        "elsewhere": "src/elsewhere/CMakeLists.txt:5: warning: 'more/of/srv/T.srv' is left out",
        "with_base": f"src/with_base/CMakeLists.txt:5: warning: '{base}:msg/D.msg' is left out",
        "deep": "src/deep/msg/New.msg: warning: builds leave this definition out: "
        "it is not in rosidl_generate_interfaces()",
    }
    assert {name: warnings(name) for name in names} == {
        name: [expected[name]] if name in expected else [] for name in names
    }


def test_sources_are_read_in_their_current_state(forge: Forge, built: Tree) -> None:
    """What is newer than the last build is read from the sources; another folder is not that package."""
    root = built({**package("generated"), "other/msg/A.msg": "int8 other\n"})
    (root / "src/generated/msg/A.msg").write_text("int8 changed\n")
    (root / "src/generated/msg/New.msg").write_text("A a\n")

    def hashes(folder: str) -> dict[str, str]:
        ran = forge("interface", "hash", "--json", "--package", "generated", folder, cwd=root)
        found: dict[str, str] = json.loads(ran.out)
        return found

    now, before = hashes("src/generated"), hashes("install/generated/share/generated")
    assert now.keys() == {f"generated/msg/{each}" for each in ("A", "E", "New")}
    assert now["generated/msg/A"] != before["generated/msg/A"]
    assert now["generated/msg/E"] != before["generated/msg/E"], "it contains A"
    assert hashes("other").keys() == {"generated/msg/A"}


def test_the_workspace_overrides_its_underlays(forge: Forge, tree: Tree, tmp_path: Path) -> None:
    root = tree(package("plain"))
    underlay = tmp_path / "underlay"
    (underlay / "share/plain/msg").mkdir(parents=True)
    (underlay / "share/plain/msg/A.msg").write_text("int8 of_the_underlay\n")
    env = {"AMENT_PREFIX_PATH": str(underlay)}
    for words in (("build",), ("interface", "docs")):
        ran = forge(*words, cwd=root, env=env)
        assert ran.code == 0, ran.out + ran.err
    hashed = forge("interface", "hash", "plain/msg/A", cwd=root, env=env).out.split()[1]
    assert hashed in (root / "build/forge_interface_docs/plain/msg/A.html").read_text()
    assert forge("interface", "show", "plain/msg/A", cwd=root, env=env).out == "int8 a\n"


def test_underlays_have_the_installed_definitions(forge: Forge, built: Tree, tmp_path: Path) -> None:
    names = ("generated", "optional", "skipped")
    root = built({path: text for name in names for path, text in package(name).items()})
    env = {"AMENT_PREFIX_PATH": ":".join(str(root / "install" / name) for name in names)}
    user = tmp_path / "user"
    user.mkdir()
    ran = forge("interface", "docs", "--underlays", "--output", "pages", cwd=user, env=env)
    assert ran.code == 0, ran.err
    everything = forge("interface", "list", cwd=user, env=env).out.split()
    completed = completions(user, env)
    for name in names:
        listed = forge("interface", "package", name, cwd=user, env=env).out.split()
        assert {each.rpartition("/")[2] for each in listed} == LAYOUTS[name][2]
        assert {page.stem for page in (user / "pages" / name).rglob("*.html")} - {"index"} == LAYOUTS[name][2]
        assert named(everything, name) == named(completed, name) == LAYOUTS[name][2]
        for words in (("hash",), ("show",), ("schema",)):
            assert all(forge("interface", *words, each, cwd=user, env=env).code == 0 for each in listed)


def test_an_unreadable_package_does_not_block_other_pages(forge: Forge, tree: Tree) -> None:
    root = tree({**package("plain"), **package("deep"), "src/deep/msg/A.msg": "nonsense\n"})
    ran = forge("interface", "docs", cwd=root)
    assert ran.code == 2
    assert "src/deep/msg/A.msg:1:" in ran.err
    assert (root / "build/forge_interface_docs/plain/msg/A.html").is_file()
