"""Checks the packages of a workspace: undeclared and unused dependencies, and names that hide others."""

from __future__ import annotations

import ast
import re
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path, PurePath

from forge.base.errors import GroupedProblems, Location, Problem, Severity
from forge.base.extensions import OPTIONS, own_plugin
from forge.base.frozen import frozen
from forge.base.graph import closure
from forge.environment.prefixes import installed_packages
from forge.plugins.doctor.model import CheckContext, CheckResult
from forge.workspace.cmake_text import calls, package_references
from forge.workspace.discovery import discover_embedded
from forge.workspace.model import TEST_KINDS, DependencyKind, Package
from forge.workspace.resolve import ALL_KINDS, INTERFACE_GROUP, is_ros_name, provided_names

Finding = tuple[Severity, Problem]

_CODE = (".c", ".cc", ".cpp", ".cu", ".cxx", ".h", ".hh", ".hpp", ".ipp", ".tpp", ".py", ".pyi", ".sh")
_BUILDING = (".txt", ".cmake", ".in", ".cfg", ".toml")
_DATA = (".xml", ".launch", ".yaml", ".yml", ".json", ".urdf", ".xacro", ".sdf", ".rviz", ".md", ".rst")
_SEARCHED = (*_CODE, *_BUILDING, *_DATA, ".msg", ".srv", ".action", ".idl")
"""Files in which a dependency may be mentioned."""

_IMPORT = re.compile(r"^[ \t]*(?:from[ \t]+(\w+)|import[ \t]+([^#\n]+))", re.MULTILINE)
_TEST_FOLDERS = frozenset({"test", "tests"})
_TEST_PARTS = _TEST_FOLDERS | {"testing"}
_SILENT_BEGINNINGS = ("ament_", "rosidl_", "rmw_")
_SILENT = frozenset({"ros2launch", "launch", "launch_ros", "action_msgs"})
"""Dependencies that need no reference in files of the package."""


def declarations(subject: CheckContext) -> CheckResult:
    """Compare used packages with declared dependencies."""
    assert subject.resolution is not None
    resolution = subject.resolution
    near = frozenset(name for name, package in resolution.packages.items() if not package.embedded)
    installed = {
        package.name: package.needs
        for root in subject.underlays.chain
        for package in installed_packages(root)
    }
    available = frozenset(resolution.packages) | frozenset(installed) | provided_names(discover_embedded())
    modules = {name: name for name in available}
    for name in near:
        modules.update(dict.fromkeys(modules_of(subject, resolution.packages[name]), name))
    needs = {**installed, **resolution.needs}
    for name in near:
        outside = frozenset(resolution.packages[name].manifest.names(ALL_KINDS)) & installed.keys()
        needs[name] |= outside
    known_packages = KnownPackages(available, near, modules, needs)
    findings: list[Finding] = []
    notes: list[Problem] = []
    for package in subject.packages.values():
        if not package.ros:
            continue  # whose dependencies are derived from these files
        text = subject.text(package, "CMakeLists.txt")
        if package.build_type in {"ament_cmake", "cmake"} and text:
            findings += undeclared_in_cmake(package, text, package.path / "CMakeLists.txt", known_packages)
        if package.build_type == "ament_python":
            files = ((package.path / name, text) for name, text in subject.texts(package, ".py"))
            findings += undeclared_in_python(package, files, known_packages)
        notes += _unused(subject, package, known_packages.known)
    errors, warnings, implied = (
        tuple(problem for each, problem in findings if each == severity)
        for severity in ("error", "warning", "note")
    )
    undeclared_count = len(errors) + len(warnings)
    parts = (
        f"{undeclared_count} used but not declared" if undeclared_count else "",
        f"{len(implied)} used that only other dependencies declare (--all)" if implied else "",
    )
    summary = ", ".join(filter(None, parts)) or "packages declare what they use"
    return CheckResult("declared", summary, errors, warnings, (*implied, *notes))


def shadows(subject: CheckContext) -> CheckResult:
    """Find packages and Python modules that hide others with the same name."""
    warnings = [*_clashing_modules(subject)]
    if advice := own_plugin(OPTIONS, "advice-surroundings"):
        overridden = advice.overridden(subject.packages, subject.layout.install, subject.variables)
        warnings = [*overridden, *warnings]
    notes = _hidden_packages(subject)
    summary = f"{len(warnings)} hide others" if warnings else "no package hides another"
    return CheckResult("shadows", summary, warnings=tuple(warnings), notes=tuple(notes))


def modules_of(subject: CheckContext, package: Package) -> frozenset[str]:
    """Return the top-level Python modules that a package installs."""
    modules = {package.name} if INTERFACE_GROUP in package.manifest.groups else set()
    if package.build_type in {"ament_python", "python"}:
        for name, _ in subject.files.get(package.name, ()):
            parts = PurePath(name).parts
            parts = parts[1:] if parts[0] == "src" else parts
            if len(parts) == 2 and parts[1] == "__init__.py" and parts[0] not in _TEST_FOLDERS:
                modules.add(parts[0])
    elif package.build_type == "ament_cmake":
        for call in calls(subject.text(package, "CMakeLists.txt")):
            if call.command == "ament_python_install_package" and call.words:
                modules.add(call.words[0].replace("${PROJECT_NAME}", package.name))
    return frozenset(modules)


def _clashing_modules(subject: CheckContext) -> Iterator[Problem]:
    owners: dict[str, list[Package]] = defaultdict(list)
    for package in subject.packages.values():
        for module in modules_of(subject, package):
            owners[module].append(package)
    for module, packages in sorted(owners.items()):
        first, *others = sorted(packages, key=lambda package: package.name)
        if others:
            names = " and ".join(f"'{package.name}'" for package in (first, *others))
            hint = "rename all but one of them: imports use the one that was sourced last"
            yield Problem(f"the Python module '{module}' is in {names}", Location(others[0].path), hint)
        if module in sys.stdlib_module_names:
            hint = "rename its folder, and update setup.py"
            yield Problem(
                f"the module '{module}' of '{first.name}' hides a module of Python's standard library",
                Location(first.path),
                hint,
            )


def _hidden_packages(subject: CheckContext) -> Iterator[Problem]:
    places: dict[str, list[str]] = defaultdict(list)
    for root in reversed(subject.underlays.chain):
        for package in installed_packages(root):
            places[package.name].append(str(root))
    for name, roots in sorted(places.items()):
        if name in subject.packages:
            kind = GroupedProblems(f"{{}} of the workspace override those in '{roots[0]}'", name)
            yield Problem(f"'{name}' of the workspace overrides the one in '{roots[0]}'", group=kind)
        elif len(roots) > 1:
            kind = GroupedProblems(f"{{}} in '{roots[0]}' override those in '{roots[1]}'", name)
            yield Problem(f"'{name}' in '{roots[0]}' overrides the one in '{roots[1]}'", group=kind)


@frozen
class KnownPackages:
    """The available packages: known names, owners of modules, and dependencies.

    `near` are the packages of the workspace, which must be built before their dependents.
    """

    known: frozenset[str]
    near: frozenset[str]
    modules: Mapping[str, str]
    needs: Mapping[str, frozenset[str]]

    def knows(self, name: str) -> bool:
        """Return whether a name is an available package or certainly a ROS package."""
        return name in self.known or is_ros_name(name)

    def owner(self, module: str) -> str | None:
        """Return the package that provides a Python module."""
        return self.modules.get(module) or (module if is_ros_name(module) else None)


def undeclared_in_cmake(
    package: Package, text: str, path: Path, known_packages: KnownPackages
) -> Iterator[Finding]:
    """Yield packages that a CMakeLists.txt uses without declaring them, each once.

    It is an error if CMake certainly fails: a required package of the workspace that no declared dependency
    provides transitively.
    """
    reported = _declared(package)
    transitive_needs = closure(known_packages.needs, known_packages.needs.get(package.name, frozenset()))
    for use in package_references(text):
        if use.name in reported or not known_packages.knows(use.name):
            continue
        reported.add(use.name)
        is_error = use.required and use.name in known_packages.near
        severity: Severity = "note" if use.name in transitive_needs else "error" if is_error else "warning"
        tag = "test_depend" if use.testing else "depend"
        yield severity, _undeclared(package, use.name, Location(path, use.line), tag)


def undeclared_in_python(
    package: Package, texts: Iterable[tuple[Path, str]], known_packages: KnownPackages
) -> Iterator[Finding]:
    """Yield packages that Python files import without declaring them, each once."""
    reported = _declared(package)
    transitive_needs = closure(known_packages.needs, known_packages.needs.get(package.name, frozenset()))
    for path, text in texts:
        # Parse only files with candidate lines, because parsing is slow.
        if reported.issuperset(filter(None, map(known_packages.owner, mentioned_modules(text)))):
            continue
        with suppress(SyntaxError, ValueError, RecursionError):
            for module, line in imported_modules(text):
                name = known_packages.owner(module)
                if name is None or name in reported:
                    continue
                reported.add(name)
                tag = "exec_depend" if _TEST_PARTS.isdisjoint(path.parts) else "test_depend"
                # Launch files rarely declare dependencies and run in a complete system.
                is_mild = name in transitive_needs or path.name.endswith((".launch.py", "_launch.py"))
                problem = _undeclared(package, name, Location(path, line), tag)
                yield "note" if is_mild else "warning", problem


def _unused(subject: CheckContext, package: Package, known_names: frozenset[str]) -> Iterator[Problem]:
    """Yield declared build and run dependencies that no other file of the package mentions."""
    wanted = {
        dependency.name
        for dependency in package.manifest.dependencies
        if dependency.name in known_names
        and dependency.kinds & {DependencyKind.BUILD, DependencyKind.EXEC}
        and not dependency.name.startswith(_SILENT_BEGINNINGS)
        and dependency.name not in _SILENT
    }
    pattern = re.compile(rf"(?<![\w-])(?:{'|'.join(map(re.escape, sorted(wanted)))})(?![\w-])")
    for name, text in subject.texts(package, *_SEARCHED) if wanted else ():
        if name != "package.xml":
            wanted.difference_update(pattern.findall(text))
        if not wanted:
            return
    for name in sorted(wanted):
        message = f"'{package.name}' declares '{name}', but none of its files mentions it"
        many = f"{{}} declare '{name}', but none of their files mentions it"
        every = "remove the line from each package.xml that does not need it"
        group = GroupedProblems(many, package.name, every)
        yield Problem(message, Location(package.manifest.path), "remove the line if it is not needed", group)


def _declared(package: Package) -> set[str]:
    return {package.name, *package.manifest.names(ALL_KINDS | TEST_KINDS | {DependencyKind.DOC})}


def _undeclared(package: Package, name: str, place: Location, tag: str) -> Problem:
    line = f"<{tag}>{name}</{tag}>"
    return Problem(
        f"'{package.name}' uses '{name}' without declaring it in its manifest",
        place,
        f"add {line} to {package.manifest.path}",
        GroupedProblems(
            f"{{}} use '{name}' without declaring it in their manifests",
            package.name,
            f"add {line} to each package.xml",
        ),
    )


def mentioned_modules(text: str) -> frozenset[str]:
    """Return the top-level modules in lines that look like imports: a superset of the imported ones."""
    lists = (match[1] or match[2] for match in _IMPORT.finditer(text))
    return frozenset(
        re.split(r"[.\s]", name.strip(), maxsplit=1)[0] for names in lists for name in names.split(",")
    )


def imported_modules(text: str) -> Iterator[tuple[str, int]]:
    """Yield the top-level modules that a file imports unconditionally, with line numbers.

    Imports in `try` or below TYPE_CHECKING are left out. Raises SyntaxError like Python.
    """
    try:
        yield from list(_imported(ast.parse(text)))
    except (MemoryError, RecursionError, ValueError):
        raise SyntaxError("too deeply nested, or contains a NUL character") from None


def _imported(node: ast.AST) -> Iterator[tuple[str, int]]:
    for child in ast.iter_child_nodes(node):
        match child:
            case ast.Import(names=names):
                yield from ((name.name.partition(".")[0], child.lineno) for name in names)
            case ast.ImportFrom(module=str(module), level=0):
                yield module.partition(".")[0], child.lineno
            case ast.Try() | ast.expr():
                pass  # the former may fail, the latter contains no statements
            case ast.If(test=test) if "TYPE_CHECKING" in ast.dump(test):
                pass
            case _:
                yield from _imported(child)
