"""Name the folders of installed config files for CMake, which would search all prefixes for each of them."""

from __future__ import annotations

import re
from collections import defaultdict
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from forge.base.frozen import Pairs

_CONFIG = re.compile(r"(?P<folder>.*)/(?P<name>[^/]+?)(?P<end>Config|-config)\.cmake")
_USUAL = re.compile(r".*/(?:share/(\w+)/cmake|lib/cmake/(\w+))")
"""Folders in which find_package() finds a config file whatever else the prefix contains."""


def config_folders(files: Iterable[str]) -> Pairs:
    """Return the names and folders of the config files among a package's installed files.

    The folder is '' if it is not for certain that CMake looks there for this name.
    """
    configs = []
    for path in files:
        if config := _CONFIG.fullmatch(path):
            usual = _USUAL.fullmatch(config["folder"])
            certain = usual and config["end"] == "Config" and config["name"] in usual.groups()
            configs.append((config["name"], config["folder"] if certain else ""))
    return tuple(configs)


def config_variables(packages: Iterable[Pairs]) -> dict[str, str]:
    """Return the environment variables NAME_DIR for the config_folders() of several packages.

    find_package(NAME) looks there first, then into CMAKE_PREFIX_PATH. If there are several config files of a
    name, the order of the prefixes decides as usual, and there is no variable.
    """
    folders = defaultdict(set)
    for package in packages:
        for name, folder in package:
            folders[name.lower()].add((name, folder))
    only = (next(iter(configs)) for configs in folders.values() if len(configs) == 1)
    return {f"{name}_DIR": folder for name, folder in only if folder}
