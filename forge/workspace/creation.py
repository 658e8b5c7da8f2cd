"""Renders the folders and files of a new package from the options of `forge pkg create`."""

from __future__ import annotations

import keyword
import re
from typing import TYPE_CHECKING

from forge.base.errors import Problem, raise_if_any
from forge.base.frozen import frozen
from forge.base.names import is_email, is_package_name
from forge.base.templating import render

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

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
_INTERFACE = re.compile(r"[A-Z][A-Za-z0-9]*")
_INTERFACE_PACKAGE = re.compile(r"(?!.*__)(?!.*_$)[a-z][a-z0-9_]*")
_INTERFACE_TEMPLATES = {"msg": "message.msg.j2", "srv": "service.srv.j2", "action": "action.action.j2"}
_UNWRITABLE = re.compile("[^\t\n\x20-\x7e\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_CMAKE_TARGETS = """
    all clean edit_cache help install package package_source preinstall rebuild_cache test uninstall
"""
_CPP_KEYWORDS = """
    alignas alignof and and_eq asm auto bitand bitor bool break case catch char char8_t char16_t char32_t
    class co_await co_return co_yield compl concept const const_cast consteval constexpr constinit continue
    decltype default delete do double dynamic_cast else enum explicit export extern false float for friend
    goto if inline int long mutable namespace new noexcept not not_eq nullptr operator or or_eq private
    protected public register reinterpret_cast requires return short signed sizeof static static_assert
    static_cast std struct switch template this thread_local throw true try typedef typeid typename union
    unsigned using virtual void volatile wchar_t while xor xor_eq
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
        problems = (*_name_problems(self), *_target_problems(self), *_interface_problems(self))
        raise_if_any((*problems, *_text_problems(self)))


@frozen
class GeneratedFile:
    """A file with its text, or a folder without; `path` is relative to the package and uses '/'."""

    path: str
    text: str | None = None


def render_package(blueprint: NewPackage) -> tuple[GeneratedFile, ...]:
    """Return the folders and files of the package, each folder before its files."""
    items: Iterable[GeneratedFile]
    match blueprint.build_type:
        case "ament_python":
            items = _python_items(blueprint)
        case "cmake":
            items = (*_cpp_folders(blueprint), *_cmake_items(blueprint), *_cpp_items(blueprint))
        case _ if blueprint.interfaces:
            items = _interface_items(blueprint)
        case _:
            tools = ("ament_cmake", "ament_cmake_ros") if blueprint.library else ("ament_cmake",)
            found = tuple(name for name in blueprint.dependencies if name not in tools)
            names = {**_names(blueprint), "tools": tools, "dependencies": found}
            items = (
                *_cpp_folders(blueprint),
                GeneratedFile("CMakeLists.txt", render("pkg/ament_cmake/CMakeLists.txt.j2", **names)),
                *_cpp_items(blueprint),
            )
    files = [GeneratedFile("package.xml", _manifest(blueprint)), *items]
    if template := LICENSES.get(blueprint.license):
        text = render(f"pkg/licenses/{template}", holder=blueprint.maintainer.name)
        files.append(GeneratedFile("LICENSE", text))
    return tuple(files)


def placeholder_email(name: str) -> str:
    """Return a placeholder address for a maintainer without one."""
    return f"{re.sub('[^-a-zA-Z0-9_%+]+', '.', name).strip('.') or 'maintainer'}@todo.todo"


def _name_problems(blueprint: NewPackage) -> Iterator[Problem]:
    name = blueprint.name
    if not is_package_name(name):
        hint = "use letters, digits, '_' and '-', and start with a letter or digit"
        yield Problem(f"invalid package name '{name}'", hint=hint)
    elif blueprint.build_type == "ament_python":
        if name == "test":
            hint = "the folder 'test' is reserved for tests"
            yield Problem("a Python package cannot be named 'test'", hint=hint)
        elif not _WORD.fullmatch(name) or keyword.iskeyword(name):
            hint = f"'import {name}' would be a syntax error"
            yield Problem(f"invalid Python package name '{name}'", hint=hint)
    for dependency in blueprint.dependencies:
        if not is_package_name(dependency):
            yield Problem(f"invalid dependency name '{dependency}'")
        elif dependency == name:
            yield Problem(f"package '{name}' cannot depend on itself")


def _target_problems(blueprint: NewPackage) -> Iterator[Problem]:
    for option, name in (("--node-name", blueprint.node), ("--library-name", blueprint.library)):
        if name is None:
            continue
        # A C++ node is only a file name; all others are identifiers, too.
        binary = option == "--node-name" and blueprint.build_type != "ament_python"
        if not (_TARGET if binary else _WORD).fullmatch(name):
            signs = "letters, digits, '_' and '-'" if binary else "letters, digits and '_'"
            yield Problem(f"invalid {option} '{name}'", hint=f"use {signs}, and start with a letter")
        elif blueprint.build_type == "ament_python" and keyword.iskeyword(name):
            yield Problem(f"invalid {option} '{name}'", hint="this is a Python keyword")
        elif blueprint.build_type != "ament_python" and name in _CMAKE_TARGETS.split():
            yield Problem(f"invalid {option} '{name}'", hint="CMake reserves this name")
    if blueprint.node is not None and blueprint.node == blueprint.library:
        yield Problem(f"node and library cannot both be named '{blueprint.node}'")


def _interface_problems(blueprint: NewPackage) -> Iterator[Problem]:
    if not blueprint.interfaces:
        return
    for name in blueprint.interfaces:
        stem, _, kind = name.partition(".")
        if kind not in _INTERFACE_TEMPLATES or not _INTERFACE.fullmatch(stem):
            hint = "use letters and digits, start with a capital letter, and end with .msg, .srv or .action"
            yield Problem(f"invalid interface file '{name}'", hint=hint)
    if not _INTERFACE_PACKAGE.fullmatch(blueprint.name):
        hint = "use lower case letters, digits and single '_', and start with a letter"
        yield Problem(f"interfaces cannot be in a package named '{blueprint.name}'", hint=hint)
    if blueprint.build_type != "ament_cmake" or blueprint.format < 3:
        message = "--interfaces requires the build type ament_cmake and package format 3"
        yield Problem(message, hint="put other programs into a package of their own")
    if blueprint.node or blueprint.library:
        message = "--interfaces cannot be combined with --node-name and --library-name"
        yield Problem(message, hint="put them into another package, which depends on this one")


def _text_problems(blueprint: NewPackage) -> Iterator[Problem]:
    person = blueprint.maintainer
    if not is_email(person.email or ""):
        yield Problem(f"invalid email address '{person.email}'", hint="set it with --maintainer-email")
    texts = (
        ("--description", blueprint.description),
        ("--license", blueprint.license),
        ("--maintainer-name", person.name),
    )
    for option, text in texts:
        if not text.strip():
            yield Problem(f"{option} cannot be empty")
        elif _UNWRITABLE.search(text) or ("\n" in text and option != "--description"):
            yield Problem(f"{option} contains characters not allowed in XML: {text!r}")


def _manifest(blueprint: NewPackage) -> str:
    """Return package.xml with dependencies grouped by type."""
    # rosidl requires this dependency of actions in the manifest.
    implied = ("action_msgs",) if any(name.endswith(".action") for name in blueprint.interfaces) else ()
    groups: tuple[tuple[tuple[str, str], ...], ...] = (
        tuple(("buildtool_depend", name) for name in _build_tools(blueprint)),
        tuple(("depend", name) for name in dict.fromkeys((*blueprint.dependencies, *implied))),
    )
    if blueprint.interfaces:
        groups += ((("exec_depend", "rosidl_default_runtime"),),)
        groups += ((("member_of_group", "rosidl_interface_packages"),),)
    else:
        groups += (tuple(("test_depend", name) for name in _TEST_TOOLS.get(blueprint.build_type, ())),)
    return render(
        "pkg/package.xml.j2",
        schema=_SCHEMA.format(blueprint.format),
        format=blueprint.format,
        name=blueprint.name,
        version=VERSION,
        description=_xml(blueprint.description),
        email=_xml(blueprint.maintainer.email or ""),
        maintainer=_xml(blueprint.maintainer.name),
        license=_xml(blueprint.license),
        groups=[group for group in groups if group],
        build_type=blueprint.build_type,
    )


def _build_tools(blueprint: NewPackage) -> tuple[str, ...]:
    if blueprint.build_type != "ament_cmake":
        return ()
    if blueprint.interfaces:
        return ("ament_cmake", "rosidl_default_generators")
    return ("ament_cmake_ros",) if blueprint.library else ("ament_cmake",)


def _cpp_folders(blueprint: NewPackage) -> tuple[GeneratedFile, ...]:
    return (GeneratedFile("src"), GeneratedFile(f"include/{blueprint.name}"))


def _interface_items(blueprint: NewPackage) -> Iterator[GeneratedFile]:
    """Yield the folders and definitions of each kind, and CMakeLists.txt."""
    paths = []
    for kind, template in _INTERFACE_TEMPLATES.items():
        files = [name for name in blueprint.interfaces if name.endswith(f".{kind}")]
        if files:
            yield GeneratedFile(kind)
        for file in files:
            paths.append(f"{kind}/{file}")
            name = file.removesuffix(f".{kind}")
            yield GeneratedFile(paths[-1], render(f"pkg/interfaces/{template}", name=name))
    tools = _build_tools(blueprint)
    names = {
        "name": blueprint.name,
        "dependencies": tuple(name for name in blueprint.dependencies if name not in tools),
        "interfaces": paths,
    }
    yield GeneratedFile("CMakeLists.txt", render("pkg/interfaces/CMakeLists.txt.j2", **names))


def _cmake_items(blueprint: NewPackage) -> tuple[GeneratedFile, ...]:
    names = _names(blueprint)
    return tuple(
        GeneratedFile(path, render(f"pkg/cmake/{template}", **names))
        for path, template in (
            ("CMakeLists.txt", "CMakeLists.txt.j2"),
            (f"{blueprint.name}Config.cmake.in", "Config.cmake.in.j2"),
            (f"{blueprint.name}ConfigVersion.cmake.in", "ConfigVersion.cmake.in.j2"),
        )
    )


def _cpp_items(blueprint: NewPackage) -> Iterator[GeneratedFile]:
    names = _names(blueprint)
    if blueprint.node:
        yield GeneratedFile(f"src/{blueprint.node}.cpp", render("pkg/cpp/node.cpp.j2", **names))
    if blueprint.library:
        include, library, macro = f"include/{blueprint.name}", blueprint.library, names["macro"]
        for path, template, guard in (
            (f"{include}/{library}.hpp", "library.hpp.j2", f"{macro}__{library.upper()}_HPP_"),
            (f"src/{library}.cpp", "library.cpp.j2", ""),
            (f"{include}/visibility_control.h", "visibility_control.h.j2", f"{macro}__VISIBILITY_CONTROL_H_"),
        ):
            yield GeneratedFile(path, render(f"pkg/cpp/{template}", **names, guard=guard))


def _python_items(blueprint: NewPackage) -> tuple[GeneratedFile, ...]:
    names = _names(blueprint)
    person = blueprint.maintainer
    literals = {
        "maintainer": repr(person.name),
        "email": repr(person.email),
        "description": repr(blueprint.description),
        "license": repr(blueprint.license),
    }
    package = blueprint.name
    tests = ("test_copyright.py", "test_flake8.py", "test_pep257.py")
    items = [
        GeneratedFile(package),
        GeneratedFile("setup.py", render("pkg/ament_python/setup.py.j2", **names, **literals)),
        GeneratedFile("setup.cfg", render("pkg/ament_python/setup.cfg.j2", **names)),
        GeneratedFile("resource"),
        GeneratedFile(f"resource/{package}", ""),
        GeneratedFile(f"{package}/__init__.py", ""),
        GeneratedFile("test"),
        *(GeneratedFile(f"test/{test}", render(f"pkg/ament_python/{test}.j2")) for test in tests),
    ]
    if blueprint.node:
        node = render("pkg/ament_python/node.py.j2", **names)
        items.append(GeneratedFile(f"{package}/{blueprint.node}.py", node))
    if blueprint.library:
        folder = f"{package}/{blueprint.library}"
        items += (GeneratedFile(folder), GeneratedFile(f"{folder}/__init__.py", ""))
    return tuple(items)


def _names(blueprint: NewPackage) -> dict[str, object]:
    """Return the package's names in the spelling of CMake, C++ and Python."""
    word = blueprint.name.replace("-", "_")
    if word[0].isdigit() or word in _CPP_KEYWORDS.split():
        word = f"pkg_{word}"
    parts = (blueprint.library or "").split("_")
    return {
        "name": blueprint.name,
        "version": VERSION,
        "dependencies": blueprint.dependencies,
        "node": blueprint.node,
        "library": blueprint.library,
        "namespace": word,
        "macro": word.upper(),
        "class_name": "".join(part[:1].upper() + part[1:] for part in parts),
    }


def _xml(text: str) -> str:
    return text.translate(_ESCAPES)
