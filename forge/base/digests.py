"""Digests of texts."""

from __future__ import annotations

import hashlib


def digest(*parts: str, size: int = 8) -> str:
    """Return the BLAKE2b digest of the parts in this order as hexadecimal digits; file names may be bytes."""
    return hashlib.blake2b("\0".join(parts).encode(errors="surrogateescape"), digest_size=size).hexdigest()
