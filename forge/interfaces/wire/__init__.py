"""The serialized form of messages (XCDR1): the layout that the serializers of all languages share."""

__all__ = ["layout", "sizes"]
