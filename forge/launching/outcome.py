"""What a compiler launcher did in one build, as numbers and in words; pure."""

from __future__ import annotations

from forge.frozen import frozen


@frozen
class Outcome:
    """Of a cache, how many of the compilations were in it; of a farm, its hosts and the jobs they take."""

    launcher: str
    compilations: int | None = None
    from_cache: int | None = None
    hosts: int | None = None
    slots: int | None = None

    @property
    def words(self) -> str:
        """Return it as a line for people."""
        if self.compilations is not None:
            whole = _count(self.compilations, "compilation")
            return f"{self.launcher}: {self.from_cache} of {whole} from the cache"
        return f"{self.launcher}: {_count(self.hosts or 0, 'host')} with {_count(self.slots or 0, 'slot')}"


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"
