"""The command-line options of the package cache, and the remote store that they describe."""

from __future__ import annotations

import os
from urllib.parse import urlsplit

from forge.base.errors import ForgeError, Problem, SelectionError, raise_if_any
from forge.base.extensions import OPTIONS, STORES, call, find
from forge.base.frozen import frozen
from forge.base.options import flag, option
from forge.cache.model import RemoteOptions, RemoteStore
from forge.toolchain.resources import memory_limit

_MAX_SECONDS = 1e6
"""The maximum timeout (twelve days), within the range of all system timers."""


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    if not 0 < seconds < float("inf"):
        raise ValueError(f"'{text}' is not a positive number of seconds")
    return min(seconds, _MAX_SECONDS)


def byte_count(text: str) -> int:
    """Return the number of bytes for '500M', '20G' or '0'; raises ValueError with a user message."""
    try:
        size = 0 if text == "0" else memory_limit(text).size
    except ValueError:
        size = None
    if size is None:
        raise ValueError(f"'{text}' is not a size such as 500M or 20G")
    return size


@frozen
class CacheOptions:
    GROUP = "package cache"

    cache: str | None = option(
        "restore installed files of packages from a cache, and store them there (default folder: "
        "~/.cache/forge/packages)",
        nargs="?",
        const="",
        metavar="DIR",
    )
    remote_cache: str | None = option(
        "share results through this remote cache, too: http://HOST:PORT, s3://BUCKET",
        default_factory=lambda: os.environ.get("FORGE_REMOTE_CACHE"),
        metavar="URL",
    )
    cache_read_only: bool = flag("read from the remote cache, but upload nothing")
    cache_timeout: float = option(
        "timeout of the remote cache, after which the build continues without it (default: 10)",
        default=10.0,
        parse=_seconds,
        metavar="SECONDS",
    )
    cache_size: int | None = option(
        "size limit of the cache folder; the least recently used entries are removed first (default: 20G)",
        parse=byte_count,
        metavar="SIZE",
    )

    @property
    def wanted(self) -> bool:
        """Return whether a package cache is enabled."""
        return bool(self.remote_cache) or self.cache is not None

    def check(self) -> None:
        """Raise ForgeError for a folder that is not a cache, or an invalid URL of the remote cache."""
        if self.wanted:
            plugin = find(OPTIONS, "cache", "option", ("open_cache",))
            raise_if_any(plugin.foreign_store(plugin.cache_folder(self.cache, os.environ)), SelectionError)
        if self.remote_cache:
            _scheme(self.remote_cache)


def open_remote(url: str, options: RemoteOptions) -> RemoteStore:
    """Return the store for a URL without connecting to it; fsspec handles schemes without another plugin."""
    scheme, what = _scheme(url), "remote cache backend"
    plugin = find(STORES, scheme, what, ("connect",)) or find(STORES, "fsspec", what)
    store: RemoteStore = call(f"the {what} '{scheme}'", plugin.connect, url, options)
    return store


def _scheme(url: str) -> str:
    """Return the scheme of a URL; messages do not quote the URL, since it may contain a password."""
    try:
        parts = urlsplit(url)
        _ = parts.port
    except ValueError:
        parts = urlsplit("")
    if not parts.scheme:
        hint = "for example: --remote-cache http://HOST:PORT/FOLDER"
        raise ForgeError(Problem("the remote cache is not a valid URL", hint=hint))
    if not url.isprintable():
        message = "the URL of the remote cache contains invalid characters"
        raise ForgeError(Problem(message, hint="escape them, such as %20"))
    return parts.scheme
