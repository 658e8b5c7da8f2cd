"""Options of HTTP stores."""

from __future__ import annotations

import pytest

from forge.base.errors import ForgeError
from forge.cache.http_store import HttpStore


@pytest.mark.parametrize("token", ["a b", "a\r\nX-Evil: 1", "\N{SNOWMAN}"])
def test_a_token_contains_no_whitespace(token: str) -> None:
    with pytest.raises(ForgeError, match="FORGE_CACHE_TOKEN contains a blank"):
        HttpStore("http://127.0.0.1", 1, {"FORGE_CACHE_TOKEN": token})
