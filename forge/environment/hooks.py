"""Derives environment variables from the installed files of packages: their hooks, and folders for CMake."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable
from itertools import chain
from pathlib import PurePosixPath

from forge.base.frozen import Pairs

_CONFIG = re.compile(r"(?P<folder>.*)/(?P<name>[^/]+?)(?P<end>Config|-config)\.cmake")
_USUAL = re.compile(r".*/(?:share/(\w+)/cmake|lib/cmake/(\w+))")
"""Folders in which find_package() always finds a config file, regardless of other files."""


def package_hooks(name: str, files: Iterable[str], site_packages: str, *, ament: bool) -> dict[str, str]:
    """Return the dsv line of each hook, by name and in colcon's order.

    `files` are relative to the prefix; `site_packages` is the interpreter's folder below it. `ament` adds the
    prefix to AMENT_PREFIX_PATH, for packages without such a hook.
    """
    folders: dict[str, list[str]] = {}
    for file in sorted(files):
        folder, _, base = file.rpartition("/")
        folders.setdefault(folder, []).append(base)

    def numbered(hook: str, variable: str, values: Iterable[str]) -> dict[str, str]:
        """Return a hook for each value; names after the first one have a numeric suffix."""
        return {f"{hook}{number or ''}": _line(variable, value) for number, value in enumerate(values)}

    find_modules = [
        folder
        for base in ("lib64", "lib32", "libx32", "lib", "share")
        for below in (f"cmake/{name}", name, f"{name}/cmake", f"{name}/CMake")
        for folder in (f"{base}/{below}",)
        if any(file.startswith("Find") and file.endswith(".cmake") for file in folders.get(folder, ()))
    ]
    has_config = any(file.endswith(("Config.cmake", "-config.cmake")) for file in chain(*folders.values()))
    libraries = [
        folder
        for folder, names in folders.items()
        if folder.startswith("lib") and "/" not in folder and any(name.endswith(".so") for name in names)
    ]
    python_folders = [
        path
        for path in (site_packages, site_packages.replace("lib/", "lib64/", 1))
        if any(folder == path or folder.startswith(f"{path}/") for folder in folders)
    ]
    pkg_configs = [
        folder
        for folder, names in folders.items()
        if PurePosixPath(folder).name == "pkgconfig" and folder.startswith(("lib", "share"))
        if any(name.endswith(".pc") for name in names)
    ]
    return {
        **numbered("cmake_module_path", "CMAKE_MODULE_PATH", find_modules),
        **numbered("cmake_prefix_path", "CMAKE_PREFIX_PATH", [""] if has_config else []),
        **{f"ld_library_path_{folder}": _line("LD_LIBRARY_PATH", folder) for folder in libraries},
        **numbered("path", "PATH", ["bin"] if "bin" in folders else []),
        **numbered("pythonpath", "PYTHONPATH", python_folders),
        **numbered("pkg_config_path", "PKG_CONFIG_PATH", pkg_configs),
        **numbered("ament_prefix_path", "AMENT_PREFIX_PATH", [""] if ament else []),
    }


def _line(variable: str, value: str) -> str:
    return f"prepend-non-duplicate;{variable};{value}"


def config_folders(files: Iterable[str]) -> Pairs:
    """Return names and folders of a package's config files; '' if CMake may not look in the folder."""
    configs = []
    for path in files:
        if config := _CONFIG.fullmatch(path):
            usual = _USUAL.fullmatch(config["folder"])
            certain = usual and config["end"] == "Config" and config["name"] in usual.groups()
            configs.append((config["name"], config["folder"] if certain else ""))
    return tuple(configs)


def config_variables(packages: Iterable[Pairs]) -> dict[str, str]:
    """Return the environment variables NAME_DIR for the config_folders() of several packages.

    find_package(NAME) searches them first, then CMAKE_PREFIX_PATH. If there are several config files of a
    name, the order of the prefixes decides as usual, and there is no variable.
    """
    folders = defaultdict(set)
    for package in packages:
        for name, folder in package:
            folders[name.lower()].add((name, folder))
    only = (next(iter(configs)) for configs in folders.values() if len(configs) == 1)
    return {f"{name}_DIR": folder for name, folder in only if folder}
