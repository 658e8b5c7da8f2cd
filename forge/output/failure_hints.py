"""Finds remedies for failures with a known cause in the output of a failed program.

A hint names the line to add or the command to run. If several causes match, the first in the table is the
most certain one. A wrong hint is worse than none.
"""

from __future__ import annotations

import os
import re
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from forge.base.files import text_or_nothing
from forge.base.frozen import frozen
from forge.base.names import did_you_mean, nearest, snake_case
from forge.build.inputs.fingerprints import own_files
from forge.output.first_error import COLOUR
from forge.output.known_names import cmake_commands, installed_headers
from forge.output.platform_hints import remedy_for_platform
from forge.toolchain.python_modules import install_command
from forge.workspace.cmake_metadata import cmake_dependencies, targets, used_by_tests_only
from forge.workspace.discovery import discover_embedded
from forge.workspace.model import BUILD_KINDS, RUN_KINDS, TEST_KINDS
from forge.workspace.resolve import INTERFACE_GROUP, is_ros_name, resembles_ros_name, similar_package

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from forge.workspace.model import Package

_SURE = 0.8
"""Required similarity for suggestions among many similar names."""

_BUILD_TOOLS = ("ament_cmake", "rosidl_default_generators", "ament_lint_auto")


@frozen
class FailureContext:
    """The context of a failure: the package with its files and targets, all packages, the interpreter."""

    package: Package
    packages: Mapping[str, Package]
    python: str = "python3"
    files: tuple[str, ...] = ()
    """The package's files, relative to its folder."""
    targets: tuple[str, ...] = ()
    """The targets of its CMakeLists.txt."""
    found: frozenset[str] = frozenset()
    """The packages that its CMakeLists.txt finds."""
    tested: frozenset[str] = frozenset()
    """The packages that only the tests in its CMakeLists.txt find."""
    prefix_of: Callable[[str], Path | None] = lambda _: None
    """Returns the prefix that contains an installed package."""

    @property
    def manifest(self) -> str:
        """The path of the package's manifest, for hints."""
        return str(self.package.manifest.path)

    def declares(self, name: str) -> bool:
        """Tell whether the manifest declares a build dependency."""
        return name in self.package.manifest.names(BUILD_KINDS)

    def is_for_tests(self, name: str) -> bool:
        """Tell whether only tests need a package."""
        manifest = self.package.manifest
        declared = name in manifest.names(TEST_KINDS) and name not in manifest.names(BUILD_KINDS | RUN_KINDS)
        return declared or name in self.tested

    def headers(self, name: str) -> frozenset[str]:
        """Return the headers that a package installed."""
        prefix = self.prefix_of(name)
        return installed_headers(name, prefix) if prefix else frozenset()

    def depend(self, name: str) -> str:
        """Return the line that declares a dependency in a manifest."""
        tag = "buildtool_depend" if name.startswith(_BUILD_TOOLS) else "depend"
        return f"<{tag}>{name}</{tag}>"


def failure_context(
    package: Package,
    packages: Mapping[str, Package],
    python: str,
    prefix_of: Callable[[str], Path | None],
) -> FailureContext:
    """Return the context of a failed package; unreadable files are left out."""
    folder = str(package.path)
    try:
        files = tuple(os.path.relpath(path, folder) for path, _ in own_files(folder))
    except OSError:
        files = ()
    text = text_or_nothing(package.path / "CMakeLists.txt")
    every = {**discover_embedded(), **packages}
    found = cmake_dependencies([text])
    tested = used_by_tests_only(text)
    return FailureContext(package, every, python, files, targets(text), found, tested, prefix_of)


def hint_of(output: str, context: FailureContext) -> str | None:
    """Return a remedy derived from the output of a failed package, or None."""
    plain = COLOUR.sub("", output)
    for pattern, remedy in _REMEDIES:
        match = pattern.search(plain)
        hint = remedy(match[1] if pattern.groups else "", context) if match else None
        if hint:
            return hint
    return remedy_for_platform(plain, context.targets)


def _package_not_found(name: str, context: FailureContext) -> str | None:
    if name in context.packages:
        if context.declares(name):
            return None
        return f"dependency on '{name}' is not declared: add {context.depend(name)} to {context.manifest}"
    remedy = _ways_to_find(name, context)
    if context.is_for_tests(name):
        return f"only tests need '{name}': build without them (--cmake-args -DBUILD_TESTING=OFF), or {remedy}"
    return remedy


def _ways_to_find(name: str, context: FailureContext) -> str:
    """Return where a package may come from that is not in the workspace."""
    near = similar_package(name, context.packages.keys() - {context.package.name})
    question = f"did you mean '{near}'? otherwise " if near else ""
    if is_ros_name(name) or (context.declares(name) and resembles_ros_name(name)):
        remedy = f"source a ROS installation that contains '{name}', or add its sources to the workspace"
        return question + remedy
    return (
        f"{question}install the system package that contains {name}Config.cmake "
        f"(Debian: apt-file search -x '/({name}Config|{name.lower()}-config).cmake$')"
    )


def _header_not_found(header: str, context: FailureContext) -> str | None:
    name, _, rest = header.partition("/")
    if not rest or name == context.package.name:
        return _own_header_not_found(header, context)
    installed = context.headers(name)
    if name in context.packages:
        folder, _, file = header.rpartition("/")
        stem, dot, ending = file.partition(".")
        if stem != stem.lower() and INTERFACE_GROUP in context.packages[name].manifest.groups:
            return f"headers of interfaces are lower case: '{folder}/{snake_case(stem)}{dot}{ending}'"
    if installed and header not in installed:
        near = nearest(rest, (other.partition("/")[2] for other in installed), _SURE)
        return f"did you mean '{name}/{near}'?" if near else f"the package '{name}' has no such header"
    if installed or name in context.packages:
        return f"'{header}' belongs to the package '{name}'; add {_listed(_lines_for(name, context))}"
    if is_ros_name(name):
        return f"source a ROS installation that contains '{name}', or add its sources to the workspace"
    return f"install the system package that contains it (Debian: apt-file search {header})"


def _own_header_not_found(header: str, context: FailureContext) -> str:
    """Return a remedy for a header of the package itself, or one that is included without a folder."""
    depth = header.count("/") + 1
    own = {"/".join(file.split("/")[-depth:]) for file in context.files}
    near = None if header in own else did_you_mean(header, own, _SURE)
    return near or "for a header of this package: target_include_directories(YOUR_TARGET PRIVATE include)"


def _lines_for(name: str, context: FailureContext) -> list[str]:
    """Return the lines that make a target use a package, without those that are there."""
    lines = [] if context.declares(name) else [f"{context.depend(name)} in {context.manifest}"]
    lines += [] if name in context.found else [f"find_package({name} REQUIRED)"]
    return [*lines, f"ament_target_dependencies(YOUR_TARGET {name})"]


def _no_such_target(target: str, context: FailureContext) -> str | None:
    near = did_you_mean(target, context.targets)
    if near or target in context.targets:
        return near
    return f"no add_executable() or add_library() in CMakeLists.txt defines '{target}'"


def _no_such_file(path: str, context: FailureContext) -> str | None:
    """Return a remedy for a missing file that CMakeLists.txt or setup.py names."""
    name = " ".join(path.split()).rpartition(f"{context.package.path.as_posix()}/")[2]
    if name.startswith("/") or name in context.files:
        return None
    folders = {str(parent) for file in context.files for parent in PurePosixPath(file).parents}
    near = did_you_mean(name, {*context.files, *folders}, _SURE)
    return near or f"the package has no '{name}': create it, or remove the reference to it"


def _headers_not_installed(name: str, context: FailureContext) -> str | None:
    if name not in context.packages:
        return None
    line = "install(DIRECTORY include/ DESTINATION include/${PROJECT_NAME})"
    return f"'{name}' does not install its headers: add {line} to its CMakeLists.txt"


def _built_in_source(_: str, context: FailureContext) -> str | None:
    if "CMakeCache.txt" not in context.files:
        return None
    path = context.package.path
    return f"'cmake .' was run in {path}: rm -r {path}/CMakeCache.txt {path}/CMakeFiles"


def _undefined(symbol: str, context: FailureContext) -> str:
    if symbol == "main":
        return "the executable has no main(): add the source file that defines it to add_executable()"
    name = symbol.removeprefix("vtable for ").split("::", maxsplit=1)[0]
    if "::" in symbol and name in context.packages and name != context.package.name:
        return f"'{symbol}' belongs to the package '{name}'; add {_listed(_lines_for(name, context))}"
    return (
        f"no linked object defines '{symbol}': add its source file to add_executable() or add_library(), "
        "or its library in target_link_libraries()"
    )


def _two_mains(_: str, _context: FailureContext) -> str:
    return "two source files define main(): use a separate add_executable() for each"


def _no_cmakelists(_: str, context: FailureContext) -> str:
    if "setup.py" in context.files:
        return f"the package has a setup.py: add <build_type>ament_python</build_type> to {context.manifest}"
    return "the package has no CMakeLists.txt: 'forge pkg create' creates complete packages"


def _unknown_compiler(variable: str, _context: FailureContext) -> str:
    return f"unset {variable}, or set it to an installed compiler"


def _not_looked_for(name: str, context: FailureContext) -> str | None:
    """Return a remedy for a package named in ament_target_dependencies() without find_package()."""
    if name in context.packages:
        return f"add find_package({name} REQUIRED) before it in CMakeLists.txt"
    return did_you_mean(name, context.packages, _SURE)


def _not_permitted(_: str, _context: FailureContext) -> str:
    return "if an earlier build ran with sudo: sudo chown -R $(id -un): build install log"


def _target_not_found(target: str, context: FailureContext) -> str | None:
    name = target.split("::", maxsplit=1)[0]
    depend = "" if context.declares(name) else f" and <depend>{name}</depend> to {context.manifest}"
    return f"add find_package({name} REQUIRED) before its use in CMakeLists.txt{depend}"


def _not_exported(names: str, context: FailureContext) -> str | None:
    """Return a remedy for a package that exports a target but not the package which the target links."""
    exporter, needed = re.findall(r"[\w-]+(?=::)", names)
    if exporter not in context.packages or needed in {exporter, "PkgConfig"}:
        return None
    if context.packages[exporter].build_type == "cmake":
        line, file = f"find_dependency({needed})", f"the CMake config that '{exporter}' installs"
    else:
        line, file = f"ament_export_dependencies({needed})", f"the CMakeLists.txt of '{exporter}'"
    return f"users of '{exporter}' need '{needed}': add {line} to {file}"


def _command_not_found(command: str, context: FailureContext) -> str | None:
    packages = (
        ("rosidl_", "rosidl_default_generators"),
        ("ament_add_gtest", "ament_cmake_gtest"),
        ("ament_add_gmock", "ament_cmake_gmock"),
        ("ament_add_catch2", "ament_cmake_catch2"),
        ("ament_add_pytest", "ament_cmake_pytest"),
        ("ament_auto_", "ament_cmake_auto"),
        ("ament_python_", "ament_cmake_python"),
        ("ament_", "ament_cmake"),
    )
    known = cmake_commands(context.package.path, context.files)
    near = None if command in known else did_you_mean(command, known, _SURE)
    name = next((package for beginning, package in packages if command.startswith(beginning)), None)
    if near or name is None or name in context.found:
        return near
    return f"add find_package({name} REQUIRED) before it in CMakeLists.txt"


def _module_not_found(module: str, context: FailureContext) -> str | None:
    name = module.split(".", maxsplit=1)[0]
    if name in context.packages:
        depend = f"add <depend>{name}</depend> to {context.manifest}"
        return None if context.declares(name) else f"'{name}' is a package of the workspace: {depend}"
    if is_ros_name(name):
        return _ways_to_find(name, context)
    return install_command(Path(context.python), (name,))


def _other_empy(_: str, context: FailureContext) -> str:
    return f"this ROS distribution needs empy 3: {install_command(Path(context.python), ('em',))}"


def _out_of_memory(_: str, _context: FailureContext) -> str:
    return "out of memory: build with fewer jobs (--jobs 1), or keep more memory free (--memory-limit)"


def _disk_full(_: str, _context: FailureContext) -> str:
    return "the disk is full: 'forge clean stale' removes unused results, 'df -h .' shows the free space"


def _no_git(url: str, _context: FailureContext) -> str:
    return f"the package clones {url} during the build: provide network access, or a system package"


def _unknown_argument(word: str, _context: FailureContext) -> str:
    return f"if '{word}' is meant for forge, put it before '--cmake-args', '--pytest-args' and the like"


_REMEDIES: tuple[tuple[re.Pattern[str], Callable[[str, FailureContext], str | None]], ...] = (
    (
        re.compile(r"(?i:Killed signal terminated program|virtual memory exhausted|std::bad_alloc)"),
        _out_of_memory,
    ),
    (re.compile(r"No space left on device"), _disk_full),
    (re.compile(r"package\s+configuration\s+file\s+provided\s+by\s+\"([^\"]+)\""), _package_not_found),
    (re.compile(r"Could NOT find (\w+) \(missing:"), _package_not_found),
    (re.compile(r"Unknown CMake command\s+\"([^\"]+)\""), _command_not_found),
    (
        re.compile(r'links\s+to(?:\s+target|:)\s+"?([\w-]+::[\w-]+)"?\s+but\s+the\s+target\s+was\s+not'),
        _target_not_found,
    ),
    (
        re.compile(
            r'link\s+interface\s+of\s+target\s+("[\w-]+::[\w-]+"\s+contains:\s+[\w-]+::[\w-]+)\s+'
            r"but\s+the\s+target\s+was\s+not\s+found"
        ),
        _not_exported,
    ),
    (re.compile(r"Failed to clone repository: '([^']+)'"), _no_git),
    (re.compile(r"module 'em' has no attribute"), _other_empy),
    (
        re.compile(r'(?:for|given)\s+target\s+"([^"]+)"\s+which\s+(?:is\s+not\s+built|does\s+not\s+exist)'),
        _no_such_target,
    ),
    (re.compile(r"was\s+given\s+'([^']+)',\s+which\s+is\s+not\s+a\s+target"), _no_such_target),
    (re.compile(r"uses\s+the\s+package\s+'([^']+)',\s+which\s+was\s+not\s+found"), _not_looked_for),
    (re.compile(r"Cannot\s+find\s+source\s+file:\s+(\S.*)"), _no_such_file),
    (re.compile(r'file\s+INSTALL\s+cannot\s+find\s+"([^"]+)"'), _no_such_file),
    (re.compile(r"was\s+given\s+'([^']+)',\s+which\s+does\s+not\s+exist"), _no_such_file),
    (re.compile(r"can't copy '([^']+)': doesn't exist"), _no_such_file),
    (re.compile(r'includes\s+non-existent\s+path\s+"[^"]*/(numpy)/'), _module_not_found),
    (
        re.compile(r'Imported\s+target\s+"([\w-]+)(?:::[^"]*)?"\s+includes\s+non-existent\s+path'),
        _headers_not_installed,
    ),
    (re.compile(r"(?:Does not match the generator used previously|could not load cache)"), _built_in_source),
    (
        re.compile(r"(?:CMake Error: Unknown argument|error: unrecognized arguments:) (-\S+)"),
        _unknown_argument,
    ),
    (re.compile(r"does not appear to contain CMakeLists\.txt"), _no_cmakelists),
    (re.compile(r"compiler specified in the environment variable\s+(\w+)"), _unknown_compiler),
    (re.compile(r"multiple definition of [`'\u2018]main['\u2019]"), _two_mains),
    (re.compile(r"(?:ModuleNotFoundError|ImportError): No module named '([^']+)'"), _module_not_found),
    (
        re.compile(r"fatal error: '?([^':]+?)'?(?:: No such file or directory| file not found)"),
        _header_not_found,
    ),
    (re.compile(r"undefined reference to [`'\u2018](.+?)['\u2019]?$", re.MULTILINE), _undefined),
    (
        re.compile(
            r"(?:PermissionError: \[Errno 13\]|(?i:(?:cannot|unable|failed|could not|can't|error)[^\n]*"
            r"(?:open|create|copy|write|set|remove|install|mkdir|unlink)[^\n]*)[Pp]ermission denied)"
        ),
        _not_permitted,
    ),
)
"""Patterns in output and their remedies; the group of a pattern is the name it concerns."""


def _listed(lines: list[str]) -> str:
    *first, last = lines
    return f"{', '.join(first)} and {last}" if first else last
