"""Store faults by scope: a single blob, all writing, or the whole store (StoreFault itself)."""

from __future__ import annotations

from forge.cache.model import StoreFault


class BlobFault(StoreFault):
    """One blob or result is corrupt or too large for the store; others are not affected."""


class WritingRefused(StoreFault):
    """The store rejects writing; it may still be read."""
