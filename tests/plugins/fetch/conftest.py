"""The small distribution, released once and copied for each test."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from forge.base.extensions import COMMANDS, is_installed
from tests.plugins.fetch.ros import Ros, small_ros

collect_ignore = [
    *([] if is_installed(COMMANDS, "cache") else ["test_cache.py", "test_package_cache.py"]),
    *([] if is_installed(COMMANDS, "deps") else ["test_system_deps.py"]),
]
"""Tests of `forge cache` and `--cache`, and of system packages, which are other plugins."""


@pytest.fixture(scope="session")
def released(tmp_path_factory: pytest.TempPathFactory) -> Ros:
    """Return the distribution that all tests begin with."""
    return small_ros(tmp_path_factory.mktemp("released"))


@pytest.fixture
def ros(released: Ros, tmp_path: Path) -> Ros:
    """Return a copy of the distribution, which the test may change."""
    root = Path(shutil.copytree(released.root, tmp_path / "ros"))
    return replace(
        released, root=root, repositories={**released.repositories}, manifests={**released.manifests}
    )
