"""How far a fault of a store reaches: to one blob, to all writing, or to all of it (StoreFault itself)."""

from __future__ import annotations

from forge.caching.model import StoreFault


class BlobFault(StoreFault):
    """One blob or one result is spoilt, or too much for the store; others may be well."""


class WritingRefused(StoreFault):
    """The store lets nobody write, or not us; what it has may still be read."""
