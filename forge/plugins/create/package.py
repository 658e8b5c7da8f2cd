"""Renders the folders and files of a new package from the options of `forge pkg create`."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterator

from forge.base.errors import Problem, raise_if_any
from forge.base.frozen import frozen
from forge.base.names import CPP20_KEYWORDS, CPP_KEYWORDS, LOWER_NAME, TYPE_NAME, is_email, is_package_name
from forge.base.templating import render
from forge.workspace.model import Person

BUILD_TYPES = ("cmake", "ament_cmake", "ament_python")
LICENSES = {
    "Apache-2.0": "Apache-2.0.txt",
    "BSL-1.0": "BSL-1.0.txt",
    "BSD-2.0": "BSD-3-Clause.txt",  # historical name in ROS
    "BSD-2-Clause": "BSD-2-Clause.txt",
    "BSD-3-Clause": "BSD-3-Clause.txt",
    "MIT": "MIT.txt",
    "MIT-0": "MIT-0.txt",
    "GPL-3.0-only": "GPL-3.0-only.txt",
    "LGPL-3.0-only": "LGPL-3.0-only.txt",
}
"""License templates by SPDX identifier, as known to ament."""

VERSION = "0.0.0"
UNDECLARED_LICENSE = "TODO: License declaration"
EXAMPLE_INTERFACES = ("Example.msg", "Example.srv", "Example.action")

_SCHEMA = "http://download.ros.org/schema/package_format{}.xsd"
_TARGET = re.compile(r"[a-zA-Z][a-zA-Z0-9_-]*")
_WORD = re.compile(r"[a-zA-Z][a-zA-Z0-9_]*")
_INTERFACE_TEMPLATES = {"msg": "message.msg.j2", "srv": "service.srv.j2", "action": "action.action.j2"}
_UNWRITABLE = re.compile("[^\t\n\x20-\x7e\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_CMAKE_TARGETS = """
    all clean edit_cache help install package package_source preinstall rebuild_cache test uninstall
"""
_TEST_TOOLS = {
    "ament_cmake": ("ament_lint_auto", "ament_lint_common"),
    "ament_python": ("ament_copyright", "ament_flake8", "ament_pep257", "python3-pytest"),
}
_ESCAPES = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;"})


@frozen
class NewPackage:
    """The properties of a new package, validated for all files in which they appear.

    Raises ForgeError with all invalid properties.
    """

    name: str
    maintainer: Person
    build_type: str = "ament_cmake"
    format: int = 3
    description: str = "TODO: Package description"
    license: str = UNDECLARED_LICENSE
    dependencies: tuple[str, ...] = ()
    node: str | None = None
    library: str | None = None
    interfaces: tuple[str, ...] = ()
    """File names of interface definitions, such as 'Pose.msg'."""

    def __post_init__(self) -> None:
        raise_if_any(_problems(self))


def render_package(blueprint: NewPackage) -> dict[str, str | None]:
    """Return the text of each file of the package by its path, and None for each folder, before its files."""
    name, library, node = blueprint.name, blueprint.library, blueprint.node
    cmake_tools: tuple[str, ...] = ()
    build_tools: tuple[str, ...] = ()
    if blueprint.interfaces:
        cmake_tools = build_tools = ("ament_cmake", "rosidl_default_generators")
    elif blueprint.build_type == "ament_cmake":
        cmake_tools = ("ament_cmake", "ament_cmake_ros") if library else ("ament_cmake",)
        build_tools = cmake_tools[-1:]
    namespace = name.replace("-", "_")
    if namespace[0].isdigit() or namespace in CPP_KEYWORDS | CPP20_KEYWORDS:
        namespace = f"pkg_{namespace}"
    macro = namespace.upper()
    person = blueprint.maintainer
    names: dict[str, object] = {
        "name": name,
        "version": VERSION,
        "tools": cmake_tools,
        "dependencies": tuple(each for each in blueprint.dependencies if each not in cmake_tools),
        "node": node,
        "library": library,
        "namespace": namespace,
        "macro": macro,
        "class_name": "".join(part[:1].upper() + part[1:] for part in (library or "").split("_")),
    }
    # rosidl requires this dependency of actions in the manifest.
    implied = ("action_msgs",) if any(file.endswith(".action") for file in blueprint.interfaces) else ()
    groups = [
        [("buildtool_depend", each) for each in build_tools],
        [("depend", each) for each in dict.fromkeys((*blueprint.dependencies, *implied))],
    ]
    if blueprint.interfaces:
        groups += [[("exec_depend", "rosidl_default_runtime")]]
        groups += [[("member_of_group", "rosidl_interface_packages")]]
    else:
        groups += [[("test_depend", each) for each in _TEST_TOOLS.get(blueprint.build_type, ())]]
    texts = {
        "description": blueprint.description,
        "email": person.email or "",
        "maintainer": person.name,
        "license": blueprint.license,
    }
    manifest = render(
        "create/templates/package.xml.j2",
        schema=_SCHEMA.format(blueprint.format),
        format=blueprint.format,
        name=name,
        version=VERSION,
        groups=list(filter(None, groups)),
        build_type=blueprint.build_type,
        **{key: text.translate(_ESCAPES) for key, text in texts.items()},
    )
    files: dict[str, str | None] = {"package.xml": manifest}

    def add(path: str, template: str, **more: object) -> None:
        files[path] = render(f"create/templates/{template}.j2", **names, **more)

    if blueprint.build_type == "ament_python":
        files[name] = None
        literals = {
            "maintainer": repr(person.name),
            "email": repr(person.email),
            "description": repr(blueprint.description),
            "license": repr(blueprint.license),
        }
        add("setup.py", "ament_python/setup.py", **literals)
        add("setup.cfg", "ament_python/setup.cfg")
        files |= {"resource": None, f"resource/{name}": "", f"{name}/__init__.py": "", "test": None}
        for test in ("test_copyright.py", "test_flake8.py", "test_pep257.py"):
            add(f"test/{test}", f"ament_python/{test}")
        if node:
            add(f"{name}/{node}.py", "ament_python/node.py")
        if library:
            files |= {f"{name}/{library}": None, f"{name}/{library}/__init__.py": ""}
    elif blueprint.interfaces:
        paths = []
        for kind, interface_template in _INTERFACE_TEMPLATES.items():
            definitions = [file for file in blueprint.interfaces if file.endswith(f".{kind}")]
            files |= {kind: None} if definitions else {}
            for file in definitions:
                paths.append(f"{kind}/{file}")
                stem = file.removesuffix(f".{kind}")
                files[paths[-1]] = render(f"create/templates/interfaces/{interface_template}", name=stem)
        add("CMakeLists.txt", "interfaces/CMakeLists.txt", interfaces=paths)
    else:
        files |= {"src": None, f"include/{name}": None}
        add("CMakeLists.txt", f"{blueprint.build_type}/CMakeLists.txt")
        if blueprint.build_type == "cmake":
            add(f"{name}Config.cmake.in", "cmake/Config.cmake.in")
            add(f"{name}ConfigVersion.cmake.in", "cmake/ConfigVersion.cmake.in")
        if node:
            add(f"src/{node}.cpp", "cpp/node.cpp")
        if library:
            include = f"include/{name}"
            add(f"{include}/{library}.hpp", "cpp/library.hpp", guard=f"{macro}__{library.upper()}_HPP_")
            add(f"src/{library}.cpp", "cpp/library.cpp")
            guard = f"{macro}__VISIBILITY_CONTROL_H_"
            add(f"{include}/visibility_control.h", "cpp/visibility_control.h", guard=guard)
    if blueprint.license in LICENSES:
        files["LICENSE"] = render(
            f"create/templates/licenses/{LICENSES[blueprint.license]}", holder=person.name
        )
    return files


def placeholder_email(name: str) -> str:
    return f"{re.sub('[^-a-zA-Z0-9_%+]+', '.', name).strip('.') or 'maintainer'}@todo.todo"


def _problems(blueprint: NewPackage) -> Iterator[Problem]:
    name, python = blueprint.name, blueprint.build_type == "ament_python"
    if not is_package_name(name):
        hint = "use letters, digits, '_' and '-', and start with a letter or digit"
        yield Problem(f"invalid package name '{name}'", hint=hint)
    elif python and name == "test":
        hint = "the folder 'test' is reserved for tests"
        yield Problem("a Python package cannot be named 'test'", hint=hint)
    elif python and (not _WORD.fullmatch(name) or keyword.iskeyword(name)):
        yield Problem(
            f"invalid Python package name '{name}'", hint=f"'import {name}' would be a syntax error"
        )
    for dependency in blueprint.dependencies:
        if not is_package_name(dependency):
            yield Problem(f"invalid dependency name '{dependency}'")
        elif dependency == name:
            yield Problem(f"package '{name}' cannot depend on itself")
    for option, target in (("--node-name", blueprint.node), ("--library-name", blueprint.library)):
        if target is None:
            continue
        # The name of a C++ node is only a file name; all others are also identifiers.
        binary = option == "--node-name" and not python
        fault = None
        if not (_TARGET if binary else _WORD).fullmatch(target):
            signs = "letters, digits, '_' and '-'" if binary else "letters, digits and '_'"
            fault = f"use {signs}, and start with a letter"
        elif python and keyword.iskeyword(target):
            fault = "this is a Python keyword"
        elif not python and target in _CMAKE_TARGETS.split():
            fault = "CMake reserves this name"
        if fault:
            yield Problem(f"invalid {option} '{target}'", hint=fault)
    if blueprint.node is not None and blueprint.node == blueprint.library:
        yield Problem(f"node and library cannot both be named '{blueprint.node}'")
    for file in blueprint.interfaces:
        stem, _, kind = file.partition(".")
        if kind not in _INTERFACE_TEMPLATES or not TYPE_NAME.fullmatch(stem):
            hint = "use letters and digits, start with a capital letter, and end with .msg, .srv or .action"
            yield Problem(f"invalid interface file '{file}'", hint=hint)
    if blueprint.interfaces and not LOWER_NAME.fullmatch(blueprint.name):
        hint = "use lower case letters, digits and single '_', and start with a letter"
        yield Problem(f"interfaces cannot be in a package named '{blueprint.name}'", hint=hint)
    if blueprint.interfaces and (blueprint.build_type != "ament_cmake" or blueprint.format < 3):
        message = "--interfaces requires the build type ament_cmake and package format 3"
        yield Problem(message, hint="put other programs into a separate package")
    if blueprint.interfaces and (blueprint.node or blueprint.library):
        message = "--interfaces cannot be combined with --node-name and --library-name"
        yield Problem(message, hint="put them into another package, which depends on this one")
    if not is_email(blueprint.maintainer.email or ""):
        message = f"invalid email address '{blueprint.maintainer.email}'"
        yield Problem(message, hint="set it with --maintainer-email")
    texts = {
        "--description": blueprint.description,
        "--license": blueprint.license,
        "--maintainer-name": blueprint.maintainer.name,
    }
    for option, text in texts.items():
        if not text.strip():
            yield Problem(f"{option} cannot be empty")
        elif _UNWRITABLE.search(text) or ("\n" in text and option != "--description"):
            yield Problem(f"{option} contains characters not allowed in XML: {text!r}")
