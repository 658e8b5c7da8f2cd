"""Words."""

HELLO = "hello"
