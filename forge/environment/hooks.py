"""Derives the environment hooks of a package from its installed files."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator


def package_hooks(name: str, files: Iterable[str], site_packages: str, *, ament: bool) -> dict[str, str]:
    """Return the dsv line of each hook, by name and in colcon's order.

    `files` are relative to the prefix; `site_packages` is the interpreter's folder below it. `ament` adds the
    prefix to AMENT_PREFIX_PATH, for packages that do not do so themselves.
    """
    folders: dict[str, list[str]] = {}
    for file in sorted(files):
        folder, _, base = file.rpartition("/")
        folders.setdefault(folder, []).append(base)
    hooks = {
        **_numbered("cmake_module_path", "CMAKE_MODULE_PATH", _find_modules(name, folders)),
        **_numbered("cmake_prefix_path", "CMAKE_PREFIX_PATH", [""] if _has_config(folders) else []),
        **{f"ld_library_path_{folder}": _line("LD_LIBRARY_PATH", folder) for folder in _libraries(folders)},
        **_numbered("path", "PATH", ["bin"] if "bin" in folders else []),
        **_numbered("pythonpath", "PYTHONPATH", _python_folders(folders, site_packages)),
        **_numbered("pkg_config_path", "PKG_CONFIG_PATH", _pkg_configs(folders)),
    }
    if ament:
        hooks["ament_prefix_path"] = _line("AMENT_PREFIX_PATH", "")
    return hooks


def _line(variable: str, value: str) -> str:
    return f"prepend-non-duplicate;{variable};{value}"


def _numbered(hook: str, variable: str, values: Iterable[str]) -> dict[str, str]:
    """Return a hook for each value; names after the first one have a numeric suffix."""
    return {f"{hook}{number or ''}": _line(variable, value) for number, value in enumerate(values)}


def _find_modules(name: str, folders: dict[str, list[str]]) -> Iterator[str]:
    bases = ("lib64", "lib32", "libx32", "lib", "share")
    for base in bases:
        for below in (f"cmake/{name}", name, f"{name}/cmake", f"{name}/CMake"):
            names = folders.get(f"{base}/{below}", ())
            if any(PurePosixPath(file).match("Find*.cmake") for file in names):
                yield f"{base}/{below}"


def _has_config(folders: dict[str, list[str]]) -> bool:
    return any(
        file.endswith(("Config.cmake", "-config.cmake")) for names in folders.values() for file in names
    )


def _libraries(folders: dict[str, list[str]]) -> Iterator[str]:
    for folder, names in folders.items():
        if folder.startswith("lib") and "/" not in folder and any(name.endswith(".so") for name in names):
            yield folder


def _pkg_configs(folders: dict[str, list[str]]) -> Iterator[str]:
    for folder, names in folders.items():
        path = PurePosixPath(folder)
        known = path.name == "pkgconfig" and path.parts[0].startswith(("lib", "share"))
        if known and any(name.endswith(".pc") for name in names):
            yield folder


def _python_folders(folders: dict[str, list[str]], site_packages: str) -> Iterator[str]:
    for path in (site_packages, site_packages.replace("lib/", "lib64/", 1)):
        if any(folder == path or folder.startswith(f"{path}/") for folder in folders):
            yield path
