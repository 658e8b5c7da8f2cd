"""Validate the URL of a remote cache."""

from __future__ import annotations

from typing import Final
from urllib.parse import urlsplit

from forge.base.errors import ForgeError, Problem

HTTP: Final = frozenset({"http", "https"})


def check_url(url: str) -> None:
    """Raise ForgeError for an invalid URL; messages do not quote it, since it may contain a password."""
    try:
        parts = urlsplit(url)
        _ = parts.port
    except ValueError:
        parts = urlsplit("")
    is_http = parts.scheme in HTTP
    message, hint = "", "for example: --remote-cache http://HOST:PORT/FOLDER"
    if not parts.scheme or (is_http and not parts.hostname):
        message = "the remote cache is not a valid URL"
    elif not (url.isascii() or not is_http) or any(sign <= (" " if is_http else "\x1f") for sign in url):
        message, hint = "the URL of the remote cache contains invalid characters", "escape them, such as %20"
    elif is_http and (parts.query or parts.fragment):
        message, hint = (
            "the URL of the remote cache has a query or fragment ('?' or '#')",
            "remove it",
        )
    if message:
        raise ForgeError(Problem(message, hint=hint))
