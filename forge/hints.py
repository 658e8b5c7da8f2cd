"""What to do about a failure whose cause is known: one sentence for the person who reads the error; pure.

A hint names the line to add or the command to run. Where more than one cause fits, the first in the table
is the surest. No hint is better than a wrong one.
"""

from __future__ import annotations

import re
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from forge.frozen import frozen
from forge.model import BUILD_KINDS
from forge.names import did_you_mean, snake_case
from forge.provision import INTERFACE_GROUP, is_like_a_ros_name, is_ros_name

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from forge.model import Package

_SURE = 0.8
"""How near a name must be where many are long and alike."""

_BUILD_TOOLS = ("ament_cmake", "rosidl_default_generators", "ament_lint_auto")


@frozen
class Scene:
    """Where something failed: the package and what is in it, what is around it, the interpreter."""

    package: Package
    packages: Mapping[str, Package]
    python: str = "python3"
    files: tuple[str, ...] = ()
    """The package's files, relative to its folder."""
    targets: tuple[str, ...] = ()
    """What its CMakeLists.txt builds."""

    @property
    def manifest(self) -> str:
        """The package's manifest as a person types it."""
        return str(self.package.manifest.path)

    def declares(self, name: str) -> bool:
        """Tell if the manifest says that a package is needed to build."""
        return name in self.package.manifest.names(BUILD_KINDS)

    def depend(self, name: str) -> str:
        """Return the line by which a manifest says that it needs a package."""
        tag = "buildtool_depend" if name.startswith(_BUILD_TOOLS) else "depend"
        return f"<{tag}>{name}</{tag}>"


def hint_of(said: str, scene: Scene) -> str | None:
    """Return what to do, as far as the output `said` of a failed package tells; else None."""
    for pattern, remedy in _REMEDIES:
        match = pattern.search(said)
        hint = remedy(match[1] if pattern.groups else "", scene) if match else None
        if hint:
            return hint
    return None


def _package_not_found(name: str, scene: Scene) -> str | None:
    if name in scene.packages:
        if scene.declares(name):
            return None
        return f"'{name}' is there, but not said to be needed: add {scene.depend(name)} to {scene.manifest}"
    if is_ros_name(name) or (scene.declares(name) and is_like_a_ros_name(name)):
        return f"source a ROS installation that has '{name}', or add its sources to the workspace"
    return (
        f"install the system package that has {name}Config.cmake "
        f"(Debian: apt-file search -x '/({name}Config|{name.lower()}-config).cmake$')"
    )


def _header_not_found(header: str, scene: Scene) -> str | None:
    name = header.split("/", maxsplit=1)[0]
    if "/" in header and name in scene.packages and name != scene.package.name:
        folder, _, file = header.rpartition("/")
        stem, dot, ending = file.partition(".")
        if stem != stem.lower() and INTERFACE_GROUP in scene.packages[name].manifest.groups:
            return f"headers of interfaces are in lower case: '{folder}/{snake_case(stem)}{dot}{ending}'"
        lines = [] if scene.declares(name) else [f"<depend>{name}</depend> in {scene.manifest}"]
        lines += [f"find_package({name} REQUIRED)", f"ament_target_dependencies(YOUR_TARGET {name})"]
        return f"'{header}' belongs to the package '{name}'; needed are {_listed(lines)}"
    if name == scene.package.name or "/" not in header:
        return "if it is the package's own: target_include_directories(YOUR_TARGET PRIVATE include)"
    if is_ros_name(name):
        return f"source a ROS installation that has '{name}', or add its sources to the workspace"
    return f"install the system package that has it (Debian: apt-file search {header})"


def _no_such_target(target: str, scene: Scene) -> str | None:
    near = did_you_mean(target, scene.targets)
    if near or target in scene.targets:
        return near
    return f"no add_executable() or add_library() in CMakeLists.txt makes '{target}'"


def _no_such_file(said: str, scene: Scene) -> str | None:
    """Say what to do about a file that CMakeLists.txt or setup.py names and the package has not."""
    name = " ".join(said.split()).rpartition(f"{scene.package.path.as_posix()}/")[2]
    if name.startswith("/") or name in scene.files:
        return None
    folders = {str(parent) for file in scene.files for parent in PurePosixPath(file).parents}
    near = did_you_mean(name, {*scene.files, *folders}, _SURE)
    return near or f"the package has no '{name}': make it, or take it out of what names it"


def _headers_not_installed(name: str, scene: Scene) -> str | None:
    if name not in scene.packages:
        return None
    line = "install(DIRECTORY include/ DESTINATION include/${PROJECT_NAME})"
    return f"'{name}' does not install its headers: add {line} to its CMakeLists.txt"


def _built_in_source(_: str, scene: Scene) -> str | None:
    if "CMakeCache.txt" not in scene.files:
        return None
    path = scene.package.path
    return f"'cmake .' was run in {path}: rm -r {path}/CMakeCache.txt {path}/CMakeFiles"


def _undefined(symbol: str, scene: Scene) -> str:
    if symbol == "main":
        return "the program has no main(): is the file with it named in its add_executable()?"
    name = symbol.removeprefix("vtable for ").split("::", maxsplit=1)[0]
    if "::" in symbol and name in scene.packages and name != scene.package.name:
        lines = [] if scene.declares(name) else [f"{scene.depend(name)} in {scene.manifest}"]
        lines += [f"find_package({name} REQUIRED)", f"ament_target_dependencies(YOUR_TARGET {name})"]
        return f"'{symbol}' belongs to the package '{name}'; needed are {_listed(lines)}"
    return (
        f"nothing that is linked has '{symbol}': name its source file in add_executable() or add_library(), "
        "or its library in target_link_libraries()"
    )


def _two_mains(_: str, _scene: Scene) -> str:
    return "two of its files have a main(): give each an add_executable() of its own"


def _no_cmakelists(_: str, scene: Scene) -> str:
    if "setup.py" in scene.files:
        return f"it has a setup.py: write <build_type>ament_python</build_type> into {scene.manifest}"
    return "it needs a CMakeLists.txt: 'forge pkg create' makes packages that have all they need"


def _unknown_compiler(variable: str, _scene: Scene) -> str:
    return f"unset {variable}, or let it name a compiler that is installed"


def _not_looked_for(name: str, scene: Scene) -> str | None:
    """Say what to do about a package that ament_target_dependencies() names."""
    if name in scene.packages:
        return f"add find_package({name} REQUIRED) before it in CMakeLists.txt"
    return did_you_mean(name, scene.packages, _SURE)


def _not_permitted(_: str, _scene: Scene) -> str:
    return "was it built with sudo before? give it back: sudo chown -R $(id -un): build install log"


def _target_not_found(target: str, scene: Scene) -> str | None:
    name = target.split("::", maxsplit=1)[0]
    depend = "" if scene.declares(name) else f" and <depend>{name}</depend> to {scene.manifest}"
    return f"add find_package({name} REQUIRED) before its use in CMakeLists.txt{depend}"


def _command_not_found(command: str, _scene: Scene) -> str | None:
    packages = (
        ("rosidl_", "rosidl_default_generators"),
        ("ament_add_gtest", "ament_cmake_gtest"),
        ("ament_add_gmock", "ament_cmake_gmock"),
        ("ament_add_pytest", "ament_cmake_pytest"),
        ("ament_auto_", "ament_cmake_auto"),
        ("ament_python_", "ament_cmake_python"),
        ("ament_", "ament_cmake"),
    )
    name = next((package for beginning, package in packages if command.startswith(beginning)), None)
    return f"add find_package({name} REQUIRED) before it in CMakeLists.txt" if name else None


def _module_not_found(module: str, scene: Scene) -> str | None:
    name = module.split(".", maxsplit=1)[0]
    if name in scene.packages:
        depend = f"add <depend>{name}</depend> to {scene.manifest}"
        return None if scene.declares(name) else f"'{name}' is a package of the workspace: {depend}"
    known = {"em": "'empy<4'", "yaml": "PyYAML", "catkin_pkg": "catkin_pkg", "cv2": "opencv-python"}
    return f"{scene.python} -m pip install {known.get(name, name)}"


def _other_empy(_: str, scene: Scene) -> str:
    return f"this ROS needs the third empy: {scene.python} -m pip install 'empy<4'"


def _out_of_memory(_: str, _scene: Scene) -> str:
    return "memory ran out: build with fewer jobs (--jobs 1), or raise what is kept free (--memory-limit)"


def _disk_full(_: str, _scene: Scene) -> str:
    return "the disk is full: 'forge clean stale' removes what nobody needs, 'df -h .' says how full it is"


def _no_git(url: str, _scene: Scene) -> str:
    return f"the package clones {url} while it is built: it needs the network, or a system package instead"


_REMEDIES: tuple[tuple[re.Pattern[str], Callable[[str, Scene], str | None]], ...] = (
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
    (re.compile(r"Failed to clone repository: '([^']+)'"), _no_git),
    (re.compile(r"module 'em' has no attribute"), _other_empy),
    (
        re.compile(r'(?:for|given)\s+target\s+"([^"]+)"\s+which\s+(?:is\s+not\s+built|does\s+not\s+exist)'),
        _no_such_target,
    ),
    (re.compile(r"was\s+given\s+'([^']+)',\s+which\s+is\s+no\s+target"), _no_such_target),
    (re.compile(r"uses\s+the\s+package\s+'([^']+)',\s+which\s+was\s+not\s+found"), _not_looked_for),
    (re.compile(r"Cannot\s+find\s+source\s+file:\s+(\S.*)"), _no_such_file),
    (re.compile(r'file\s+INSTALL\s+cannot\s+find\s+"([^"]+)"'), _no_such_file),
    (re.compile(r"was\s+given\s+'([^']+)',\s+which\s+does\s+not\s+exist"), _no_such_file),
    (re.compile(r"can't copy '([^']+)': doesn't exist"), _no_such_file),
    (
        re.compile(r'Imported\s+target\s+"([\w-]+)(?:::[^"]*)?"\s+includes\s+non-existent\s+path'),
        _headers_not_installed,
    ),
    (re.compile(r"(?:Does not match the generator used previously|could not load cache)"), _built_in_source),
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
"""What programs say, and what to do about it; the group is what it is about."""


def _listed(lines: list[str]) -> str:
    return f"{', '.join(lines[:-1])} and {lines[-1]}"
