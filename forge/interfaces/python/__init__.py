"""The Python target: message classes, type stubs and serializers."""
