"""Finds remedies for failures with a known cause in the output of a failed program.

A hint names the line to add or the command to run. If several causes match, the first in the table is the
most certain one. A wrong hint is worse than none.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from forge.base.files import text_or_nothing
from forge.base.layout import PACKAGE
from forge.base.names import did_you_mean, nearest, snake_case
from forge.base.text import quoted_names
from forge.build.inputs.fingerprints import own_files
from forge.build.tasks import KILLED_ALONE, REPEATED_ALONE
from forge.environment.prefixes import SYSTEM
from forge.output.hints import Failure
from forge.plugins.failure_hints.missing import submodule_remedy, unchecked_submodules
from forge.toolchain.programs import ConfigSearch
from forge.toolchain.python_modules import install_command
from forge.workspace import resolve
from forge.workspace.cmake_text import calls, cmake_dependencies, package_references, project_name
from forge.workspace.discovery import discover_embedded
from forge.workspace.model import BUILD_KINDS, RUN_KINDS, TEST_KINDS

_SURE = 0.8
"""Required similarity for suggestions among many similar names."""

_BUILD_TOOLS = ("ament_cmake", "rosidl_default_generators", "ament_lint_auto")

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


@dataclass(frozen=True)
class FailureContext(Failure):
    """A failure and files on disk; `packages` include the embedded ones.

    `files` are relative to the package's folder. Its CMakeLists.txt defines `targets`, finds the packages
    `found` (those in `tested` for tests only, those in `optional` without REQUIRED), and links `linked`.
    """

    files: tuple[str, ...] = ()
    targets: tuple[str, ...] = ()
    found: frozenset[str] = frozenset()
    tested: frozenset[str] = frozenset()
    linked: frozenset[str] = frozenset()
    optional: frozenset[str] = frozenset()

    @property
    def manifest(self) -> str:
        return str(self.package.manifest.path)

    def declares(self, name: str) -> bool:
        return name in self.package.manifest.names(BUILD_KINDS)

    def depend(self, name: str) -> str:
        """Return the line that declares a dependency in a manifest."""
        tag = "buildtool_depend" if name.startswith(_BUILD_TOOLS) else "depend"
        return f"<{tag}>{name}</{tag}>"


def hint(failure: Failure) -> str:
    """Return a remedy derived from the output of a failed package, '' if its cause is unknown."""
    # The files of an embedded package belong to forge.
    return "" if failure.package.embedded else hint_in(failure_context(failure))


def failure_context(failure: Failure) -> FailureContext:
    """Return the context of a failure; unreadable files are left out."""
    folder = str(failure.package.path)
    try:
        files = tuple(os.path.relpath(path, folder) for path, _ in own_files(folder))
    except OSError:
        files = ()
    text = text_or_nothing(failure.package.path / "CMakeLists.txt")
    searches = [call.words for call in calls(text) if call.command == "find_package" and call.words]
    return FailureContext(
        **{**vars(failure), "packages": {**discover_embedded(), **failure.packages}},
        files=files,
        targets=targets(text),
        found=cmake_dependencies([text]),
        tested=used_by_tests_only(text),
        linked=linked_packages(text),
        optional=frozenset(words[0] for words in searches if "REQUIRED" not in words),
    )


def targets(text: str) -> tuple[str, ...]:
    """Return the targets with literal names, in order; ${PROJECT_NAME} is expanded."""
    name = project_name(text) or ""
    definitions = (
        call for call in calls(text) if call.command in {"add_executable", "add_library"} and call.words
    )
    return tuple(call.words[0].replace("${PROJECT_NAME}", name) for call in definitions)


def linked_packages(text: str) -> frozenset[str]:
    """Return the packages that targets link, by name or by a target such as NAME::NAME."""
    linking = {"ament_target_dependencies", "target_link_libraries"}
    words = (word for call in calls(text) if call.command in linking for word in call.words[1:])
    return frozenset(word.partition("::")[0] for word in words)


def used_by_tests_only(text: str) -> frozenset[str]:
    """Return the packages that are referenced only below if(BUILD_TESTING)."""
    references = tuple(package_references(text))
    others = {each.name for each in references if not each.testing}
    return frozenset(each.name for each in references if each.testing) - others


def hint_in(context: FailureContext) -> str:
    """Return a remedy derived from the output of a failed package, '' if its cause is unknown."""
    _, _, output = context.output.rpartition(REPEATED_ALONE)
    for pattern, remedy in _REMEDIES:
        for match in re.finditer(pattern.replace(" ", r"\s+"), output):
            name = match[1] if match.lastindex else ""
            found = remedy.replace("{}", name) if isinstance(remedy, str) else remedy(name, context)
            if found:
                return found
    return ""


def _package_not_found(name: str, context: FailureContext) -> str | None:
    if name in context.packages:
        if context.declares(name):
            return None
        return f"dependency on '{name}' is not declared: add {context.depend(name)} to {context.manifest}"
    remedy = _ways_to_find(name, context)
    manifest = context.package.manifest
    declared = name in manifest.names(TEST_KINDS) and name not in manifest.names(BUILD_KINDS | RUN_KINDS)
    if declared or name in context.tested:
        return f"only tests need '{name}': build without them (--cmake-args -DBUILD_TESTING=OFF), or {remedy}"
    return remedy


def _ways_to_find(name: str, context: FailureContext) -> str:
    """Return the possible source of a package that is not in the workspace."""
    if place := context.whereabouts(name):
        return place
    near = resolve.similar_package(name, context.packages.keys() - {context.package.name})
    question = f"did you mean '{near}'? otherwise " if near else ""
    if resolve.is_ros_name(name) or (context.declares(name) and resolve.resembles_ros_name(name)):
        other = f"source a ROS installation that contains '{name}'"
        return question + other if near else _ways_to_get(name, context)
    return (
        f"{question}install the system package that contains {name}Config.cmake "
        f"(Debian: apt-file search -x '/({name}Config|{name.lower()}-config).cmake$')"
    )


def _ways_to_get(name: str, context: FailureContext) -> str:
    """Return how to obtain a ROS package."""
    declared = context.declares(name)
    words = "'forge fetch' downloads it" if declared else f"'forge add {name}' and 'forge fetch' download it"
    return f"{words}; or source a ROS installation that contains '{name}'"


def _header_not_found(header: str, context: FailureContext) -> str | None:
    name, _, rest = header.partition("/")
    if not rest or name == context.package.name:
        return _own_header_not_found(header, context)
    prefix = context.prefix_of(name)
    # Spell headers as sources include them: 'shapes/circle.hpp'. Some packages install below a folder with
    # their name, so that overlays do not mix their headers.
    installed: set[str] = set()
    for root in (prefix / "include", prefix / "include" / name) if prefix else ():
        for place, _, names in os.walk(root / name):
            below = os.path.relpath(place, root)
            installed.update(f"{below}/{file}" for file in names if file.endswith(_HEADERS))
    if name in context.packages:
        folder, _, file = header.rpartition("/")
        stem, dot, ending = file.partition(".")
        if stem != stem.lower() and resolve.INTERFACE_GROUP in context.packages[name].manifest.groups:
            return f"headers of interfaces are lower case: '{folder}/{snake_case(stem)}{dot}{ending}'"
    if installed and header not in installed:
        near = nearest(rest, (other.partition("/")[2] for other in installed), _SURE)
        return f"did you mean '{name}/{near}'?" if near else f"the package '{name}' has no such header"
    if installed or name in context.packages:
        lines = _lines_for(name, context)
        return f"'{header}' belongs to the package '{name}'; add {lines}" if lines else None
    return context.whereabouts(name) or (
        _ways_to_get(name, context)
        if resolve.is_ros_name(name)
        else f"install the system package that contains it (Debian: apt-file search {header})"
    )


def _own_header_not_found(header: str, context: FailureContext) -> str:
    """Return a remedy for a header of the package itself, or one that is included without a folder."""
    depth = header.count("/") + 1
    own = {"/".join(file.split("/")[-depth:]): file for file in context.files}
    if header not in own and (near := did_you_mean(header, own, _SURE)):
        return near
    if header in own or header.startswith(f"{context.package.name}/"):
        # A header that does not exist yet is probably generated.
        folder = own.get(header, f"include/{header}").removesuffix(header).rstrip("/") or "."
        return f"for a header of this package: target_include_directories(YOUR_TARGET PRIVATE {folder})"
    return (
        f"no file of the package is named '{header}': if it belongs to a library, install the system package "
        f"that contains it (Debian: apt-file search /{header})"
    )


def _lines_for(name: str, context: FailureContext) -> str:
    """Return the lines that make a target use a package, without those that it already has."""
    lines = [] if context.declares(name) else [f"{context.depend(name)} in {context.manifest}"]
    lines += [] if name in context.found else [f"find_package({name} REQUIRED)"]
    lines += [] if name in context.linked else [f"ament_target_dependencies(YOUR_TARGET {name})"]
    return " and ".join(filter(None, (", ".join(lines[:-1]), *lines[-1:])))


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
    if name and (context.package.path / name).is_dir():
        example = f"'{name}/file'" if "*" in name else f"glob('{name}/*')"
        return f"'{name}' is a folder, where files are expected: name its files, as with {example}"
    folders = {str(parent) for file in context.files for parent in PurePosixPath(file).parents}
    near = did_you_mean(name, {*context.files, *folders}, _SURE)
    moved = [file for file in context.files if PurePosixPath(file).name == PurePosixPath(name).name]
    if not near and len(moved) == 1:
        return f"did you mean '{moved[0]}'?"
    return near or f"the package has no '{name}': create it, or remove the reference to it"


def _no_such_folder(path: str, context: FailureContext) -> str | None:
    """Return a remedy for a missing folder with sources, which may be a submodule."""
    folder = context.package.path / path
    above = context.package.path.absolute()
    for root in (above, *above.parents):
        for empty in unchecked_submodules(root) if (root / ".gitmodules").is_file() else ():
            if folder.absolute().is_relative_to(root / empty):
                shown = os.path.relpath(root / empty)
                return submodule_remedy([Path(shown)])
    return _no_such_file(path, context)


def _headers_not_installed(name: str, context: FailureContext) -> str | None:
    if name not in context.packages or context.packages[name].embedded:
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
        if lines := _lines_for(name, context):
            return f"'{symbol}' belongs to the package '{name}'; add {lines}"
        return f"'{name}' exports no library that defines '{symbol}'"
    return (
        f"no linked object defines '{symbol}': add its source file to add_executable() or add_library(), "
        "or its library in target_link_libraries()"
    )


def _no_cmakelists(_: str, context: FailureContext) -> str:
    if "setup.py" in context.files:
        return f"the package has a setup.py: add <build_type>ament_python</build_type> to {context.manifest}"
    return "the package has no CMakeLists.txt: 'forge pkg create' creates complete packages"


def _not_looked_for(name: str, context: FailureContext) -> str | None:
    """Return a remedy for a package named in ament_target_dependencies() without find_package()."""
    if name in context.found:
        return f"find_package({name}) must come before it, and outside of a branch that is not taken"
    if name in context.packages:
        return f"add find_package({name} REQUIRED) before it in CMakeLists.txt"
    return did_you_mean(name, context.packages, _SURE)


def _target_not_found(target: str, context: FailureContext) -> str | None:
    name = target.split("::", maxsplit=1)[0]
    if name in context.found or name == context.package.name:
        prefix = context.prefix_of(name)
        folders = (
            [prefix / folder for folder in (f"share/{name}", f"lib/cmake/{name}", "cmake")] if prefix else []
        )
        files = (path for folder in folders for path in sorted(folder.rglob("*.cmake")))
        exported = (
            call.words[0]
            for path in files
            for call in calls(text_or_nothing(path))
            if call.command in {"add_executable", "add_library"}
            and not {"IMPORTED", "ALIAS"}.isdisjoint(call.words)
        )
        exported_targets = tuple(dict.fromkeys(each for each in exported if "$" not in each))
        if not exported_targets:
            return f"'{name}' has no target '{target}'; try ament_target_dependencies(YOUR_TARGET {name})"
        near = nearest(target, exported_targets, _SURE)
        question = f"; did you mean '{near}'?" if near else ""
        return f"'{name}' has no target '{target}'; it exports {quoted_names(exported_targets)}{question}"
    depend = "" if context.declares(name) else f" and <depend>{name}</depend> to {context.manifest}"
    return f"add find_package({name} REQUIRED) before its use in CMakeLists.txt{depend}"


def _not_exported(names: str, context: FailureContext) -> str | None:
    """Return a remedy for a package that exports a target but not the package which the target links."""
    exporter, needed = re.findall(r"[\w-]+(?=::)", names)
    if (
        exporter not in context.packages
        or context.packages[exporter].embedded
        or needed in {exporter, "PkgConfig"}
    ):
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
    files = (file for file in context.files if file.endswith((".cmake", "CMakeLists.txt")))
    paths = (*map(context.package.path.joinpath, files), *(PACKAGE / "embedded").rglob("*.cmake"))
    definitions = (call for path in paths for call in calls(text_or_nothing(path)))
    names = (call.words[0] for call in definitions if call.command in {"function", "macro"} and call.words)
    commands = frozenset((*_CMAKE_COMMANDS, *names))
    near = None if command in commands else did_you_mean(command, commands, _SURE)
    name = next((package for beginning, package in packages if command.startswith(beginning)), None)
    if near or name is None or name in context.found:
        return near
    return f"add find_package({name} REQUIRED) before it in CMakeLists.txt"


def _module_not_found(module: str, context: FailureContext) -> str | None:
    name = module.split(".", maxsplit=1)[0]
    if name in context.packages:
        depend = f"add <depend>{name}</depend> to {context.manifest}"
        return None if context.declares(name) else f"'{name}' is a package of the workspace: {depend}"
    if resolve.is_ros_name(name):
        return _ways_to_find(name, context)
    return install_command(Path(context.python), (name,))


def _other_empy(_: str, context: FailureContext) -> str:
    return f"this ROS distribution needs empy 3: {install_command(Path(context.python), ('em',))}"


def _no_download(url: str, context: FailureContext) -> str:
    """Return a hint about network access; a system package helps only if CMakeLists.txt looks for it."""
    system = ConfigSearch()
    looked_for = sorted(
        name
        for name in context.optional
        if name not in context.packages and not any(system.folder(str(prefix), name) for prefix in SYSTEM)
    )
    instead = (
        f", or install the system package that contains {quoted_names(looked_for)}" if looked_for else ""
    )
    return f"the package downloads {url.rstrip('/')} during the build: provide network access{instead}"


def _unknown_argument(word: str, context: FailureContext) -> str | None:
    """Return where an option of the command belongs; its value may be attached, as in `-j4`."""
    flag = word.partition("=")[0] if word.startswith("--") else word[:2]
    if flag not in context.flags:
        return None
    return f"if '{word}' is meant for forge, put it before '--cmake-args', '--pytest-args' and the like"


def _foreign_target(program: str, context: FailureContext) -> str | None:
    """Return a remedy for a target run by a command: without an emulator, CMake does not replace its name."""
    if program not in context.targets:
        return None
    return "the build runs a program that it has compiled for another platform: install qemu-user"


def _foreign_library(library: str, _: FailureContext) -> str:
    return (
        f"'{PurePosixPath(library).name}' was built for another platform: source only workspaces of this "
        "build's platform, or pass theirs as '--target'"
    )


_REMEDIES: tuple[tuple[str, str | Callable[[str, FailureContext], str | None]], ...] = (
    (
        KILLED_ALONE,
        "one file needs more memory than this machine has, or than its container or 'ulimit -v' allows: add "
        "memory or swap, or split the file, or compile it without '-g' or with '-O1'",
    ),
    (
        r"(?i:Killed signal terminated program|virtual memory exhausted|std::bad_alloc)",
        "out of memory: build with fewer jobs (--jobs 1), or keep more memory free (--memory-limit)",
    ),
    (
        r"No space left on device",
        "the disk is full: 'forge clean stale' removes unused results, 'df -h .' shows the free space",
    ),
    (r'package configuration file provided by "([^"]+)"', _package_not_found),
    (r"Could NOT find (\w+) \(missing:", _package_not_found),
    (r'Unknown CMake command "([^"]+)"', _command_not_found),
    (r'links to(?: target|:) "?([\w-]+::[\w-]+)"? but the target was not', _target_not_found),
    (
        r'link interface of target ("[\w-]+::[\w-]+" contains: [\w-]+::[\w-]+) but the target was not found',
        _not_exported,
    ),
    (r"Failed to clone repository: '([^']+)'", _no_download),
    (r"downloading '(\w+://[^']+)' failed", _no_download),
    (r"unable to access '(\w+://[^']+)'", _no_download),
    (r"file DOWNLOAD[^\n]*\n?[^\n]*?(https?://[^\s\"']+)", _no_download),
    (r'add_subdirectory given source "([^"]+)" which is not', _no_such_folder),
    (r"The source directory (\S+) does not contain a CMakeLists", _no_such_folder),
    (r'install FILES given directory "([^"]+)"', _no_such_file),
    (r"module 'em' has no attribute", _other_empy),
    (r'(?:for|given) target "([^"]+)" which (?:is not built|does not exist)', _no_such_target),
    (r"was given '([^']+)', which is not a target", _no_such_target),
    (r"uses the package '([^']+)', which was not found", _not_looked_for),
    (r"Cannot find source file: (\S.*)", _no_such_file),
    (r'file INSTALL cannot find "([^"]+)"', _no_such_file),
    (r"was given '([^']+)', which does not exist", _no_such_file),
    (r"can't copy '([^']+)': doesn't exist", _no_such_file),
    (r'includes non-existent path "[^"]*/(numpy)/', _module_not_found),
    (r'Imported target "([\w-]+)(?:::[^"]*)?" includes non-existent path', _headers_not_installed),
    (r"(?:Does not match the generator used previously|could not load cache)", _built_in_source),
    (r"(?:CMake Error: Unknown argument|error: unrecognized arguments:) (-\S+)", _unknown_argument),
    (r"does not appear to contain CMakeLists\.txt", _no_cmakelists),
    (
        r"compiler specified in the environment variable (\w+)",
        "unset {}, or set it to an installed compiler",
    ),
    (
        r"multiple definition of [`'\u2018]main['\u2019]",
        "two source files define main(): use a separate add_executable() for each",
    ),
    (r"(?:ModuleNotFoundError|ImportError): No module named '([^']+)'", _module_not_found),
    (r"fatal error: '?([^':]+?)'?(?:: No such file or directory| file not found)", _header_not_found),
    (r"(?m:undefined reference to [`'\u2018](.+?)['\u2019]?$)", _undefined),
    (
        r"(?:PermissionError: \[Errno 13\]|(?i:(?:cannot|unable|failed|could not|can't|error)[^\n]*"
        r"(?:open|create|copy|write|set|remove|install|mkdir|unlink)[^\n]*)[Pp]ermission denied)",
        "if an earlier build ran with sudo: sudo chown -R $(id -un): build install log",
    ),
    (
        r"qemu-\w+: Could not open '/lib[\w/.-]*/(ld-[\w.-]+)'",
        "'{}', a part of the target's C library, is missing: install it, on Debian for example with "
        "`apt install libc6-arm64-cross`, or pass a '--sysroot'",
    ),
    (r"(?m:^(?:/bin/)?sh: (?:\d+: |line \d+: )?(\S+): (?:command )?not found$)", _foreign_target),
    (
        r"Exec format error|cannot execute binary file",
        "the build runs a program for another platform: install qemu-user, and pass the target itself to "
        "add_custom_command(COMMAND ...), so that CMake starts it with qemu",
    ),
    (r"\bld: (.+): error adding symbols: file in wrong format", _foreign_library),
    (r"\bld\.lld: error: (.+) is incompatible with ", _foreign_library),
    (
        r'unable to provide libc for target "\S*-gnu\w*\.([\d.]+)"',
        "zig has no glibc {}: pass a newer version in '--target', such as 2.31",
    ),
)
"""Patterns in output and their remedies: texts, or functions of the name in the group of the pattern.

A space in a pattern also matches line breaks, because CMake wraps its messages.
"""
