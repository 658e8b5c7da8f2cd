"""What a forge on a worker is told: our options as words, our environment, what is said about packages."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING

from forge.cluster.shipping_runner import Manifesto
from forge.cluster.surveying import host_name
from forge.overrides import merge, read_overrides
from forge.settings import home

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping
    from pathlib import Path
    from typing import Any

    from forge.model import Package
    from forge.workspace import Loaded

META = "forge_cluster.meta"

_FLAGS = ("merge_install", "no_toolchain_cache", "cmake_target_skip_unavailable")
_WORDS = ("python", "test_result_base", "compiler_launcher", "cmake_target", "cache_size", "load_limit")
_LISTS = ("cmake_args", "ament_cmake_args")
"""Options that say what is built or how; the others say what is seen of it here, or which packages count."""

_ALWAYS = ("build", "--json", "--event-handlers", "console_direct+", "--executor", "parallel")
_OURS = ("FORGE_", "COLCON_")
_TOKEN = "FORGE_CACHE_TOKEN"  # noqa: S105  (the name of a variable)


def manifesto(
    options: argparse.Namespace, loaded: Loaded, variables: Mapping[str, str], remote: str
) -> Manifesto:
    """Return what workers are told; `remote` is the cache by which results come back."""
    root, packages = loaded.workspace.root, loaded.provision.packages
    mine = None if options.ignore_user_meta else home(variables)
    texts = ((META, json.dumps({"names": _said(root, packages, options, mine)})),)
    cache = ("--cache", "../../cache", "--remote-cache", remote)
    patience = ("--cache-timeout", str(options.cache_timeout))
    # The environment of somebody's shell says what is built; what it says to forge itself is said by words.
    environment = {name: value for name, value in variables.items() if not name.startswith(_OURS)}
    environment |= {"FORGE_HOME": ".forge_home"}
    environment |= {_TOKEN: variables[_TOKEN]} if _TOKEN in variables else {}
    return Manifesto(
        root=root,
        packages=packages,
        words=(*_ALWAYS, *cache, *patience, "--metas", META, "--ignore-user-meta", *_words(options)),
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
    """Return the options that take all words that follow; an empty list says nothing."""
    said: list[str] = []
    for name in _LISTS:
        if values := getattr(options, name):
            said += [_spelled(name), *values]
    return tuple(said)


def _spelled(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _said(
    root: Path, packages: Mapping[str, Package], options: argparse.Namespace, mine: Path | None
) -> dict[str, dict[str, Any]]:
    """Return what files beside the packages say about each; what is said in its own folder goes with that."""
    overrides = read_overrides(root, options.metas, mine)
    found: dict[str, dict[str, Any]] = {}
    for name, package in packages.items():
        values: dict[str, Any] = {}
        for said in (overrides.placed(root / package.path), overrides.named(name)):
            merge(values, said)
        if values:
            found[name] = values
    return found
