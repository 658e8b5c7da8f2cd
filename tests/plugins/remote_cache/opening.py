"""Remote stores by URL, as builds open them."""

from collections.abc import Mapping

import pytest

from forge.cache.model import RemoteOptions
from forge.cache.options import open_remote
from forge.plugins.remote_cache.remote import Remote


def opened(
    url: str,
    warnings: list[str] | None = None,
    *,
    seconds: float = 10,
    writable: bool = True,
    variables: Mapping[str, str] | None = None,
) -> Remote:
    """Open a store; without a list of `warnings`, no fault is expected."""
    warn = pytest.fail if warnings is None else warnings.append
    remote = open_remote(url, RemoteOptions(seconds, writable, variables or {}, warn))
    assert isinstance(remote, Remote)
    return remote
