"""The Python target: message classes, type stubs and serializers."""

__all__ = ["types"]
