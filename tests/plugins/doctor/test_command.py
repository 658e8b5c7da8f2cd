"""`forge doctor` reports problems with their location and a hint, and none in a correct workspace."""

import json
import os
import re
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import Forge, Tree
from tests.packages import manifest_text, write_files

CMAKE = "cmake_minimum_required(VERSION 3.18)\nproject({name} NONE)\n{lines}\n"
SETUP = "from setuptools import find_packages, setup\nsetup(name='{name}', packages=['{name}'])\n"
INTERFACES = "<member_of_group>rosidl_interface_packages</member_of_group>"
OTHER = "1.2" if sys.version_info[:2] != (1, 2) else "1.3"


def lists(name: str, *lines: str) -> str:
    return CMAKE.format(name=name, lines="\n".join(lines))


def cmake_package(name: str, *lines: str, depends: tuple[str, ...] = ()) -> dict[str, str]:
    needed = (f"<depend>{depend}</depend>" for depend in depends)
    return {
        f"src/{name}/package.xml": manifest_text(name, *needed, build_type="cmake"),
        f"src/{name}/CMakeLists.txt": lists(name, *lines),
    }


def ament_package(name: str, *lines: str) -> dict[str, str]:
    ament = ("find_package(ament_cmake REQUIRED)", "ament_package()")
    return {
        f"src/{name}/package.xml": manifest_text(
            name, "<buildtool_depend>ament_cmake</buildtool_depend>", *lines
        ),
        f"src/{name}/CMakeLists.txt": lists(name, *ament),
    }


def python_package(name: str, text: str, *lines: str) -> dict[str, str]:
    return {
        f"src/{name}/package.xml": manifest_text(name, *lines, build_type="ament_python"),
        f"src/{name}/setup.py": SETUP.format(name=name),
        f"src/{name}/{name}/__init__.py": text,
    }


def findings(forge: Forge, root: Path, *argv: str, env: dict[str, str] | None = None) -> dict[str, Any]:
    """Return the JSON of `forge doctor`, and check its exit code."""
    ran = forge("doctor", "--json", *argv, cwd=root, env=env or {})
    assert ran.err == ""
    found: dict[str, Any] = json.loads(ran.out)
    assert ran.code == (2 if found["errors"] else 0)
    return found


def of_topic(found: dict[str, Any], topic: str) -> list[dict[str, Any]]:
    return [finding for finding in found["findings"] if finding["topic"] == topic]


@pytest.mark.needs("cmake", "g++")
def test_all_checks_are_listed_and_summarized(forge: Forge, tree: Tree) -> None:
    root = tree({**cmake_package("a"), **cmake_package("b", "find_package(a REQUIRED)", depends=("a",))})
    found = findings(forge, root)
    assert found["errors"] == 0, found["findings"]
    assert not [f for f in found["findings"] if f["topic"] in {"workspace", "declared", "shadows", "results"}]
    topics = [topic["topic"] for topic in found["checked"]]
    assert topics[:5] == ["workspace", "compiler", "cmake", "ninja", "python"]
    assert "C++17" in found["checked"][1]["summary"]
    good = forge("doctor", cwd=root).out.splitlines()[-1]
    assert good.startswith(("no problems found", "no errors; "))
    (root / "src/a/package.xml").write_text("<package>", encoding="utf-8")
    bad = forge("doctor", cwd=root)
    assert bad.code == 2
    assert bad.out.splitlines()[-1].startswith("1 error prevents builds")
    assert "src/a/package.xml:" in bad.out


def test_doctor_works_outside_of_a_workspace(forge: Forge, tmp_path: Path) -> None:
    found = findings(forge, tmp_path)
    assert found["checked"][0] == {"topic": "workspace", "summary": "no packages found"}
    home = findings(forge, tmp_path, env={"HOME": str(tmp_path)})
    assert "not searching for packages" in home["checked"][0]["summary"]


def test_an_undeclared_required_workspace_package_is_an_error(forge: Forge, tree: Tree) -> None:
    root = tree({**cmake_package("a"), **cmake_package("b", "# find_package(x)", "find_package(a REQUIRED)")})
    found = findings(forge, root)
    assert of_topic(found, "declared") == [
        {
            "severity": "error",
            "topic": "declared",
            "message": "'b' uses 'a' without declaring it in its manifest",
            "file": "src/b/CMakeLists.txt",
            "line": 4,
            "hint": "add <depend>a</depend> to src/b/package.xml",
        }
    ]


@pytest.mark.parametrize(
    ("line", "severity", "tag"),
    [
        ("find_package(a)", "warning", "depend"),
        ("if(X)\nfind_package(a REQUIRED)\nendif()", "warning", "depend"),
        ("if(BUILD_TESTING)\nfind_package(a REQUIRED)\nendif()", "warning", "test_depend"),
        ("ament_target_dependencies(main PUBLIC a)", "error", "depend"),
        ("find_package(std_msgs REQUIRED)", "warning", None),
        ("find_package(Threads REQUIRED)", None, None),
        ("find_package(${name} REQUIRED)", None, None),
    ],
)
def test_an_undeclared_package_has_the_right_severity(
    forge: Forge, tree: Tree, line: str, severity: str | None, tag: str | None
) -> None:
    found = of_topic(findings(forge, tree({**cmake_package("a"), **cmake_package("b", line)})), "declared")
    assert [finding["severity"] for finding in found] == ([severity] if severity else [])
    if tag:
        assert found[0]["hint"] == f"add <{tag}>a</{tag}> to src/b/package.xml"


def test_transitive_dependencies_are_only_noted(forge: Forge, tree: Tree) -> None:
    root = tree(
        {
            **cmake_package("a"),
            **cmake_package("b", "find_package(a REQUIRED)", depends=("a",)),
            **cmake_package("c", "find_package(a REQUIRED)", "find_package(b REQUIRED)", depends=("b",)),
        }
    )
    assert [f["severity"] for f in of_topic(findings(forge, root), "declared")] == ["note"]
    out = forge("doctor", cwd=root).out
    assert re.search(
        r"^ok +declared +1 used that only other dependencies declare \(--all\)$", out, re.MULTILINE
    )


def test_python_imports_are_compared_with_the_manifest(forge: Forge, tree: Tree) -> None:
    text = "import os, a.deep\ntry:\n    import b\nexcept ImportError:\n    pass\n"
    root = tree({**python_package("a", ""), **python_package("b", ""), **python_package("c", text)})
    found = of_topic(findings(forge, root), "declared")
    assert [(f["message"], f["file"], f["line"], f["hint"]) for f in found] == [
        (
            "'c' uses 'a' without declaring it in its manifest",
            "src/c/c/__init__.py",
            1,
            "add <exec_depend>a</exec_depend> to src/c/package.xml",
        )
    ]


def test_unused_dependencies_are_only_noted(forge: Forge, tree: Tree) -> None:
    root = tree({**cmake_package("a"), **cmake_package("b", depends=("a",))})
    assert [f["severity"] for f in of_topic(findings(forge, root), "declared")] == ["note"]
    assert "mentions it" not in forge("doctor", cwd=root).out
    assert "mentions it" in forge("doctor", "--all", cwd=root).out


def test_modules_that_shadow_others_are_reported(forge: Forge, tree: Tree) -> None:
    twin = {**python_package("b", ""), "src/b/a/__init__.py": ""}
    root = tree({**python_package("a", ""), **twin, **python_package("logging", "")})
    messages = [finding["message"] for finding in of_topic(findings(forge, root), "shadows")]
    assert messages == [
        "the Python module 'a' is in 'a' and 'b'",
        "the module 'logging' of 'logging' hides a module of Python's standard library",
    ]


@pytest.mark.needs("cmake")
def test_a_too_new_required_cmake_version_is_reported(forge: Forge, tree: Tree) -> None:
    root = tree(cmake_package("a"))
    (root / "src/a/CMakeLists.txt").write_text("cmake_minimum_required(VERSION 99.1)\nproject(a NONE)\n")
    (finding,) = of_topic(findings(forge, root), "cmake")
    assert finding["message"].startswith("'a' requires CMake 99.1, but CMake ")
    assert (finding["file"], finding["line"]) == ("src/a/CMakeLists.txt", 1)


def test_a_broken_compiler_is_an_error_for_packages_that_use_it(forge: Forge, tree: Tree) -> None:
    root = tree({**cmake_package("a"), "bin/c++": "#!/bin/sh\necho 'error: no such dialect' >&2\nexit 1\n"})
    broken = {"CXX": str(root / "bin/c++")}
    assert of_topic(findings(forge, root, env=broken), "compiler")[0]["severity"] == "warning"
    (root / "src/a/CMakeLists.txt").write_text("project(a CXX)\n", encoding="utf-8")
    (finding,) = of_topic(findings(forge, root, env=broken), "compiler")
    assert finding["severity"] == "error"
    assert "no such dialect" in finding["message"]


def test_a_missing_interpreter_is_reported(forge: Forge, tree: Tree) -> None:
    found = findings(forge, tree(cmake_package("a")), "--python", "no-such-python")
    assert of_topic(found, "python")[0]["message"] == "python 'no-such-python' not found"


def test_files_with_future_times_are_reported(forge: Forge, tree: Tree) -> None:
    root = tree(cmake_package("a"))
    os.utime(root / "src/a/CMakeLists.txt", (time.time() + 3600,) * 2)
    (finding,) = of_topic(findings(forge, root), "clock")
    assert finding["file"] == "src/a/CMakeLists.txt"
    assert "touch src/a/CMakeLists.txt" in finding["hint"]


@pytest.mark.parametrize(
    ("variables", "message"),
    [
        ({"AMENT_PREFIX_PATH": "/gone"}, "'AMENT_PREFIX_PATH' names '/gone', which does not exist"),
        ({"ROS_VERSION": "1"}, "the environment is for ROS 1"),
        ({"ROS_PACKAGE_PATH": "/x"}, "the environment is for ROS 1"),
        ({"CMAKE_PREFIX_PATH": "/gone"}, "'CMAKE_PREFIX_PATH' names '/gone', which does not exist"),
        ({"COLCON_DEFAULTS_FILE": "/gone.yaml"}, "'COLCON_DEFAULTS_FILE' names '/gone.yaml'"),
        ({"AMENT_CURRENT_PREFIX": "/x"}, "'AMENT_CURRENT_PREFIX' is set"),
        (
            {"PYTHONPATH": f"/x/lib/python{OTHER}/site-packages"},
            f"'PYTHONPATH' contains '/x/lib/python{OTHER}",
        ),
    ],
)
def test_leftover_variables_are_reported(
    forge: Forge, tmp_path: Path, variables: dict[str, str], message: str
) -> None:
    checked = findings(forge, tmp_path, env=variables)
    found = [*of_topic(checked, "environment"), *of_topic(checked, "underlays")]
    assert any(finding["message"].startswith(message) and finding["hint"] for finding in found), found


def test_underlays_are_checked(forge: Forge, tree: Tree) -> None:
    """Modules for another Python, missing dependencies, underlays in the wrong order."""
    root = tree(
        {
            **cmake_package("a"),
            "low/.colcon_install_layout": "merged\n",
            "low/local_setup.sh": "",
            "low/share/colcon-core/packages/x": "",
            f"low/lib/python3.{OTHER[-1]}/site-packages/x.py": "",
            "high/.colcon_install_layout": "merged\n",
            "high/local_setup.sh": "",
            "high/share/colcon-core/packages/y": "boost:lost_driver:python3-numpy:x",
        }
    )
    low, high = root / "low", root / "high"
    (high / ".forge.json").write_text(json.dumps({"python": sys.executable, "underlays": [str(low)]}))
    env = {"COLCON_PREFIX_PATH": f"{low}:{high}"}
    found = findings(forge, root, "--base-paths", "src", env=env)
    lacks = f"'y' in '{high}' needs 'lost_driver', which no sourced underlay contains"
    assert [(finding["severity"], finding["message"]) for finding in of_topic(found, "underlays")] == [
        ("warning", f"'{high}' was built on '{low}', but is sourced before it"),
        ("note", lacks),
    ], "with all its underlays, 'high' was built without it"
    alone = findings(forge, root, "--base-paths", "src", env={"COLCON_PREFIX_PATH": str(high)})
    (lost,) = of_topic(alone, "underlays")
    assert (lost["severity"], lost["message"]) == ("warning", lacks), "one of its underlays is not sourced"
    (refusal,) = of_topic(found, "python")
    assert refusal["severity"] == "error"
    assert refusal["message"].startswith(f"the underlay '{low}' is for python 3.{OTHER[-1]}, but the active ")


def test_findings_of_one_kind_are_grouped(forge: Forge, tree: Tree) -> None:
    """JSON still contains each finding with its file."""
    setup = SETUP.replace(")", ", entry_points={{'console_scripts': ['run = p:main']}})")
    names = [f"p{number}" for number in range(5)]
    root = tree({file: text for name in names for file, text in python_package(name, "").items()})
    for name in names:
        (root / "src" / name / "setup.py").write_text(setup.format(name=name))
    lines = forge("doctor", cwd=root).out.splitlines()
    found = [line for line in lines if "where 'forge run' does not find them" in line]
    listed = "'p0', 'p1', 'p2', 'p3', 'p4'"
    assert [line.partition(" are ")[0] for line in found] == [f"warning: executables of {listed}"]
    assert lines[lines.index(found[0]) + 1].startswith("hint: add install_scripts=$base/lib/NAME ")
    assert [finding["file"] for finding in of_topic(findings(forge, root), "names")] == [
        f"src/{name}/setup.cfg" for name in names
    ]


@pytest.mark.needs("cmake")
def test_an_overlay_of_a_forge_workspace_has_no_problems(forge: Forge, built: Tree) -> None:
    """Embedded packages in the underlay need no Python modules of ROS, and rosdep keys are no packages."""
    root = built({**ament_package("below", "<depend>rosidl_default_generators</depend>"), "over/src/x": ""})
    over = write_files(root / "over", ament_package("above", "<depend>below</depend>", INTERFACES))
    found = findings(forge, over, env={"COLCON_PREFIX_PATH": f"{root}/install"})
    assert [found for found in found["findings"] if found["topic"] in {"python", "underlays"}] == []


def test_missing_modules_of_a_distribution_are_reported(forge: Forge, tree: Tree) -> None:
    """The code generators of a distribution import them; without a manifest, a package is not installed."""
    root = tree(ament_package("a", INTERFACES))
    ros = root / "ros"
    (ros / "share/ament_cmake_core/cmake").mkdir(parents=True)
    (ros / "share/rosidl_cmake/cmake").mkdir(parents=True)
    bare = tree({"bare": f'#!/bin/sh\nexec {sys.executable} -I -S "$@"\n'}) / "bare"
    env = {"AMENT_PREFIX_PATH": str(ros)}

    def lacking() -> str:
        (finding,) = of_topic(findings(forge, root, "--python", str(bare), env=env), "python")
        return str(finding["message"])

    assert lacking().endswith("required by the build: 'numpy'")
    for name in ("ament_cmake_core", "rosidl_cmake"):
        (ros / "share" / name / "package.xml").write_text(manifest_text(name))
    assert lacking().endswith("required by the build: 'numpy', 'catkin_pkg', 'em', 'lark'")


def test_folders_of_other_tools_and_versions_are_reported(forge: Forge, tree: Tree) -> None:
    root = tree(
        {
            **cmake_package("a"),
            "build/.built_by": "catkin_make\n",
            "build/a/CMakeCache.txt": "CMAKE_HOME_DIRECTORY:INTERNAL=/elsewhere/src/a\n",
            "install/.colcon_install_layout": "merged\n",
        }
    )
    found = of_topic(findings(forge, root), "results")
    assert [finding["severity"] for finding in found] == ["error", "error", "note"]
    assert "was created by 'catkin_make'" in found[0]["message"]
    assert "the merged layout, not the isolated one" in found[1]["message"]
    assert "'/elsewhere/src/a'" in found[2]["message"]


def test_a_login_shell_without_setup_scripts_is_reported(forge: Forge, tmp_path: Path) -> None:
    (finding,) = of_topic(findings(forge, tmp_path, env={"SHELL": "/bin/tcsh"}), "shells")
    assert "forge shell" in finding["hint"]


def test_packages_missing_from_the_ament_index_are_reported(forge: Forge, tree: Tree) -> None:
    """The build succeeds, but nothing finds the package. Other calls may register it."""
    endings = {
        "a": "ament_auto_package()",
        "b": "# ament_package()",
        "c": "include(cmake/all.cmake)",
        "d": "ament_python_install_package(d)",
        "e": "my_package(x)",
    }
    root = tree(
        {
            **{f"src/{name}/package.xml": manifest_text(name) for name in endings},
            **{f"src/{name}/CMakeLists.txt": lists(name, line) for name, line in endings.items()},
        }
    )
    checked = findings(forge, root)
    assert {"topic": "names", "summary": "2 problems"} in checked["checked"]
    found = of_topic(checked, "names")
    assert [(f["severity"], f["file"], f["message"].partition(":")[0]) for f in found] == [
        ("warning", "src/b/CMakeLists.txt", "'b' does not call ament_package()"),
        ("warning", "src/d/CMakeLists.txt", "'d' does not call ament_package()"),
    ]


def test_inconsistent_names_are_reported(forge: Forge, tree: Tree) -> None:
    root = tree({**cmake_package("a"), **python_package("b", ""), **python_package("c", "")})
    (root / "src/a/package.xml").write_text(manifest_text("a"), encoding="utf-8")
    (root / "src/a/CMakeLists.txt").write_text(lists("b", "ament_package()"), encoding="utf-8")
    points = "name='x', entry_points={'console_scripts': ['go = c:main']}, packages=['c'])\n"
    (root / "src/c/setup.py").write_text(f"from setuptools import setup\nsetup({points}", encoding="utf-8")
    found = of_topic(findings(forge, root), "names")
    assert [(f["severity"], f["message"], f["file"]) for f in found] == [
        ("error", "the name is 'a' in package.xml, but 'b' in project()", "src/a/CMakeLists.txt"),
        ("warning", "the name is 'c' in package.xml, but 'x' in setup.py", "src/c/setup.py"),
        (
            "warning",
            "executables of 'c' are installed in 'bin', where 'forge run' does not find them",
            "src/c/setup.cfg",
        ),
    ]
    assert "install_scripts=$base/lib/c" in found[2]["hint"]


@pytest.mark.parametrize(
    ("table", "text"),
    [
        ("build", "packages-ignore = ['b']"),
        ("build", "packages-skip = ['b']"),
        ("build", "packages-select = ['a']"),
        ("build", "base-paths = ['src/a']"),
        ("profiles.ci.build", "packages-skip = ['b']"),
    ],
)
def test_packages_excluded_from_the_build_are_not_checked(
    forge: Forge, tree: Tree, table: str, text: str
) -> None:
    profile = ("--profile", "ci") if "ci" in table else ()
    more = {"forge.toml": f"[{table}]\n{text}\nsymlink-install = true\n"}
    root = tree({**cmake_package("a", ""), **cmake_package("b", ""), **more})
    ran = forge("doctor", *profile, cwd=root)
    assert "ok workspace 1 package ok" in " ".join(ran.out.split())
    assert "forge.toml" not in ran.err
