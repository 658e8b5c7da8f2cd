"""The configuration of remote workers: command-line arguments, environment and package options."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING

from forge.base.env_vars import home
from forge.execution.dask.shipping_runner import RemoteConfig
from forge.execution.dask.surveying import host_name
from forge.workspace.overrides import merge, read_overrides

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping
    from pathlib import Path
    from typing import Any

    from forge.workspace.load import Loaded
    from forge.workspace.model import Package

META = "forge_cluster.meta"

_FLAGS = ("merge_install", "no_toolchain_cache", "cmake_target_skip_unavailable")
_WORDS = ("python", "test_result_base", "compiler_launcher", "cmake_target", "cache_size", "load_limit")
_LISTS = ("cmake_args", "ament_cmake_args")
"""Options that affect what is built and how; all others concern selection and output on this machine."""

_ALWAYS = ("build", "--json", "--event-handlers", "console_direct+", "--executor", "parallel")
_OURS = ("FORGE_", "COLCON_")
_TOKEN = "FORGE_CACHE_TOKEN"  # noqa: S105  (the name of a variable)


def remote_config(
    options: argparse.Namespace, loaded: Loaded, variables: Mapping[str, str], remote: str
) -> RemoteConfig:
    """Return the configuration for workers; `remote` is the URL of the cache that transfers results."""
    root, packages = loaded.workspace.root, loaded.resolution.packages
    user_home = None if options.ignore_user_meta else home(variables)
    texts = ((META, json.dumps({"names": _package_options(root, packages, options, user_home)})),)
    cache = ("--cache", "../../cache", "--remote-cache", remote)
    timeout = ("--cache-timeout", str(options.cache_timeout))
    # Pass the environment on, except variables that configure forge: these are passed as arguments.
    environment = {name: value for name, value in variables.items() if not name.startswith(_OURS)}
    environment |= {"FORGE_HOME": ".forge_home"}
    environment |= {_TOKEN: variables[_TOKEN]} if _TOKEN in variables else {}
    return RemoteConfig(
        root=root,
        packages=packages,
        words=(*_ALWAYS, *cache, *timeout, "--metas", META, "--ignore-user-meta", *_words(options)),
        arguments=_arguments(options),
        environment=environment,
        texts=texts,
        workspace=hashlib.sha256(f"{host_name()}\0{root}".encode(errors="surrogateescape")).hexdigest()[:16],
    )


def _words(options: argparse.Namespace) -> tuple[str, ...]:
    words = [_spelled(name) for name in _FLAGS if getattr(options, name)]
    for name in _WORDS:
        value = getattr(options, name)
        if value:
            words += [_spelled(name), str(value)]
    return tuple(words)


def _arguments(options: argparse.Namespace) -> tuple[str, ...]:
    """Return the variadic options, leaving out empty ones."""
    arguments: list[str] = []
    for name in _LISTS:
        if values := getattr(options, name):
            arguments += [_spelled(name), *values]
    return tuple(arguments)


def _spelled(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _package_options(
    root: Path, packages: Mapping[str, Package], options: argparse.Namespace, user_home: Path | None
) -> dict[str, dict[str, Any]]:
    """Return the options of packages from files outside their folders, which are not shipped with them."""
    overrides = read_overrides(root, options.metas, user_home)
    found: dict[str, dict[str, Any]] = {}
    for name, package in packages.items():
        values: dict[str, Any] = {}
        for override in (overrides.placed(root / package.path), overrides.named(name)):
            merge(values, override)
        if values:
            found[name] = values
    return found
