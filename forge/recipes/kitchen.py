"""What recipes are told and what they return."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from forge.layout import Layout
    from forge.model import Step


@dataclass(frozen=True, slots=True)
class Kitchen:
    """The tools and options that all packages of one build share.

    `configured` tells of each build folder how it was last configured: (generator, record), both
    empty when it was not. `python` is the workspace's interpreter, `site_packages` its folder for
    modules below a prefix. `forge` is the argv that starts this program.
    """

    root: Path
    layout: Layout
    python: Path
    site_packages: str
    forge: tuple[str, ...]
    jobs: int
    cmake: Path | None = None
    ninja: Path | None = None
    cmake_args: tuple[str, ...] = ()
    ament_cmake_args: tuple[str, ...] = ()
    force_configure: bool = False
    environment_generator: str | None = None
    configured: Mapping[str, tuple[str, str]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Recipe:
    """The steps of one package, and the files that forge writes before the first."""

    steps: tuple[Step, ...]
    files: tuple[tuple[Path, str], ...] = ()
