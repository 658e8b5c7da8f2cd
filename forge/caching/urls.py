"""Which words may be the URL of a remote cache."""

from __future__ import annotations

from typing import Final
from urllib.parse import urlsplit

from forge.errors import ForgeError, Problem

HTTP: Final = frozenset({"http", "https"})


def check(url: str) -> None:
    """Raise ForgeError for what is no URL of a folder; it is not quoted, for it may have a password in it."""
    try:
        parts = urlsplit(url)
        _ = parts.port
    except ValueError:
        parts = urlsplit("")
    is_http = parts.scheme in HTTP
    message, hint = "", "write for example --remote-cache http://HOST:PORT/FOLDER"
    if not parts.scheme or (is_http and not parts.hostname):
        message = "what the remote cache is given by is no URL"
    elif not (url.isascii() or not is_http) or any(sign <= (" " if is_http else "\x1f") for sign in url):
        message, hint = "the URL of the remote cache has signs that no URL has", "write them as %20 and so on"
    elif is_http and (parts.query or parts.fragment):
        message, hint = (
            "the URL of the remote cache has '?' or '#', and folders are to follow",
            "leave that out",
        )
    if message:
        raise ForgeError(Problem(message, hint=hint))
