"""The summary of a compiler launcher's work in one build."""

from __future__ import annotations

from forge.base.frozen import frozen


@frozen
class LauncherSummary:
    """For a cache, its hits; for a farm, its hosts and job slots."""

    launcher: str
    compilations: int | None = None
    from_cache: int | None = None
    hosts: int | None = None
    slots: int | None = None

    @property
    def words(self) -> str:
        """The summary as a line of text."""
        if self.compilations is not None:
            whole = _count(self.compilations, "compilation")
            return f"{self.launcher}: {self.from_cache} of {whole} from the cache"
        return f"{self.launcher}: {_count(self.hosts or 0, 'host')} with {_count(self.slots or 0, 'slot')}"


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"
