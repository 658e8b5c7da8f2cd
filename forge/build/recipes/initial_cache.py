"""CMake's initial cache (-C): the workspace's Python, forge's own argv, and the manifest as variables."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from forge import __version__
from forge.base.cmake_syntax import quoted
from forge.base.extensions import TARGETS, is_installed
from forge.base.names import is_safe_name
from forge.base.templating import render
from forge.toolchain.compiler_launchers import launcher_variables
from forge.workspace.model import DependencyKind, Export, Manifest

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from forge.base.frozen import Pairs
    from forge.build.recipes.context import BuildContext

_LISTS = {
    "BUILD_DEPENDS": DependencyKind.BUILD,
    "BUILDTOOL_DEPENDS": DependencyKind.BUILDTOOL,
    "BUILD_EXPORT_DEPENDS": DependencyKind.BUILD_EXPORT,
    "BUILDTOOL_EXPORT_DEPENDS": DependencyKind.BUILDTOOL_EXPORT,
    "EXEC_DEPENDS": DependencyKind.EXEC,
    "TEST_DEPENDS": DependencyKind.TEST,
}
_PYTHON_VERSION = re.compile(r"python(\d+\.\d+)")


def initial_cache(context: BuildContext, manifest: Path, further: Pairs = ()) -> str:
    """Return the cache entries for CMake's -C option; `manifest` is the file with manifest_variables().

    All packages may use them. `further` are variables of some packages; as -D arguments, CMake would warn of
    those that a package does not use. The text depends only on these, so it changes exactly when a package
    must be configured again.
    """
    python = quoted(str(context.python))
    match = _PYTHON_VERSION.search(context.site_packages)
    version = match[1] if match else ""
    targets = ("python", "cpp", *(("c",) if is_installed(TARGETS, "c") else ()), "idl", "json")
    launchers = launcher_variables(context.launcher)
    entries = (
        ("Python3_EXECUTABLE", python, "FILEPATH", "The workspace's Python interpreter"),
        ("PYTHON_EXECUTABLE", python, "FILEPATH", "The same, for older packages"),
        ("PYTHON_INSTALL_DIR", quoted(context.site_packages), "STRING", "Where Python modules are installed"),
        ("FORGE_PYTHON_VERSION", quoted(version), "STRING", "The version of that Python"),
        ("FORGE_COMMAND", quoted(*context.generator), "STRING", "The command that runs forge"),
        ("FORGE_VERSION", quoted(__version__), "STRING", "A new version regenerates interfaces"),
        ("FORGE_MANIFEST", quoted(str(manifest)), "FILEPATH", "This package's package.xml as variables"),
        ("FORGE_INTERFACE_TARGETS", quoted(*targets), "STRING", "The languages of generated interfaces"),
        *((name, quoted(value), "STRING", "Set by forge") for name, value in further),
        *((name, quoted(value), "STRING", "The compiler launcher") for name, value in launchers if value),
    )
    return render(
        "cmake/initial_cache.cmake.j2",
        entries=[(name, value, type_, quoted(doc)) for name, value, type_, doc in entries],
        gone=[name for name, value in launchers if not value],
    )


def manifest_variables(manifest: Manifest) -> str:
    """Return the CMake variables that ament_package_xml() publishes for the manifest.

    The first line sets the package name, with which the embedded ament checks that the file is its own.
    """
    variables = [("_AMENT_PACKAGE_NAME", quoted(manifest.name))]
    for name, elements in _values(manifest):
        # Set an empty list to an empty string, so that no older value remains visible.
        variables.append((f"{manifest.name}_{name}", " ".join(map(quoted, elements)) or '""'))
    return render("cmake/manifest.cmake.j2", package=manifest.name, variables=variables)


def _values(manifest: Manifest) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield each variable's name, without the package prefix, and its elements."""
    people = (f"{p.name} <{p.email}>" if p.email else p.name for p in manifest.maintainers)
    yield "VERSION", (manifest.version,)
    yield "MAINTAINER", (", ".join(people),)
    deprecations = (export.content or "TRUE" for export in manifest.exports if export.tag == "deprecated")
    yield "DEPRECATED", (next(deprecations, ""),)
    for name, kind in _LISTS.items():
        yield name, manifest.names(frozenset({kind}))
    yield "GROUP_DEPENDS", manifest.group_dependencies
    yield "MEMBER_OF_GROUPS", manifest.groups
    yield "EXPORT_TAGS", tuple(_xml(export).replace("${prefix}/", "") for export in manifest.exports)
    for name, kind in _LISTS.items():
        for dependency in manifest.dependencies:
            if kind in dependency.kinds and is_safe_name(dependency.name):
                for comparison, version in dependency.versions:
                    yield f"{name}_{dependency.name}_VERSION_{comparison.upper()}", (version,)


def _xml(export: Export) -> str:
    escapes = str.maketrans({"&": "&amp;", "<": "&lt;", '"': "&quot;"})
    attributes = "".join(f' {name}="{value.translate(escapes)}"' for name, value in export.attributes)
    if not export.content:
        return f"<{export.tag}{attributes}/>"
    return f"<{export.tag}{attributes}>{export.content}</{export.tag}>"
