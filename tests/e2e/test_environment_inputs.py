"""Changed variables, programs and files named by packages or options cause rebuilds."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.conftest import Forge, Tree, Variables
from tests.packages import manifest_text

pytestmark = pytest.mark.needs("cmake", "gcc")

MAIN = '#include <stdio.h>\n#ifndef V\n#define V 0\n#endif\nint main(void) { printf("%d", V); }\n'
INSTALL = "add_executable({0}_x x.c)\ninstall(TARGETS {0}_x DESTINATION bin)\n"


def cmake(name: str, text: str, *tags: str, language: str = "C", build: bool = True) -> dict[str, str]:
    """Return the files of a CMake package that compiles a program after what `text` says."""
    head = f"cmake_minimum_required(VERSION 3.16)\nproject({name} {language})\n"
    files = {
        f"src/{name}/package.xml": manifest_text(name, *tags, build_type="cmake"),
        f"src/{name}/CMakeLists.txt": head + text + (INSTALL.format(name) if build else ""),
    }
    return files | ({f"src/{name}/x.c": MAIN} if build else {})


class Builds:
    """Builds of one workspace: what was started, and whether the result is that of a clean build."""

    def __init__(self, forge: Forge, root: Path, *options: str) -> None:
        self._forge = forge
        self._root = root
        self._options = options

    def build(self, env: Variables | None = None, *options: str) -> list[str]:
        """Build; return the packages that were started, also those that forge brings along."""
        ran = self._forge("build", "--json", *self._options, *options, cwd=self._root, env=env)
        assert ran.code == 0, ran.out + ran.err
        events = map(json.loads, ran.out.splitlines())
        return sorted(event["package"] for event in events if event["event"] == "Started")

    def tree(self) -> dict[str, bytes]:
        install = self._root / "install"
        return {
            str(path.relative_to(install)): path.read_bytes() for path in install.rglob("*") if path.is_file()
        }

    def same_as_clean(self, env: Variables | None = None, *options: str) -> bool:
        """Tell if a clean build makes what is installed now."""
        found = self.tree()
        for folder in ("build", "install", "log"):
            shutil.rmtree(self._root / folder, ignore_errors=True)
        self.build(env, *options)
        return found == self.tree()


IDLE = (
    *("ROS_DOMAIN_ID", "ROS_LOG_DIR", "ROS_LOCALHOST_ONLY", "RMW_IMPLEMENTATION", "CUDA_VISIBLE_DEVICES"),
    *(
        "ROS_MASTER_URI",
        "ROS_HOSTNAME",
        "PKG_CONFIG_DEBUG_SPEW",
        "CUDA_CACHE_PATH",
        "AMENT_TRACE_SETUP_FILES",
    ),
    *("CMAKE_COLOR_DIAGNOSTICS", "CMAKE_BUILD_PARALLEL_LEVEL"),
)


def test_irrelevant_variables_cause_no_rebuild(forge: Forge, tree: Tree) -> None:
    builds = Builds(forge, tree(cmake("a", "")))
    builds.build()
    assert builds.build(dict.fromkeys(IDLE, "1")) == []
    assert builds.build({"ROS_VERSION": "1"}) == ["a"]


SETUP = """import os, subprocess
from setuptools import setup
subprocess.run(["true"], env={**os.environ, **dict(os.environ.items()), **os.environ.copy()}, check=True)
setup(name="p", version=os.environ.get("VER", "1"), py_modules=["p"])
"""
"""Each Python package copies the environment to start other programs."""


def test_a_changed_variable_rebuilds_exactly_the_packages_that_use_it(forge: Forge, tree: Tree) -> None:
    conditional = '<exec_depend condition="$WITH_ZLIB == 1">zlib</exec_depend>'
    files = {
        **cmake("direct", "if(DEFINED ENV{FOO})\nadd_definitions(-DV=$ENV{FOO})\nendif()\n"),
        **cmake("config", "install(FILES configConfig.cmake DESTINATION share/config/cmake)\n", build=False),
        "src/config/configConfig.cmake": "set(config_V $ENV{BAR})\n",
        **cmake(
            "by_config",
            "find_package(config REQUIRED)\nadd_definitions(-DV=1${config_V})\n",
            "<depend>config</depend>",
        ),
        **cmake("by_file", "include(../../common.cmake)\n"),
        "common.cmake": "set(x 1)\n",
        **cmake("finds_root", "find_package(root REQUIRED)\nadd_definitions(-DV=${root_V})\n"),
        **cmake("finds_dir", "find_package(dir REQUIRED)\nadd_definitions(-DV=${dir_V})\n"),
        **{f"opt/{i}/share/root/cmake/rootConfig.cmake": f"set(root_V {i})\n" for i in "12"},
        **{f"opt/{i}/share/dir/cmake/dirConfig.cmake": f"set(dir_V {i})\n" for i in "12"},
        "opt/COLCON_IGNORE": "",
        **cmake("condition", "", conditional),
        "src/p/package.xml": manifest_text("p", build_type="ament_python"),
        "src/p/setup.py": SETUP,
        "src/p/p.py": "",
    }
    root = tree(files)
    builds = Builds(forge, root)
    variables = {"FOO": "1", "OTHER": "1", "root_ROOT": f"{root}/opt/1"}
    variables["dir_DIR"] = f"{root}/opt/1/share/dir/cmake"
    builds.build(variables)
    for name, value, expected in (
        ("FOO", "2", ["direct"]),
        ("BAR", "3", ["by_config"]),
        ("OTHER", "2", []),
        ("VER", "2", ["p"]),
        ("root_ROOT", f"{root}/opt/2", ["finds_root"]),
        ("dir_DIR", f"{root}/opt/2/share/dir/cmake", ["finds_dir"]),
        ("WITH_ZLIB", "1", ["condition"]),
    ):
        variables[name] = value
        assert builds.build(variables) == expected, name
    tree({"common.cmake": "add_definitions(-DV=$ENV{OTHER})\n"})
    assert builds.build(variables) == ["by_file"]
    variables["OTHER"] = "3"
    assert builds.build(variables) == ["by_file"]
    assert builds.same_as_clean(variables)


SECRETS = {
    name: f"geheim-{number}"
    for number, name in enumerate(
        ("TOKEN", "CMAKE_PASSWORD", "PKG_CONFIG_KEY", "SKBUILD_KEY", "SETUPTOOLS_KEY", "PBR_VERSION", "OTHER")
    )
}


@pytest.mark.parametrize("options", [(), ("--cache", "cache", "--timings"), ("--merge-install", "--explain")])
def test_values_of_variables_are_not_stored(
    forge: Forge, tree: Tree, options: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    root = tree(
        cmake("a", "set(x $ENV{TOKEN})\nenable_testing()\nadd_test(NAME t COMMAND true)\n")
        | {
            "src/p/package.xml": manifest_text("p", build_type="ament_python"),
            "src/p/setup.py": "import os\nfrom setuptools import setup\nos.environ.get('TOKEN')\n"
            "setup(name='p', version='1', py_modules=['p'])\n",
            "src/p/p.py": "",
        }
    )
    for name, value in SECRETS.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("CXXFLAGS", "-DTOKEN=geheim-8")
    monkeypatch.setenv("PYTHONPATH", "/geheim-9")
    monkeypatch.setenv("FORGE_CACHE_TOKEN", "geheim-10")
    monkeypatch.setenv("LD_LIBRARY_PATH", "/geheim-11")
    monkeypatch.setenv("CMAKE_PREFIX_PATH", "/geheim-12")
    for _ in range(2):  # the second time from the cache
        for folder in ("build", "install"):
            shutil.rmtree(root / folder, ignore_errors=True)
        ran = forge("build", *options, cwd=root)
        assert ran.code == 0, ran.err
    for words in (("test",), ("build", *options, "--force"), ("info", "--json"), ("doctor",)):
        forge(*words, cwd=root)
    leaks = [
        str(path.relative_to(root))
        for folder in ("build", "install", "log", "cache")
        for path in (root / folder).rglob("*")
        if path.is_file() and not path.is_symlink() and b"geheim" in path.read_bytes()
    ]
    # What repeats a step is readable by the user only, and CMake records the flags of compilers.
    repeat = [path for path in leaks if path.endswith("/environment.sh")]
    assert all((root / path).stat().st_mode & 0o077 == 0 for path in repeat)
    assert [path for path in leaks if path not in repeat and "/a/" not in path] == []
    assert [path for path in leaks if path.startswith(("log", "install", "cache"))] == []


def test_a_changed_variable_is_named_without_its_value(
    forge: Forge, tree: Tree, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = tree(cmake("a", ""))
    monkeypatch.setenv("CMAKE_PASSWORD", "geheim-1")
    assert forge("build", cwd=root).code == 0
    monkeypatch.setenv("CMAKE_PASSWORD", "geheim-2")
    ran = forge("build", "--explain", cwd=root)
    assert "the environment variable 'CMAKE_PASSWORD' changed" in ran.out + ran.err
    assert "geheim" not in ran.out + ran.err


def path(*folders: Path) -> dict[str, str | None]:
    return {"PATH": os.pathsep.join((*map(str, folders), os.environ["PATH"]))}


GENERATED = """execute_process(COMMAND mytool OUTPUT_VARIABLE O OUTPUT_STRIP_TRAILING_WHITESPACE)
add_definitions(-DV=${O})
"""


def test_a_program_shadowed_on_path_causes_a_rebuild(forge: Forge, tree: Tree) -> None:
    tools = {f"opt/b{i}/mytool": f"#!/bin/sh\necho {i}\n" for i in "12"}
    others = {"opt/other/code": "#!/bin/sh\n", "opt/COLCON_IGNORE": ""}
    root = tree(cmake("a", GENERATED) | cmake("b", "") | tools | others)
    builds = Builds(forge, root)
    first, second, other = (root / "opt" / name for name in ("b1", "b2", "other"))
    builds.build(path(first))
    assert builds.build(path(other, first)) == []
    assert builds.build(path(second, first)) == ["a"]
    assert builds.same_as_clean(path(second, first))


def test_a_new_or_replaced_program_causes_a_rebuild(forge: Forge, tree: Tree) -> None:
    text = "find_program(T mytool)\nif(T)\n" + GENERATED + "endif()\n"
    root = tree(cmake("a", text) | cmake("b", "") | {"opt/COLCON_IGNORE": "", "opt/b/x": ""})
    builds = Builds(forge, root)
    builds.build(path(root / "opt/b"))
    for count in ("1", "20"):
        tree({"opt/b/mytool": f"#!/bin/sh\necho {count}\n"})
        assert builds.build(path(root / "opt/b")) == ["a"]
    assert builds.same_as_clean(path(root / "opt/b"))


def test_a_prefix_derived_from_path_provides_a_package(forge: Forge, tree: Tree) -> None:
    configs = {f"opt/z{i}/share/zed/cmake/zedConfig.cmake": f"set(zed_V {i})\n" for i in "12"}
    programs = {f"opt/z{i}/bin/zz{i}": "#!/bin/sh\n" for i in "123"} | {"opt/COLCON_IGNORE": ""}
    text = "find_package(zed REQUIRED)\nadd_definitions(-DV=${zed_V})\n"
    root = tree(cmake("a", text) | cmake("b", "") | configs | programs)
    builds = Builds(forge, root)
    bins = {i: root / f"opt/z{i}/bin" for i in "123"}
    builds.build(path(bins["1"]))
    assert builds.build(path(bins["3"], bins["1"])) == []
    assert builds.build(path(bins["2"], bins["1"])) == ["a"]
    assert builds.same_as_clean(path(bins["2"], bins["1"]))


def wrapper(number: str) -> str:
    return f'#!/bin/sh\nexec gcc -DV={number} "$@"\n'


def test_a_changed_toolchain_file_or_include_causes_a_rebuild(forge: Forge, tree: Tree) -> None:
    compilers = {f"opt/cc{i}": wrapper(i) for i in "12"}
    root = tree(cmake("a", "") | compilers | {"opt/COLCON_IGNORE": ""})
    tree({"opt/tc.cmake": "include(${CMAKE_CURRENT_LIST_DIR}/more.cmake)\n"})
    tree({"opt/more.cmake": f"set(CMAKE_C_COMPILER {root}/opt/cc1)\n"})
    builds = Builds(forge, root, "--cmake-args", f"-DCMAKE_TOOLCHAIN_FILE={root}/opt/tc.cmake")
    builds.build()
    assert builds.build() == []
    tree({"opt/more.cmake": f"set(CMAKE_C_COMPILER {root}/opt/cc2)\n"})
    assert builds.build() == ["a"]
    tree({"opt/cc2": wrapper("300")})
    assert builds.build() == ["a"]
    assert builds.same_as_clean()


@pytest.mark.parametrize(
    "argument",
    [
        "-C{}/opt/init.cmake",
        "-DCMAKE_PROJECT_INCLUDE={}/opt/init.cmake",
        "-DCMAKE_USER_MAKE_RULES_OVERRIDE={}/opt/init.cmake",
    ],
)
def test_changed_files_named_by_options_cause_a_rebuild(forge: Forge, tree: Tree, argument: str) -> None:
    text = 'set(CMAKE_C_FLAGS_INIT "-DV={0}")\nset(VV {0} CACHE STRING "" FORCE)\n'
    root = tree(cmake("a", "add_definitions(-DW=${VV})\n") | {"opt/init.cmake": text.format(1)})
    builds = Builds(forge, root, "--cmake-args", argument.format(root))
    builds.build()
    tree({"opt/init.cmake": text.format(2)})
    assert builds.build() == ["a"]
    assert builds.same_as_clean()


def test_a_replaced_compiler_named_by_an_option_causes_a_rebuild(forge: Forge, tree: Tree) -> None:
    root = tree(cmake("a", "") | {"opt/cc1": wrapper("1"), "opt/COLCON_IGNORE": ""})
    builds = Builds(forge, root, "--cmake-args", f"-DCMAKE_C_COMPILER={root}/opt/cc1")
    builds.build()
    tree({"opt/cc1": wrapper("200")})
    assert builds.build() == ["a"]
    assert builds.same_as_clean()


@pytest.mark.parametrize("place", ["the workspace", "another folder"])
def test_variables_of_a_compiler_wrapper_are_inputs(
    forge: Forge, tree: Tree, tmp_path: Path, place: str
) -> None:
    """Scripts beside the packages or elsewhere, but not what an interpreter installed there reads."""
    wrapper = (
        '#!/bin/sh\n. "${0%/*}/venv/lib/more"\nexec gcc -DV="${WRAPPED-1}" -DW="$(. "${0%/*}/sub")" "$@"\n'
    )
    tools = {"tools/cc": wrapper, "tools/venv/pyvenv.cfg": "", "tools/venv/lib/more": ": ${UNRELATED-1}\n"}
    tools["tools/sub"] = "echo ${SUBSHELL-1}\n"
    root = tree(cmake("a", "") | tools)
    (root / "tools/cc").chmod(0o755)
    folder = root / "tools"
    if place == "another folder":
        folder = folder.rename(tmp_path / "elsewhere")
    builds = Builds(forge, root, "--cmake-args", f"-DCMAKE_C_COMPILER={folder}/cc")
    builds.build()
    assert builds.build({"UNRELATED": "2"}) == []
    assert builds.build({"SUBSHELL": "2"}) == ["a"]
    assert builds.build({"WRAPPED": "2"}) == ["a"]
    assert builds.same_as_clean({"WRAPPED": "2"})


def test_package_arguments_can_select_another_compiler(forge: Forge, tree: Tree) -> None:
    """What is known of everybody's compiler is not handed to a package that has its own."""
    text = 'set(file ${CMAKE_BINARY_DIR}/c.txt)\nfile(WRITE ${file} "${CMAKE_C_COMPILER}")\n'
    text += "install(FILES ${file} DESTINATION share)\n"
    root = tree(cmake("a", text) | cmake("b", text) | {"opt/cc1": wrapper("1"), "opt/COLCON_IGNORE": ""})
    tree({"forge.toml": f'[packages.b]\ncmake-args = ["-DCMAKE_TOOLCHAIN_FILE={root}/opt/tc.cmake"]\n'})
    tree({"opt/tc.cmake": f"set(CMAKE_C_COMPILER {root}/opt/cc1)\n"})
    Builds(forge, root).build()
    said = {name: (root / "install" / name / "share/c.txt").read_text() for name in "ab"}
    assert said["b"] == f"{root}/opt/cc1"
    assert said["a"] != said["b"]


def test_modules_outside_the_cmake_installation_are_inputs(forge: Forge, tree: Tree) -> None:
    root = tree({"opt/share/cmake/Modules/My.cmake": "set(VV 1)\n", "opt/COLCON_IGNORE": ""})
    text = f"list(APPEND CMAKE_MODULE_PATH {root}/opt/share/cmake/Modules)\n"
    text += "include(My)\nadd_definitions(-DV=${VV})\n"
    tree(cmake("a", text))
    builds = Builds(forge, root)
    builds.build()
    tree({"opt/share/cmake/Modules/My.cmake": "set(VV 2)\n"})
    assert builds.build() == ["a"]
    assert builds.same_as_clean()


def test_hooks_and_dependencies_in_colcon_meta_are_inputs(forge: Forge, tree: Tree) -> None:
    text = "install(FILES h.sh DESTINATION share/a)\n"
    root = tree(cmake("a", text) | cmake("b", "") | {"src/a/h.sh": "export FOO=1\n"})
    builds = Builds(forge, root)
    builds.build()
    for said in ("hooks: [share/a/h.sh]", "run-dependencies: [zlib]"):
        tree({"colcon.meta": f"names:\n  a:\n    {said}\n"})
        assert builds.build() == ["a"]
    (root / "colcon.meta").unlink()
    tree({"forge.toml": '[packages.a]\nrun-dependencies = ["zlib1g"]\n'})
    assert builds.build() == ["a"]
    assert builds.same_as_clean()


def test_user_options_do_not_rebuild_embedded_packages(forge: Forge, tree: Tree) -> None:
    text = "find_package(ament_cmake REQUIRED)\nament_package()\n"
    files = cmake("a", text, "<buildtool_depend>ament_cmake</buildtool_depend>", build=False)
    files["src/a/package.xml"] = files["src/a/package.xml"].replace(">cmake<", ">ament_cmake<")
    builds = Builds(forge, tree(files))
    assert builds.build() == ["a", "ament_cmake"]
    options = ("--symlink-install", "--ament-cmake-args", "-DX=1", "--cmake-args", "-DCMAKE_BUILD_TYPE=Debug")
    assert builds.build({"CXXFLAGS": "-O1"}, *options) == ["a"]


def test_cached_results_depend_on_variables_and_programs(forge: Forge, tree: Tree) -> None:
    tools = {f"opt/b{i}/mytool": f"#!/bin/sh\necho {i}\n" for i in "12"} | {"opt/COLCON_IGNORE": ""}
    root = tree(cmake("a", GENERATED + "add_definitions(-DW=$ENV{FOO}1)\n") | tools)
    made = []
    for folder, value in (("b1", "1"), ("b2", "1"), ("b2", "2"), ("b1", "1")):
        shutil.rmtree(root / "install", ignore_errors=True)
        shutil.rmtree(root / "build", ignore_errors=True)
        variables = path(root / "opt" / folder) | {"FOO": value}
        ran = forge("build", "--cache", str(root / "cache"), cwd=root, env=variables)
        made.append("came from the cache" in ran.out)
    assert made == [False, False, False, True], "the first three are three different results"


READS_A_COPY = {
    "awk": """find_program(AWK awk)
execute_process(COMMAND ${AWK} [[BEGIN { print "#define V 1" ENVIRON["MINE"] }]]
                OUTPUT_FILE ${CMAKE_BINARY_DIR}/v.h)
""",
    "a template": """find_package(Python3 REQUIRED COMPONENTS Interpreter)
execute_process(COMMAND ${Python3_EXECUTABLE} ${CMAKE_SOURCE_DIR}/fill.py ${CMAKE_SOURCE_DIR}/v.h.in
                OUTPUT_FILE ${CMAKE_BINARY_DIR}/v.h)
""",
}


@pytest.mark.parametrize("reader", READS_A_COPY)
def test_variables_named_in_scripts_that_copy_the_environment_are_inputs(
    forge: Forge, tree: Tree, reader: str
) -> None:
    files = cmake("a", READS_A_COPY[reader] + "include_directories(${CMAKE_BINARY_DIR})\n") | {
        "src/a/x.c": '#include "v.h"\n' + MAIN,
        "src/a/fill.py": "import os, sys\nprint(os.path.expandvars(open(sys.argv[1]).read()))\n",
        "src/a/v.h.in": "#define V 1$MINE\n",
    }
    builds = Builds(forge, tree(files))
    builds.build({"MINE": "1"})
    assert builds.build({"MINE": "2"}) == ["a"]
    assert builds.build({"MINE": "2", "OTHER": "1"}) == []
    assert builds.same_as_clean({"MINE": "2"})


def test_a_library_that_shadows_another_causes_a_rebuild(forge: Forge, tree: Tree) -> None:
    text = """execute_process(COMMAND $ENV{TOOL} OUTPUT_VARIABLE v)
add_definitions(-DV=${v})
"""
    root = tree(cmake("a", text))
    folder = root / "tools"
    for name in ("first", "second"):
        (folder / name).mkdir(parents=True)
    for value, name in ((1, "second"), (2, "later")):
        (folder / "l.c").write_text(f"int value(void) {{ return {value}; }}\n")
        library = folder / ("second/libvalue.so" if name == "second" else name)
        subprocess.run(["gcc", "-shared", "-fPIC", "-o", library, folder / "l.c"], check=True)
    (folder / "t.c").write_text(
        '#include <stdio.h>\nint value(void);\nint main(void) { printf("%d", value()); }\n'
    )
    command = f"gcc -o '{folder}/tool' '{folder}/t.c' '-L{folder}/second' -lvalue"
    subprocess.run(command, shell=True, check=True)
    env = {"TOOL": f"{folder}/tool", "LD_LIBRARY_PATH": f"{folder}/first:{folder}/second"}
    builds = Builds(forge, root)
    builds.build(env)
    (folder / "later").rename(folder / "first/libvalue.so")
    assert builds.build(env) == ["a"]
    assert builds.build(env) == []
    assert builds.same_as_clean(env)


def test_home_and_locale_are_inputs_only_if_named(forge: Forge, tree: Tree) -> None:
    text = 'string(LENGTH "$ENV{HOME}$ENV{LC_TIME}" n)\nadd_definitions(-DV=${n})\n'
    builds = Builds(forge, tree(cmake("a", text) | cmake("b", "")))
    builds.build({"HOME": "/h", "LC_TIME": "C"})
    assert builds.build({"HOME": "/h", "LC_TIME": "C.UTF-8"}) == ["a"]
    assert builds.build({"HOME": "/h/2", "LC_TIME": "C.UTF-8"}) == ["a"]
    assert builds.build({"HOME": "/h/2", "LC_TIME": "C.UTF-8", "LC_NAME": "C"}) == []


def test_an_expanded_home_folder_is_an_input(forge: Forge, tree: Tree) -> None:
    text = "execute_process(COMMAND sh ${CMAKE_SOURCE_DIR}/v.sh OUTPUT_VARIABLE v)\nadd_definitions(${v})\n"
    files = cmake("a", text) | {"src/a/v.sh": "printf %s -DV=1; cd ~ && pwd | tr -dc 0-9\n"}
    root = tree(files | {"1/x": "", "2/x": ""})
    builds = Builds(forge, root)
    builds.build({"HOME": f"{root}/1"})
    assert builds.build({"HOME": f"{root}/2"}) == ["a"]
    assert builds.same_as_clean({"HOME": f"{root}/2"})


def test_variables_named_in_sources_are_inputs_of_unobserved_builds(forge: Forge, tree: Tree) -> None:
    """They cannot tell which of them the build requests."""
    run = "execute_process(COMMAND sh ${CMAKE_SOURCE_DIR}/v.sh OUTPUT_VARIABLE v)\nadd_definitions(${v})\n"
    shared = "find_package(shared REQUIRED)\n"
    config = "install(FILES sharedConfig.cmake DESTINATION share/shared/cmake)\n"
    setup = "import os\nfrom setuptools import setup\nsetup(name='p', description=os.getenv('MINE', '-'))\n"
    files = {
        **cmake("lists", "add_definitions(-DV=1$ENV{MINE})\n"),
        **cmake("script", run),
        "src/script/v.sh": "printf %s -DV=1$MINE\n",
        **cmake("shared", config, build=False),
        "src/shared/sharedConfig.cmake": "add_definitions(-DV=1$ENV{MINE})\n",
        **cmake("using", shared, "<depend>shared</depend>"),
        **cmake("other", "add_definitions(-DV=1)\n"),
        "src/p/package.xml": manifest_text("p", build_type="ament_python"),
        "src/p/setup.py": setup,
    }
    builds = Builds(forge, tree(files), "--no-observer")
    builds.build({"MINE": "1"})
    assert builds.build({"MINE": "1"}) == []
    assert builds.build({"MINE": "2"}) == ["lists", "p", "script", "shared", "using"]
    assert builds.same_as_clean({"MINE": "2"})


def test_observed_builds_ignore_results_with_unknown_inputs(forge: Forge, tree: Tree) -> None:
    root = tree(cmake("a", "add_definitions(-DV=1$ENV{MINE})\n"))
    for value, options in (("1", ("--no-observer",)), ("2", ())):
        for folder in ("build", "install", "log"):
            shutil.rmtree(root / folder, ignore_errors=True)
        ran = forge("build", "--cache", "cache", *options, cwd=root, env={"MINE": value})
        assert ran.code == 0, ran.err
        printed = subprocess.run([root / "install/a/bin/a_x"], capture_output=True, check=True).stdout
        assert printed == f"1{value}".encode()
