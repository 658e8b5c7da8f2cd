"""Where build, install and log go (workspace spec 5.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forge.frozen import frozen

if TYPE_CHECKING:
    from pathlib import Path


@frozen
class Layout:
    """The absolute folders of one workspace's results, and how packages share them."""

    build: Path
    install: Path
    logs: Path | None
    merged: bool = False
    symlink: bool = False

    def prefix(self, name: str) -> Path:
        """Return where package `name` is installed."""
        return self.install if self.merged else self.install / name

    def build_dir(self, name: str) -> Path:
        """Return where package `name` is built."""
        return self.build / name

    @property
    def word(self) -> str:
        """The marker text that tells other tools how prefixes are shared."""
        return "merged" if self.merged else "isolated"
