"""The package 'probe', generated for each test module that asks for it."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

import pytest

from tests.generated import generate, importable, probe_catalog

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path
    from types import ModuleType


@pytest.fixture(scope="module")
def probe(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Generate the package and let it be imported; gives the folder it is in."""
    folder = tmp_path_factory.mktemp("python")
    generate(folder, probe_catalog())
    with importable(folder):
        yield folder


@pytest.fixture
def msg(probe: Path) -> ModuleType:
    """Import probe.msg."""
    assert (probe / "probe" / "msg").is_dir()
    return import_module("probe.msg")
