"""The packages that a ROS distribution has released, from its public index (REP 141, 143, 153).

The index names, for each distribution, a cache with the manifests of all packages; the library `rosdistro`
finds and reads both. The newest answer is kept in the user's cache, for `--offline`.
"""

from __future__ import annotations

import hashlib
import json
import re
import urllib.request
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from forge.base.env_vars import without_passwords
from forge.base.errors import HostError, Problem, SelectionError
from forge.base.files import replace_file, text_if_exists
from forge.base.frozen import frozen
from forge.base.names import did_you_mean
from forge.plugins.fetch.lock import cache_folder
from forge.workspace.manifest import parse_manifest
from forge.workspace.model import Manifest

_WRAPPING = re.compile(r"<urlopen error |\[Errno -?\d+\] ")
_FORMAT = 1
"""The format of the cached file; files of other formats are read from the index again."""


@frozen
class Release:
    """A released package: the location of its sources, and its manifest as text."""

    name: str
    version: str
    repository: str
    """The URL of a git repository."""
    tag: str
    """The tag whose tree contains the package."""
    manifest: str


@frozen
class Snapshot:
    """The releases of a distribution at one time, by package."""

    distribution: str
    digest: str
    releases: Mapping[str, Release]
    python_version: str

    def manifest(self, name: str) -> Manifest:
        """Return the manifest of a released package, with conditions evaluated; raises WorkspaceError."""
        variables = {
            "ROS_VERSION": "2",
            "ROS_DISTRO": self.distribution,
            "ROS_PYTHON_VERSION": self.python_version,
        }
        content = self.releases[name].manifest.encode()
        return parse_manifest(content, Path(f"{name}/package.xml"), variables)


def read_snapshot(
    distribution: str, variables: Mapping[str, str], url: str | None = None, *, offline: bool = False
) -> Snapshot:
    """Return the releases of a distribution: from the index at `url`, or with `offline` as last read.

    Without `url`, the index is named by ROSDISTRO_INDEX_URL or rosdistro's configuration, else it is the
    public one. Raises HostError if it cannot be read, SelectionError for an unknown distribution.
    """
    path = cache_folder(variables) / "index" / f"{distribution}.json"
    if offline:
        text = text_if_exists(path)
        if text is None or (fields := json.loads(text)).pop("format") != _FORMAT:
            hint = "run 'forge fetch' once with network access"
            raise HostError(Problem(f"the index of '{distribution}' was not downloaded yet", hint=hint))
    else:
        fields = _download(distribution, url)
        replace_file(path, json.dumps({"format": _FORMAT, **fields}).encode())
    releases = {name: Release(name, *values) for name, values in fields.pop("releases").items()}
    return Snapshot(releases=releases, **fields)


def _download(distribution: str, url: str | None) -> dict[str, Any]:
    import rosdistro
    import yaml

    index_url = url or rosdistro.get_index_url()
    try:
        index = rosdistro.get_index(index_url)
        distributions = sorted(name for name, each in index.distributions.items() if _is_ros2(each))
        if distribution not in distributions:
            hint = did_you_mean(distribution, distributions) or f"it has {', '.join(distributions)}"
            message = f"the index '{without_passwords(index_url)}' has no ROS 2 distribution '{distribution}'"
            raise SelectionError(Problem(message, hint=hint))
        text = rosdistro.get_distribution_cache_string(index, distribution)
        # The library's own loader is pure Python, and takes a minute for the 10 MB of a distribution.
        loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
        cache = rosdistro.DistributionCache(distribution, yaml.load(text, Loader=loader))  # noqa: S506
        python_version = str(index.distributions[distribution].get("python_version", 3))
    except SelectionError:
        raise
    except Exception as error:  # the library does not convert exceptions of the standard library
        reason = " ".join(str(error).split()) or type(error).__name__
        # Errors of urllib wrap other errors.
        reason = _WRAPPING.sub("", reason.replace(f" ({index_url})", "")).rstrip(">")
        message = f"cannot read the index of ROS distributions '{without_passwords(index_url)}': {reason}"
        hint = "check the network, name a mirror with ROSDISTRO_INDEX_URL, or use the last answer: --offline"
        raise HostError(Problem(message, hint=hint)) from error
    releases = {}
    for name, package in cache.distribution_file.release_packages.items():
        repository = cache.distribution_file.repositories[package.repository_name].release_repository
        manifest = cache.release_package_xmls.get(name)
        if manifest and repository.version and "release" in repository.tags:
            tag = repository.tags["release"].format(package=name, version=repository.version)
            releases[name] = (repository.version, repository.url, tag, manifest)
    digest = hashlib.sha256(text.encode()).hexdigest()
    return {
        "distribution": distribution,
        "digest": digest,
        "python_version": python_version,
        "releases": releases,
    }


def distributions_with(name: str, url: str | None = None) -> list[str]:
    """Return the distributions of the index that have released a package; empty if it cannot be read."""
    import rosdistro

    distributions = []
    listed = re.compile(rf"^ *- {re.escape(name)} *$|^  {re.escape(name)}: *$", re.MULTILINE)
    with suppress(Exception):  # as above: the answer is only a hint
        for distribution, entry in rosdistro.get_index(
            url or rosdistro.get_index_url()
        ).distributions.items():
            files = entry["distribution"] if _is_ros2(entry) else []
            for file in files:
                with urllib.request.urlopen(file, timeout=15) as answer:  # noqa: S310
                    if listed.search(answer.read().decode()):
                        distributions.append(distribution)
    return distributions


def _is_ros2(entry: Mapping[str, Any]) -> bool:
    return entry.get("distribution_type", "ros2") == "ros2" and "distribution_cache" in entry
